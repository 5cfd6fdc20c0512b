"""The terrain in view: local ground, vertical, slopes, drops and their brims, walls."""
