"""Offline processing of recordings and image files: replay, detect and evaluate."""
