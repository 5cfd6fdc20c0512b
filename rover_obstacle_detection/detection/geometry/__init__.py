"""Cameras, the ground plane and points: from disparity to metres."""
