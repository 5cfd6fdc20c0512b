"""Detectors to compare: one call, a camera and two images in, a mask out."""
