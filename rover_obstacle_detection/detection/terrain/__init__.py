"""The terrain in view: local ground, slope, drop and the vertical."""
