"""Error weights of the tuning score, in a module of its own that needs no NumPy."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Weights:
    """Cost of errors, in units of mean IoU.

    IoU is dominated by the largest obstacles. A missed small rock or a false alarm matters just
    as much to the rover.

    Parameters
    ----------
    missed : float
        Cost of missing every obstacle: at 0.5, missing 10 % costs 0.05.
    false_alarm : float
        Cost of one false alarm per frame: at 0.1, one in every second frame costs 0.05.
    """

    missed: float = 0.5
    false_alarm: float = 0.1
