"""Disparity of ground whose height is a function of the place, and its survey.

World frame as in `synthetic`: x right, y forward, z up. The origin lies under the left camera.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from synthetic import pinhole

from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.stereo.matching import Stereo
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.surface import Surface
from rover_obstacle_detection.detection.terrain.survey import survey
from rover_obstacle_detection.detection.terrain.terrain import Terrain

CAMERA = pinhole(200, 150, 60.0, 0.15)
PARAMETERS = TerrainParameters()

Height = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class PosedCamera:
    """A stereo camera above the ground; its height is over z = 0."""

    camera: StereoCamera = CAMERA
    pitch_deg: float = 30.0
    height_m: float = 1.2
    roll_deg: float = 0.0

    @property
    def up(self) -> tuple[float, float, float]:
        return Gravity.from_angles(self.pitch_deg, self.roll_deg).up

    @property
    def axes(self) -> np.ndarray:
        """Unit vectors of x, y and z in the left optical frame, as rows."""
        up = np.asarray(self.up)
        across = np.array([1.0, 0.0, 0.0]) - up * up[0]
        across /= np.linalg.norm(across)
        return np.stack((across, np.cross(up, across), up))

    @property
    def level_ground(self) -> GroundPlane:
        return GroundPlane(self.up, self.height_m, self.up)

    def look(self, height: Height) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Disparity of each pixel and the x, y that it shows; 0 where it shows no ground."""
        x_over_z, y_over_z = self.camera.rays()
        rays = np.stack(np.broadcast_arrays(x_over_z, y_over_z, np.float32(1)), axis=-1)
        steps = np.moveaxis(rays @ self.axes.T, -1, 0)
        depth = np.zeros(steps[0].size)
        pixels, (x_step, y_step, z_step) = np.arange(depth.size), steps.reshape(3, -1)
        # Height over the ground; 0 once landed.
        nearest, over = 0.0, np.full(depth.size, self.height_m)
        for number, farther in enumerate(np.geomspace(0.1, 40.0, 500)):
            z = self.height_m + farther * z_step - height(farther * x_step, farther * y_step)
            landed = np.flatnonzero((z <= 0) & (over > 0))
            share = over[landed] / (over[landed] - z[landed])
            depth[pixels[landed]] = nearest + share * (farther - nearest)
            nearest, over = farther, np.where(over > 0, np.maximum(z, 0), 0)
            if number % 20 == 0:
                # Only the rays that have not landed go on.
                pixels, x_step, y_step, z_step, over = (
                    each[over > 0] for each in (pixels, x_step, y_step, z_step, over)
                )
        depth = depth.reshape(self.camera.shape)
        seen = depth > 0
        disparity = np.zeros(self.camera.shape, np.float32)
        disparity[seen] = self.camera.disparity_at(1.0) / depth[seen]
        return disparity, depth * steps[0], depth * steps[1]

    def stereo(self, disparity: np.ndarray, noise_px=0.05, ground=None) -> Stereo:
        """Make a disparity the result of matching, by default over z = 0. The images are black."""
        black = np.zeros(self.camera.shape, np.uint8)
        ground = ground or self.level_ground
        return Stereo(
            Frame((black, black), self.camera),
            ground,
            DisparityPlane.from_ground(ground, self.camera).disparity(self.camera),
            disparity,
            np.broadcast_to(np.float32(noise_px), disparity.shape),
            grey_noise=1.0,
            texture=0.0,
        )

    def survey(
        self, height: Height, noise_px=0.05, ground=None, parameters=PARAMETERS
    ) -> tuple[Terrain, np.ndarray, np.ndarray, np.ndarray]:
        """Survey ground matched without error.

        Returns the terrain, and each pixel's disparity, x and y.
        """
        disparity, x, y = self.look(height)
        return survey(self.stereo(disparity, noise_px, ground), parameters), disparity, x, y


def flat(x, y):
    return 0 * x


def tilted(rise_x=0.0, rise_y=0.0) -> Height:
    return lambda x, y: rise_x * x + rise_y * y


def bank(angle_deg, start_m, softness_m=0.0) -> Height:
    """Level ground that rises (or falls) from a distance on.

    The slope changes over about the softness to either side.
    """
    rise = np.tan(np.radians(angle_deg))

    def height(x, y):
        if not softness_m:
            return rise * np.maximum(y - start_m, 0)
        return rise * softness_m * np.logaddexp(0, (y - start_m) / softness_m)

    return height


def block(x, y, size_m, height_m) -> Height:
    """An upright block (or hole) centred at x, y."""
    half = size_m / 2
    return lambda at_x, at_y: height_m * (np.maximum(abs(at_x - x), abs(at_y - y)) < half)


def together(*heights: Height) -> Height:
    return lambda x, y: sum(height(x, y) for height in heights)


def terrain_of(height_m, noise_m, layers=()):
    """Terrain of the given heights, with a camera 1 m above it and 100 pixels to a metre."""
    noise_m = np.broadcast_to(np.float32(noise_m), height_m.shape)
    return Terrain(height_m, noise_m, np.ones_like(height_m), np.full_like(height_m, 100), layers)


def surface_of(height_m, noise_px=0.0):
    """A surface with given heights, shape (rows, columns), and 30 px of disparity everywhere."""
    rows, columns = np.shape(height_m)
    camera = StereoCamera(columns, rows, 20.0, 20.0, 1.0, 1.0, 0.15)
    posed = PosedCamera(camera, pitch_deg=30.0, height_m=1.2)
    stereo = posed.stereo(np.full((rows, columns), 30, np.float32), noise_px)
    surface = Surface(stereo, PARAMETERS)
    surface.height_m = np.array(height_m, np.float32)
    return surface
