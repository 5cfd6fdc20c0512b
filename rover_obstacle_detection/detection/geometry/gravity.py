"""The direction of gravity in the left optical frame."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Gravity:
    """The vertical in the left optical frame, from parameters, an IMU or TF.

    Parameters
    ----------
    up : tuple of float
        Unit vector against gravity (x right, y down, z forward).
    height_m : float, optional
        Height of the left camera above the ground, where it is known.
    """

    up: tuple[float, float, float]
    height_m: float | None = None

    def mirrored(self) -> Gravity:
        """Return the same in images with their rows in reverse order."""
        x, y, z = self.up
        return replace(self, up=(x, -y, z))

    @classmethod
    def from_angles(
        cls, pitch_deg: float, roll_deg: float = 0.0, height_m: float | None = None
    ) -> Gravity:
        """Compute the vertical from the camera's mounting angles.

        Parameters
        ----------
        pitch_deg : float
            Angle of the optical axis below the horizon, degrees.
        roll_deg : float
            Clockwise roll about the optical axis, degrees.
        height_m : float, optional
            Height of the left camera above the ground.
        """
        pitch, roll = math.radians(pitch_deg), math.radians(roll_deg)
        return cls(
            up=(
                -math.sin(roll) * math.cos(pitch),
                -math.cos(roll) * math.cos(pitch),
                -math.sin(pitch),
            ),
            height_m=height_m,
        )
