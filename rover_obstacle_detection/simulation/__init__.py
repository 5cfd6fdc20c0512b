"""Rendered planetary scenes with exact truth: terrain, rocks, light, cameras, labelled bags."""
