"""What stands on the ground: candidates, their outlines, and which are too high."""
