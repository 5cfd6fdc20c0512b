"""From an upright view back to the images of a camera that is mounted upside down."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.detection.result.evidence import ObstacleEvidence
from rover_obstacle_detection.detection.result.grid import ObstacleGrid, mirrored_grid
from rover_obstacle_detection.detection.result.obstacles import Obstacle
from rover_obstacle_detection.detection.result.rims import Rims

_PER_PIXEL = (
    'grey',
    'disparity',
    'height',
    'height_noise',
    'rock_probability',
    'cues',
    'known',
    'mask',
)
_MIRROR = np.array([1, -1, 1], np.float32)


def in_recorded_images(detection: Detection, camera: StereoCamera) -> Detection:
    """Return what was found in images with their rows reversed as found in the images themselves.

    Parameters
    ----------
    detection : Detection
        Made from the upright view: rows reversed, which shows the world in a mirror.
    camera : StereoCamera
        Of the images themselves.
    """
    own = {each.name: getattr(detection, each.name) for each in fields(Detection)}
    own |= {name: rows_reversed(own[name]) for name in _PER_PIXEL}
    own |= {
        'camera': camera,
        'ground': detection.ground.mirrored(),
        'correction': detection.correction.mirrored(),
    }
    own['study'] = replace(
        detection.study,
        grey=own['grey'],
        disparity=own['disparity'],
        camera=camera,
        up=own['ground'].up_vector,
    )
    if detection.remapping is not None:
        own['remapping'] = detection.remapping.mirrored()
    return UpsideDownDetection(**own, upright=detection)


def rows_reversed(array: NDArray[Any]) -> NDArray[Any]:
    """Return a copy with the rows in reverse order."""
    # Not ascontiguousarray, which copies nothing of a single row.
    return array[::-1].copy()


@dataclass(frozen=True, eq=False, repr=False)
class UpsideDownDetection(Detection):
    """A detection in the images of a camera that is mounted upside down.

    Everything was found in the upright view, and is that of the camera's own images and frame.

    Parameters
    ----------
    upright : Detection
        In the upright view.
    """

    upright: Detection = None  # type: ignore[assignment]

    @property
    def regions(self) -> NDArray[np.int32]:
        """Mean-shift region of each pixel, 1 and up."""
        return _read_only(rows_reversed(self.upright.regions))

    @property
    def seeds(self) -> NDArray[np.bool_]:
        """Pixels of the regions with enough 3D points to be judged by them."""
        return _read_only(rows_reversed(self.upright.seeds))

    @cached_property
    def points(self) -> NDArray[np.float32]:
        """Position in the left optical frame, metres, shape (height, width, 3); NaN where none."""
        return _read_only(rows_reversed(self.upright.points) * _MIRROR)

    @cached_property
    def obstacle_numbers(self) -> NDArray[np.int32]:
        """Number of each pixel's obstacle: ``obstacles[0]`` has number 1; 0 is no obstacle."""
        return _read_only(rows_reversed(self.upright.obstacle_numbers))

    @cached_property
    def evidence(self) -> ObstacleEvidence:
        """Evidence for each of the obstacles, in their order."""
        return self.upright.evidence

    @cached_property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The connected obstacles, each with its box in the image and in space, largest first."""
        return tuple(_mirrored(each, self.camera.height) for each in self.upright.obstacles)

    @cached_property
    def rims(self) -> Rims:
        """Pixels at the rims of obstacles that were matched to the other side of the outline."""
        return Rims(*(_read_only(rows_reversed(each)) for each in self.upright.rims))

    @cached_property
    def obstacle_points(self) -> NDArray[np.float32]:
        """Points on obstacles, as `Detection.obstacle_points`, each row from right to left."""
        return _mirrored_cloud(self.upright.obstacle_points)

    @cached_property
    def obstacle_point_kinds(self) -> NDArray[np.uint8]:
        """Kind of the pixel of each of the `obstacle_points`, by `KIND_NUMBERS`; shape (n,)."""
        return _read_only(rows_reversed(self.upright.obstacle_point_kinds))

    @cached_property
    def ground_points(self) -> NDArray[np.float32]:
        """Points on free ground, as `Detection.ground_points`, each row from right to left."""
        return _mirrored_cloud(self.upright.ground_points)

    @cached_property
    def grid(self) -> ObstacleGrid:
        """The ground from above: cells with obstacle points, with free pixels, and unknown."""
        grid = mirrored_grid(self.upright.grid)
        _read_only(grid.cells)
        return grid


def _mirrored_cloud(cloud: NDArray[np.float32]) -> NDArray[np.float32]:
    mirrored = rows_reversed(cloud)
    mirrored[:, 1] *= -1
    return _read_only(mirrored)


def _mirrored(obstacle: Obstacle, height_px: int) -> Obstacle:
    low, high = obstacle.minimum_m, obstacle.maximum_m
    return replace(
        obstacle,
        top=height_px - obstacle.top - obstacle.height,
        minimum_m=(low[0], -high[1], low[2]),
        maximum_m=(high[0], -low[1], high[2]),
    )


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    array.flags.writeable = False
    return array
