"""Obstacle detection in rectified stereo pairs: arrays in, arrays out."""
