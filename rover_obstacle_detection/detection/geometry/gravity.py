"""Which way is up: the vertical and the ground plane in the left optical frame."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


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


@dataclass(frozen=True)
class GroundPlane:
    """The plane of the ground in view: ``normal . point = -height_m``.

    Parameters
    ----------
    normal : tuple of float
        Unit normal of the ground, upward, in the left optical frame.
    height_m : float
        Distance of the left eye from the plane, metres.
    up : tuple of float
        Unit vector against gravity; the normal itself where gravity is estimated.
    """

    normal: tuple[float, float, float]
    height_m: float
    up: tuple[float, float, float]

    @property
    def pitch_deg(self) -> float:
        """Angle of the optical axis below the horizon, degrees."""
        return math.degrees(math.asin(max(-1.0, min(1.0, -self.up[2]))))

    @property
    def slope_deg(self) -> float:
        """Slope of the plane against the horizontal, degrees."""
        cosine = float(np.dot(self.normal, self.up))
        return math.degrees(math.acos(max(-1.0, min(1.0, cosine))))

    @property
    def up_vector(self) -> NDArray[np.float32]:
        """The vertical as an array, shape (3,)."""
        return np.asarray(self.up, np.float32)
