"""What stands on the ground: evidence, outlines and which rocks are too high."""
