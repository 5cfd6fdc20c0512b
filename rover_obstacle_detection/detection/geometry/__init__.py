"""Cameras, points and the ground plane; warnings where it contradicts what is known."""
