"""Points of the obstacle cloud that are not where the obstacle is."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.result.detection import OBSTACLE, Detection
from rover_obstacle_detection.detection.result.enlarged import EnlargedDetection
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.labels import FREE
from rover_obstacle_detection.evaluation.surroundings import plan_axes
from rover_obstacle_detection.evaluation.tables import Table

# A point is wrong if its depth is off by more than this, metres and share of the true depth.
WRONG_M, WRONG_SHARE = 0.2, 0.05
CELL_M = 0.05
# A lethal cell is false if no visible obstacle is within this distance of it, in cells: 0.15 m.
FALSE_CELLS = 3
# Cells farther away along the optical axis do not count: the noise of depth moves points there.
NEAR_M = 4.0

Points = NDArray[np.float32]
Pixels = tuple[NDArray[np.intp], NDArray[np.intp]]


@dataclass(frozen=True)
class CloudErrors:
    """Errors of an obstacle cloud; adding two pools them.

    Parameters
    ----------
    points : int
        Points of the cloud.
    wrong : int
        Those whose true depth differs by more than 0.2 m and 5 %.
    cells : int
        Cells of a costmap, 0.05 m wide, that the points within 4 m make lethal.
    false : int
        Lethal cells without a visible obstacle within 0.15 m.
    """

    points: int = 0
    wrong: int = 0
    cells: int = 0
    false: int = 0

    @classmethod
    def of(cls, points: Points, frame: LabelledFrame, up: Sequence[float]) -> CloudErrors:
        """Compare points with the truth.

        Parameters
        ----------
        points : ndarray of float32, shape (n, 3)
            Left optical frame, metres.
        frame : LabelledFrame
            With depth.
        up : sequence of float
            The vertical, in the left optical frame.
        """
        assert frame.depth_m is not None
        truth_m = frame.depth_m[pixels_of(points, frame)]
        off_m = np.abs(points[:, 2] - truth_m)
        wrong = off_m > np.maximum(WRONG_M, WRONG_SHARE * truth_m)
        lethal = _cells(points[points[:, 2] < NEAR_M], up)
        return cls(len(points), int(wrong.sum()), len(lethal), _false_cells(lethal, frame, up))

    def __add__(self, other: CloudErrors) -> CloudErrors:
        return CloudErrors(
            self.points + other.points,
            self.wrong + other.wrong,
            self.cells + other.cells,
            self.false + other.false,
        )


@dataclass(frozen=True)
class SceneClouds:
    """Errors of a scene's obstacle clouds.

    Parameters
    ----------
    scene : str
    plain : CloudErrors
        Of all obstacle pixels with 3D, as measured.
    published : CloudErrors
        Of the obstacle cloud.
    """

    scene: str
    plain: CloudErrors
    published: CloudErrors


def pixels_of(points: Points, frame: LabelledFrame) -> Pixels:
    """Rows and columns of the pixels that show points."""
    camera = frame.camera
    columns = np.rint(points[:, 0] / points[:, 2] * camera.fx + camera.cx)
    rows = np.rint(points[:, 1] / points[:, 2] * camera.fy + camera.cy)
    return (
        np.clip(rows, 0, camera.height - 1).astype(np.intp),
        np.clip(columns, 0, camera.width - 1).astype(np.intp),
    )


def plain_points(detection: Detection) -> Points:
    """Points of all obstacle pixels with 3D, as measured, shape (n, 3).

    Of the pixels that were judged, as in the published cloud.
    """
    if isinstance(detection, EnlargedDetection):
        detection = detection.judged
    where = (detection.mask == OBSTACLE) & detection.known & np.isfinite(detection.height)
    return detection.points[where & (detection.disparity > 0)]


def compare_clouds(
    scene: str, frames: Iterable[LabelledFrame], config: DetectorConfig
) -> SceneClouds:
    """Run the detector on frames with depth, and compare its clouds with the truth."""
    plain, published = CloudErrors(), CloudErrors()
    for frame in frames:
        found = Detector(frame.camera, config).detect(frame.left, frame.right)
        up = frame.gravity.up if frame.gravity else found.ground.up
        plain += CloudErrors.of(plain_points(found), frame, up)
        published += CloudErrors.of(found.obstacle_points[:, :3], frame, up)
    return SceneClouds(scene, plain, published)


def cloud_table(scenes: Sequence[SceneClouds]) -> Table:
    """Tabulate scenes and their sum, each as ``plain -> published``."""
    total = SceneClouds(
        'all',
        sum((each.plain for each in scenes), CloudErrors()),
        sum((each.published for each in scenes), CloudErrors()),
    )
    rows = [
        (
            each.scene,
            *(
                f'{getattr(each.plain, name)} -> {getattr(each.published, name)}'
                for name in ('points', 'wrong', 'cells', 'false')
            ),
        )
        for each in (*scenes, total)
    ]
    return Table('', ('scene', 'points', 'wrong', 'lethal cells', 'false cells'), tuple(rows))


def _cells(points: Points, up: Sequence[float]) -> NDArray[np.int64]:
    """Distinct cells of the horizontal plane with points, shape (n, 2)."""
    places = np.floor(points @ plan_axes(up).astype(np.float32) / CELL_M)
    return np.unique(places.astype(np.int64), axis=0)


def _false_cells(lethal: NDArray[np.int64], frame: LabelledFrame, up: Sequence[float]) -> int:
    """Count the lethal cells without an obstacle around them; what is not counted may be one."""
    if not len(lethal):
        return 0
    x, y = frame.camera.rays()
    depth_m = frame.depth_m
    assert depth_m is not None
    shown = (frame.labels != FREE) & np.isfinite(depth_m)
    rays = np.dstack(np.broadcast_arrays(x, y, np.float32(1)))
    true = _cells(rays[shown] * depth_m[shown][:, np.newaxis], up)
    first = lethal.min(axis=0) - FALSE_CELLS
    size = lethal.max(axis=0) + FALSE_CELLS + 1 - first
    inside = ((true >= first) & (true < first + size)).all(axis=1)
    grid = np.zeros(size, np.uint8)
    grid[tuple((true[inside] - first).T)] = 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * FALSE_CELLS + 1,) * 2)
    near = cv2.dilate(grid, disc)
    return int(np.count_nonzero(near[tuple((lethal - first).T)] == 0))
