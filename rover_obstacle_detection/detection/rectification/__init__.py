"""Residual rectification error: row offset, turn and lens distortion."""
