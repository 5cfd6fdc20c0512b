"""Figures against labels: what a detector finds, misses and invents."""
