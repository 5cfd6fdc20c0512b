"""Stages and intermediate results of the study's method."""
