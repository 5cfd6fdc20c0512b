"""Mean-shift regions and the pixels that only they can judge."""
