"""What mistakes cost when parameters are chosen; apart, so that a help text costs no NumPy."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Weights:
    """What a mistake costs, in mean IoU.

    Overlap alone is made by the pixels of the largest obstacles. A rock of 200 pixels that is
    missed stops the rover all the same, and so does a false alarm.

    Parameters
    ----------
    missed : float
        Of all obstacles missed. At 0.5 one in ten is worth 0.05.
    false_alarm : float
        Of one false alarm in every frame. At 0.1 one in every second frame is worth as much as
        one obstacle missed in ten.
    """

    missed: float = 0.5
    false_alarm: float = 0.1
