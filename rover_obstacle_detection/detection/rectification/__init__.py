"""Residual rectification errors (row misalignment, lens distortion) and their correction."""
