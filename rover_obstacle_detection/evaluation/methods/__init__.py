"""Detectors to compare: from a camera and two images to a mask."""
