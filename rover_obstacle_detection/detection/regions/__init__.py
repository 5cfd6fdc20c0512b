"""Mean-shift regions, and pixels that are judged by their region."""
