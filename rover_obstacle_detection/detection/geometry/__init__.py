"""Cameras, planes and points: from disparity to metres."""
