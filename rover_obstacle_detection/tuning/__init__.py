"""Optimise detector parameters on labelled recordings (extra ``tune``).

Importing it without Optuna raises `MissingExtraError`.
"""

from rover_obstacle_detection.errors import MissingExtraError

try:
    import optuna
except ImportError as error:
    raise MissingExtraError(
        'tuning needs optuna, which is not installed: pip install optuna'
    ) from error

optuna.logging.set_verbosity(optuna.logging.WARNING)
