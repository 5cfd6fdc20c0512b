"""The detection: cues, mask, known pixels, clouds, obstacles and their confidence."""
