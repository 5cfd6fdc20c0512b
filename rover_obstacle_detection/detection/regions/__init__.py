"""Mean-shift regions, for the study's method and the debug pictures."""
