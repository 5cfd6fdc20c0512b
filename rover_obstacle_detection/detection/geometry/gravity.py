"""Which way is up: the vertical and the ground plane in the left optical frame."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Gravity:
    """The vertical as seen by the camera, from a parameter, an IMU or TF.

    Parameters
    ----------
    up : tuple of float
        Unit vector against gravity in the left optical frame (x right, y down, z forward).
    height_m : float, optional
        Height of the left eye above the ground, where known.
    """

    up: tuple[float, float, float]
    height_m: float | None = None

    @classmethod
    def from_angles(
        cls, pitch_deg: float, roll_deg: float = 0.0, height_m: float | None = None
    ) -> Gravity:
        """Make it of the optical axis's angle below the horizon and the clockwise roll."""
        pitch, roll = math.radians(pitch_deg), math.radians(roll_deg)
        return cls(
            up=(
                -math.sin(roll) * math.cos(pitch),
                -math.cos(roll) * math.cos(pitch),
                -math.sin(pitch),
            ),
            height_m=height_m,
        )
