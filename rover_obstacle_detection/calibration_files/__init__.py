"""Stereo calibrations from numbers and from the files of other tools."""
