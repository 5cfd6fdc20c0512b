"""The detection: cues, mask, clouds, obstacles and their confidence."""
