"""The ground plane, in space and in disparity."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity


@dataclass(frozen=True)
class GroundPlane:
    """The plane of the visible ground: ``normal . point = -height_m``.

    Parameters
    ----------
    normal : tuple of float
        Upward unit normal in the left optical frame.
    height_m : float
        Distance of the left optical centre from the plane.
    up : tuple of float
        Unit vector against gravity. The normal itself where gravity is not known.
    measured : bool
        False where no plane was found and the known or default mounting was assumed.
    residual : float
        Mean squared deviation of the lowest points from the plane, in standard deviations and
        truncated: the share of points that lie elsewhere follows from it.
    """

    normal: tuple[float, float, float]
    height_m: float
    up: tuple[float, float, float]
    measured: bool = True
    residual: float = 0.0

    def mirrored(self) -> GroundPlane:
        """Return the same in images with their rows in reverse order."""
        (x, y, z), (up_x, up_y, up_z) = self.normal, self.up
        return replace(self, normal=(x, -y, z), up=(up_x, -up_y, up_z))

    @property
    def pitch_deg(self) -> float:
        """Angle of the optical axis below the horizon, degrees."""
        return math.degrees(math.asin(max(-1.0, min(1.0, -self.up[2]))))

    @property
    def slope_deg(self) -> float:
        """Slope of the plane relative to the horizontal, degrees."""
        cosine = float(np.dot(self.normal, self.up))
        return math.degrees(math.acos(max(-1.0, min(1.0, cosine))))

    @property
    def up_vector(self) -> NDArray[np.float32]:
        """The vertical as an array of float32, shape (3,)."""
        return np.asarray(self.up, np.float32)


@dataclass(frozen=True)
class DisparityPlane:
    """A plane in space, expressed in disparity: ``d = a (u - cx) + b (v - cy) + c``.

    Parameters
    ----------
    slope_u, slope_v : float
        Change of disparity per column and row (a and b).
    level : float
        Disparity at the principal point (c), pixels.
    residual : float
        See `GroundPlane`.
    """

    slope_u: float
    slope_v: float
    level: float
    residual: float = 0.0

    @classmethod
    def from_ground(cls, ground: GroundPlane, camera: StereoCamera) -> DisparityPlane:
        """Convert a plane in space to disparity."""
        scale = -camera.fx * camera.baseline_m / ground.height_m
        x, y, z = ground.normal
        return cls(scale * x / camera.fx, scale * y / camera.fy, scale * z)

    def disparity(self, camera: StereoCamera) -> NDArray[np.float32]:
        """Compute the disparity of the plane at each pixel.

        Returns
        -------
        ndarray of float32, shape (height, width)
            Pixels; below 0 above the horizon.
        """
        columns = self.slope_u * (np.arange(camera.width) - camera.cx)[np.newaxis]
        rows = self.slope_v * (np.arange(camera.height) - camera.cy)[:, np.newaxis]
        disparity = np.empty(camera.shape, np.float32)
        np.add(columns, rows + self.level, out=disparity, casting='same_kind')
        return disparity

    def in_space(self, camera: StereoCamera, gravity: Gravity | None) -> GroundPlane:
        """Convert the plane to space.

        Without gravity, the plane's normal is used as the vertical.
        """
        direction = np.array([self.slope_u * camera.fx, self.slope_v * camera.fy, self.level])
        length = float(np.linalg.norm(direction))
        x, y, z = (float(value) for value in -direction / length)
        return GroundPlane(
            normal=(x, y, z),
            height_m=camera.fx * camera.baseline_m / length,
            up=gravity.up if gravity else (x, y, z),
            residual=self.residual,
        )
