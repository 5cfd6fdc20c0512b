"""What the detector saw in one pair, and each step on the way there."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.geometry.reprojection import reproject
from rover_obstacle_detection.detection.rectification.lens_distortion import (
    STRAIGHT_LENSES,
    Lenses,
)
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT, RowAlignment
from rover_obstacle_detection.detection.result.confidence import (
    ObstacleEvidence,
    confidence,
    measure_evidence,
)
from rover_obstacle_detection.detection.result.cue import Cue as Cue
from rover_obstacle_detection.detection.result.obstacles import (
    NumberedObstacles,
    Obstacle,
    describe_obstacles,
    number_obstacles,
)

Product = NDArray[Any] | Callable[[], NDArray[Any]]

OBSTACLE = 255
FREE = 0


@dataclass(frozen=True, eq=False)
class Detection:
    """The result of one image pair, immutable, with every intermediate product by name.

    Products that the decision itself did not need are computed when first asked for.

    Parameters
    ----------
    camera : StereoCamera
    config : DetectorConfig
    ground : GroundPlane
        The ground in view, and with it the vertical.
    products : mapping of str to array or callable
        Arrays of the left image's size, or functions that make them.
    alignment : RowAlignment
        Rows by which the right image was off, made good.
    lenses : Lenses
        Distortion that rectification left, made good.
    """

    camera: StereoCamera
    config: DetectorConfig
    ground: GroundPlane
    products: Mapping[str, Product]
    alignment: RowAlignment = STRAIGHT
    lenses: Lenses = STRAIGHT_LENSES

    @cached_property
    def grey(self) -> NDArray[np.uint8]:
        """Left image in grey, shape (height, width)."""
        return self._product('grey')

    @cached_property
    def disparity(self) -> NDArray[np.float32]:
        """Disparity in pixels, less the camera's offset; 0 where there is no match.

        Where lenses bend it is that of the straightened images: depth follows from it as ever,
        the direction is that of `points`.
        """
        return self._product('disparity')

    @cached_property
    def points(self) -> NDArray[np.float32]:
        """Position in the left optical frame, metres, shape (height, width, 3); NaN where none."""
        if 'points' in self.products:
            return self._product('points')
        return _frozen(reproject(self.disparity, self.camera))

    @cached_property
    def regions(self) -> NDArray[np.int32]:
        """Number of each pixel's mean-shift region, 1 and up: every pixel has one."""
        return self._product('regions')

    @cached_property
    def seeds(self) -> NDArray[np.bool_]:
        """Pixels of the regions with enough 3D points to be judged by them."""
        return self._product('seeds')

    @cached_property
    def roughness(self) -> NDArray[np.float32]:
        """Mean distance of a window's points from their plane, metres; NaN where none."""
        return self._product('roughness')

    @cached_property
    def step(self) -> NDArray[np.float32]:
        """Largest elevation difference within a window, metres; NaN where none."""
        return self._product('step')

    @cached_property
    def height(self) -> NDArray[np.float32]:
        """Height above the local ground, metres; NaN where there is no 3D."""
        return self._product('height')

    @cached_property
    def height_noise(self) -> NDArray[np.float32]:
        """Standard deviation of the height of a single pixel, metres; infinite without 3D."""
        return self._product('height_noise')

    @cached_property
    def rock_probability(self) -> NDArray[np.float32]:
        """How likely the outline filter holds a pixel for a rock; NaN where it was not asked."""
        if 'rock_probability' not in self.products:
            return _frozen(np.full(self.mask.shape, np.nan, np.float32))
        return self._product('rock_probability')

    @cached_property
    def cues(self) -> NDArray[np.uint8]:
        """What made each pixel an obstacle: the flags of `Cue`, 0 where nothing did."""
        return self._product('cues')

    @cached_property
    def known(self) -> NDArray[np.bool_]:
        """Pixels that a cue could judge, less what was taken back: unknown is not free."""
        return self._product('known')

    @cached_property
    def mask(self) -> NDArray[np.uint8]:
        """The obstacle mask: 0 free, 255 obstacle."""
        return self._product('mask')

    @cached_property
    def obstacle_numbers(self) -> NDArray[np.int32]:
        """Number of each pixel's obstacle: ``obstacles[0]`` is number 1; 0 where there is none."""
        return _frozen(self._numbered.image)

    @cached_property
    def evidence(self) -> ObstacleEvidence:
        """What speaks for each of the obstacles, in their order."""
        return measure_evidence(
            self.obstacle_numbers,
            grey=self.grey,
            disparity=self.disparity,
            height_m=self.height,
            noise_m=self.height_noise,
            rock_probability=self.rock_probability,
            cues=self.cues,
            max_step_m=self.config.max_step,
            window_px=self.config.block_size,
        )

    @cached_property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The connected obstacles, each with its box in the image and in space, largest first."""
        return describe_obstacles(self._numbered, self.points, self.height, self._confidences)

    @cached_property
    def confidence(self) -> NDArray[np.float32]:
        """How sure it is that a pixel's obstacle is one, 0 to 1; 0 where there is no obstacle."""
        return _frozen(np.append(np.float32(0), self._confidences)[self.obstacle_numbers])

    @cached_property
    def obstacle_points(self) -> NDArray[np.float32]:
        """Points on obstacles, one per obstacle pixel with 3D, row by row.

        Shape (n, 5): x, y, z in the left optical frame and height above the local ground, metres;
        confidence.
        """
        return self._cloud(self.mask == OBSTACLE, self.confidence)

    @cached_property
    def ground_points(self) -> NDArray[np.float32]:
        """Points on free ground, row by row, shape (n, 4): as `obstacle_points`, less the last."""
        return self._cloud(self.mask == FREE)

    @cached_property
    def _numbered(self) -> NumberedObstacles:
        return number_obstacles(self.mask)

    @cached_property
    def _confidences(self) -> NDArray[np.float32]:
        return confidence(self.evidence, self.config.method)

    def _cloud(self, where: NDArray[np.bool_], *more: NDArray[np.float32]) -> NDArray[np.float32]:
        """Collect points and heights of judged pixels: unknown is neither obstacle nor free."""
        where = where & self.known & (self.disparity > 0) & np.isfinite(self.height)
        columns = [each[where] for each in (self.points, self.height, *more)]
        return _frozen(np.column_stack(columns))

    def _product(self, name: str) -> NDArray[Any]:
        product = self.products[name]
        return _frozen(product() if callable(product) else product)


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    array.flags.writeable = False
    return array
