"""Residual rectification errors, rows that are off and lens distortion, and their correction."""
