"""Trained networks: their files, and what runs them."""
