"""Scoring of detectors against labels."""
