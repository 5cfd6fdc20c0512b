"""What ray-cast scenes are made of: surfaces, light, and the camera that looks at them.

World frame as in `synthetic`: x right, y forward, z up. The origin lies on the ground under the
left camera.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity

# What a surface asks of the detector, per pixel.
FREE, OBSTACLE, NOT_FREE, BRIM, BLIND, UNCOUNTED = 0, 1, 2, 3, 4, 255

UNBOUNDED = (-80.0, 80.0)


@dataclass(frozen=True)
class Rig:
    """A stereo camera with square pixels and its pose above the ground."""

    width: int = 640
    height: int = 480
    focal_px: float = 500.0
    baseline_m: float = 0.12
    height_m: float = 0.9
    pitch_deg: float = 25.0
    roll_deg: float = 0.0
    name: str = 'rig'

    def with_(self, **changes) -> Rig:
        return replace(self, **changes)

    def resized(self, width: int) -> Rig:
        """Return the same rig with smaller or larger images."""
        scale = width / self.width
        return self.with_(
            width=width, height=round(self.height * scale), focal_px=self.focal_px * scale
        )

    @property
    def camera(self) -> StereoCamera:
        return StereoCamera(
            self.width,
            self.height,
            self.focal_px,
            self.focal_px,
            (self.width - 1) / 2,
            (self.height - 1) / 2,
            self.baseline_m,
        )

    @property
    def gravity(self) -> Gravity:
        return Gravity.from_angles(self.pitch_deg, self.roll_deg, self.height_m)

    def in_camera(self, points: np.ndarray) -> np.ndarray:
        """Transform points of the world, shape (..., 3), to the left optical frame."""
        return (np.asarray(points) - (0.0, 0.0, self.height_m)) @ self.axes.T

    @property
    def axes(self) -> np.ndarray:
        """Right, down and forward of the camera in the world, as rows."""
        pitch, roll = math.radians(self.pitch_deg), math.radians(self.roll_deg)
        forward = np.array([0.0, math.cos(pitch), -math.sin(pitch)])
        down = np.array([0.0, -math.sin(pitch), -math.cos(pitch)])
        right = np.array([1.0, 0.0, 0.0])
        return np.stack(
            (
                math.cos(roll) * right + math.sin(roll) * down,
                -math.sin(roll) * right + math.cos(roll) * down,
                forward,
            )
        )


@dataclass(frozen=True)
class Look:
    """How a surface looks.

    ``contrast`` is the standard deviation of its texture, as a share of its grey level. ``mirror``
    is the share of the light that it mirrors. ``tile_m`` is the side of square slabs with dark
    joints of ``joint_m``; 0: none.
    """

    grey: float = 120.0
    contrast: float = 0.22
    mirror: float = 0.0
    tile_m: float = 0.0
    joint_m: float = 0.006


@dataclass(frozen=True, eq=False)
class Patch:
    """A flat rectangle: ``corner + a u + b v`` for a and b within their ranges.

    ``u`` and ``v`` are orthogonal unit vectors. Patches of the same ``skin`` continue each other's
    texture where their a and b do; by default each has its own.
    """

    corner: tuple[float, float, float]
    u: tuple[float, float, float]
    v: tuple[float, float, float]
    u_range: tuple[float, float] = UNBOUNDED
    v_range: tuple[float, float] = UNBOUNDED
    look: Look = Look()
    expect: int = FREE
    skin: int | None = None

    @property
    def normal(self) -> np.ndarray:
        return np.cross(self.u, self.v)

    def at(self, a: float, b: float) -> np.ndarray:
        return np.asarray(self.corner) + a * np.asarray(self.u) + b * np.asarray(self.v)

    @property
    def corners(self) -> np.ndarray:
        (u0, u1), (v0, v1) = self.u_range, self.v_range
        return np.stack([self.at(*ab) for ab in ((u0, v0), (u1, v0), (u1, v1), (u0, v1))])


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    centre: tuple[float, float, float]
    radii: tuple[float, float, float]
    look: Look = Look()
    expect: int = OBSTACLE
    skin: int | None = None


Surface = Patch | Ellipsoid


@dataclass(frozen=True)
class Shadow:
    """All that lies within these ranges of x and y gets only this share of the light."""

    x_range: tuple[float, float]
    y_range: tuple[float, float]
    light: float = 0.04


@dataclass(frozen=True)
class Light:
    """Light, air and sensor.

    ``fog`` is the extinction per metre, ``veil`` the share of stray light of the sky's grey level
    in the lenses. Noise is in grey levels.
    """

    sky: float = 205.0
    fog: float = 0.0
    veil: float = 0.0
    noise: float = 1.5
    exposure: float = 1.0
    shadows: tuple[Shadow, ...] = ()


DAYLIGHT = Light()
