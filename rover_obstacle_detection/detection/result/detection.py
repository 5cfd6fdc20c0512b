"""The result of one image pair, with all intermediate results."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.geometry.reprojection import reproject
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.rectification.correction import (
    UNCORRECTED,
    Correction,
    Remapping,
)
from rover_obstacle_detection.detection.rectification.lens_distortion import Lenses
from rover_obstacle_detection.detection.rectification.row_alignment import RowAlignment
from rover_obstacle_detection.detection.result.carried import Carrier
from rover_obstacle_detection.detection.result.confidence import confidence
from rover_obstacle_detection.detection.result.evidence import ObstacleEvidence, measure_evidence
from rover_obstacle_detection.detection.result.grid import ObstacleGrid, obstacle_grid
from rover_obstacle_detection.detection.result.obstacles import (
    NumberedObstacles,
    Obstacle,
    describe_obstacles,
    main_kinds,
    number_obstacles,
    pixel_kinds,
)
from rover_obstacle_detection.detection.result.rims import STANDING, Rims, find_rims
from rover_obstacle_detection.detection.result.thinning import one_per_cell
from rover_obstacle_detection.detection.study.products import StudyProducts
from rover_obstacle_detection.wording import counted

OBSTACLE = 255
FREE = 0


@dataclass(frozen=True, eq=False, repr=False)
class Detection:
    """The result of one image pair. Immutable: all arrays are read-only.

    What was not needed to decide is computed on first access. To save a detection, pickle it.

    Parameters
    ----------
    camera : StereoCamera
    parameters : DetectorParameters
    ground : GroundPlane
        The visible ground, and the vertical.
    grey : ndarray of uint8, shape (height, width)
        Left image in grey. If it was matched at this size, as it was matched: smoothed if noisy.
    disparity : ndarray of float32, shape (height, width)
        Pixels, without the camera's offset; 0 where there is no match. Between straightened images
        where lens distortion was corrected: depth follows from it as usual, the direction of a
        pixel from `points`.
    height : ndarray of float32, shape (height, width)
        Height above the local ground, metres; NaN where there is no 3D.
    height_noise : ndarray of float32, shape (height, width)
        Standard deviation of the height of a single pixel, metres; infinite without 3D.
    rock_probability : ndarray of float32, shape (height, width)
        Output of the outline network; NaN where it was not applied.
    cues : ndarray of uint8, shape (height, width)
        What made each pixel an obstacle: the flags of `Cue`, 0 where nothing did.
    known : ndarray of bool, shape (height, width)
        Obstacles and free pixels. The others are unknown, not free. With method `hybrid`, a free
        pixel is measured, supported by both images, within a step of the local ground, and not
        lower ground behind the brim of a drop.
    mask : ndarray of uint8, shape (height, width)
        The obstacle mask: 0 free or unknown, 255 obstacle.
    study : StudyProducts
        The study's intermediate results.
    correction : Correction
        Residual rectification error, corrected before matching.
    remapping : Remapping, optional
        From the straightened left image to the left image, where the left lens was corrected.
    warnings : tuple of str
        What makes the pair less trustworthy than usual, in words that say what to do.
    """

    camera: StereoCamera
    parameters: DetectorParameters
    ground: GroundPlane
    grey: NDArray[np.uint8]
    disparity: NDArray[np.float32]
    height: NDArray[np.float32]
    height_noise: NDArray[np.float32]
    rock_probability: NDArray[np.float32]
    cues: NDArray[np.uint8]
    known: NDArray[np.bool_]
    mask: NDArray[np.uint8]
    study: StudyProducts
    correction: Correction = UNCORRECTED
    remapping: Remapping | None = None
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                _read_only(value)

    def __repr__(self) -> str:
        obstacle = np.count_nonzero(self.mask) / self.mask.size
        unknown = 1 - np.count_nonzero(self.known) / self.known.size
        obstacles, warnings = int(self.obstacle_numbers.max()), len(self.warnings)
        return (
            f'<Detection {self.camera.width} x {self.camera.height}, '
            f'{self.config.method}: {counted(obstacles, "obstacle")}, '
            f'{obstacle:.1%} obstacle, {unknown:.1%} unknown, {counted(warnings, "warning")}>'
        )

    def __setstate__(self, state: dict[str, Any]) -> None:
        # Pickle forgets that arrays are read-only.
        vars(self).update(state)
        for value in state.values():
            if isinstance(value, np.ndarray):
                _read_only(value)

    @property
    def config(self) -> DetectorConfig:
        """What the user configured."""
        return self.parameters.config

    @property
    def alignment(self) -> RowAlignment:
        """Row shift between the images that rectification left."""
        return self.correction.rows

    @property
    def lenses(self) -> Lenses:
        """Lens distortion that rectification left."""
        return self.correction.lenses

    @property
    def regions(self) -> NDArray[np.int32]:
        """Mean-shift region of each pixel, 1 and up."""
        return self.study.regions

    @property
    def seeds(self) -> NDArray[np.bool_]:
        """Pixels of the regions with enough 3D points to be judged by them."""
        return self.study.seeds

    @property
    def roughness(self) -> NDArray[np.float32]:
        """Mean distance of a window's points from their plane, metres; NaN where none."""
        return self.study.roughness

    @property
    def step(self) -> NDArray[np.float32]:
        """Largest elevation difference within a window, metres; NaN where none."""
        return self.study.step

    @cached_property
    def points(self) -> NDArray[np.float32]:
        """Position in the left optical frame, metres, shape (height, width, 3); NaN where none."""
        return _read_only(reproject(self.disparity, self.camera, self._rays))

    @cached_property
    def obstacle_numbers(self) -> NDArray[np.int32]:
        """Number of each pixel's obstacle: ``obstacles[0]`` has number 1; 0 is no obstacle."""
        return _read_only(self._numbered.image)

    @cached_property
    def evidence(self) -> ObstacleEvidence:
        """Evidence for each of the obstacles, in their order."""
        return self.evidence_of(self.obstacle_numbers)

    def evidence_of(self, numbers: NDArray[np.int32]) -> ObstacleEvidence:
        """Evidence for obstacles that are numbered otherwise, from 1 without gaps."""
        return measure_evidence(
            numbers,
            grey=self.grey,
            disparity=self.disparity,
            height_m=self.height,
            noise_m=self.height_noise,
            rock_probability=self.rock_probability,
            cues=self.cues,
            parameters=self.parameters.result,
            images=self.parameters.images,
        )

    @cached_property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The connected obstacles, each with its box in the image and in space, largest first."""
        return describe_obstacles(
            self._numbered,
            self.points,
            np.where(self.rims.behind, np.float32(np.nan), self.height),
            self._confidences,
            main_kinds(self.evidence.cue_shares),
            self.parameters.result.tail_share,
        )

    @cached_property
    def confidence(self) -> NDArray[np.float32]:
        """Confidence in each pixel's obstacle, 0 to 1; 0 where there is no obstacle."""
        return _read_only(np.append(np.float32(0), self._confidences)[self.obstacle_numbers])

    @cached_property
    def kinds(self) -> NDArray[np.uint8]:
        """Kind of each obstacle pixel, by `KIND_NUMBERS`: its own, not that of its obstacle."""
        kinds = main_kinds(self.evidence.cue_shares)
        return _read_only(pixel_kinds(self.cues, self.obstacle_numbers, kinds))

    @cached_property
    def rims(self) -> Rims:
        """Pixels at the rims of obstacles that were matched to the other side of the outline."""
        rims = find_rims(
            self.disparity,
            self.height,
            self.height_noise,
            self.cues,
            self.obstacle_numbers,
            self.camera,
            self.ground.height_m,
            self.parameters.result,
        )
        return Rims(*map(_read_only, rims))

    @cached_property
    def obstacle_points(self) -> NDArray[np.float32]:
        """Points on obstacles, at most one for each obstacle pixel, row by row.

        Shape (n, 5): x, y, z in the left optical frame and height above the local ground, metres;
        confidence.

        Pixels whose depth is that of the ground behind the obstacle (`rims`) have no point. Pixels
        without 3D have the range of the nearest pixel of their obstacle that is high, as rocks
        are, or else of any. An obstacle without any
        3D stands upright where its foot meets the ground; it has no points where no ground was
        measured, or where that place is outside `min_range` and `max_range`.
        """
        return _read_only(self._obstacle_cloud[1])

    @cached_property
    def obstacle_point_kinds(self) -> NDArray[np.uint8]:
        """Kind of the pixel of each of the `obstacle_points`, by `KIND_NUMBERS`; shape (n,)."""
        return _read_only(self.kinds[self._obstacle_cloud[0]])

    @cached_property
    def _obstacle_cloud(self) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
        """Pixels with an obstacle point, and the points."""
        obstacle = (self.mask == OBSTACLE) & self.known
        own = obstacle & self._measured & ~self.rims.behind
        placed, rows = self._carried(obstacle & ~self._measured, own)
        both = own | placed
        pixels = np.flatnonzero(both)
        cloud = np.empty((len(pixels), 5), np.float32)
        cloud[:, :3] = self._points_at(pixels)
        cloud[:, 3] = self.height.ravel()[pixels]
        cloud[placed.ravel()[pixels], :4] = rows
        cloud[:, 4] = self._confidences[self.obstacle_numbers.ravel()[pixels] - 1]
        return both, cloud

    @cached_property
    def ground_points(self) -> NDArray[np.float32]:
        """Points on free ground, row by row, shape (n, 4): x, y, z and height, metres.

        One for each cell of the ground (`ground_cell`). Free pixels whose depth is that of an
        obstacle beside them (`rims`) have no point.
        """
        pixels = np.flatnonzero(self._free_places)
        points = self._points_at(pixels)
        cell_m = self.parameters.result.ground_cell_m
        if cell_m:
            chosen = one_per_cell(points, self.ground, cell_m)
            pixels, points = pixels[chosen], points[chosen]
        return _read_only(np.column_stack((points, self.height.ravel()[pixels])))

    @cached_property
    def grid(self) -> ObstacleGrid:
        """The ground from above: cells with obstacle points, with free pixels, and unknown."""
        parameters = self.parameters.result
        grid = obstacle_grid(
            self.obstacle_points[:, :3],
            self._points_at(np.flatnonzero(self._free_places)),
            self.ground,
            parameters.grid_cell_m,
            parameters.grid_extent_m,
        )
        _read_only(grid.cells)
        return grid

    def _points_at(self, pixels: NDArray[np.intp]) -> NDArray[np.float32]:
        """Positions of the pixels with the given flat indices, shape (n, 3)."""
        # Several times as fast as an index.
        return self.points.reshape(-1, 3).take(pixels, axis=0)

    @property
    def _free_places(self) -> NDArray[np.bool_]:
        """Free pixels with the position of what they show."""
        free: NDArray[np.bool_] = (self.mask == FREE) & self.known
        return free & self._measured & ~self.rims.before

    @cached_property
    def _numbered(self) -> NumberedObstacles:
        return number_obstacles(self.mask)

    @cached_property
    def _confidences(self) -> NDArray[np.float32]:
        return confidence(self.evidence, self.parameters.result)

    @cached_property
    def _measured(self) -> NDArray[np.bool_]:
        """Pixels with a position and a height."""
        return (self.disparity > 0) & np.isfinite(self.height)

    def _carried(
        self, missing: NDArray[np.bool_], own: NDArray[np.bool_]
    ) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
        """Positions and heights of obstacle pixels that have no 3D."""
        carrier = Carrier(
            self.points,
            self.height,
            self._rays,
            self.ground,
            lambda: (self.mask == FREE) & self.known & self._measured,
            (self.config.min_range, self.config.max_range),
        )
        # What is low on a rock may be ground that shows behind it.
        parameters = self.parameters.result
        high = self.height >= parameters.rim_share * parameters.max_step_m
        return carrier.place(missing, own, high | (self.cues & ~STANDING > 0), self._numbered)

    @property
    def _rays(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        return self.camera.rays() if self.remapping is None else self.remapping.rays(self.camera)


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    array.flags.writeable = False
    return array
