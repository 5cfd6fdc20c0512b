"""A detection at the size of the images, made at a lower resolution."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.images.resampling import resized
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.detection.result.evidence import ObstacleEvidence
from rover_obstacle_detection.detection.result.grid import ObstacleGrid
from rover_obstacle_detection.detection.result.obstacles import Obstacle
from rover_obstacle_detection.detection.result.rims import Rims

_PER_PIXEL = ('height', 'height_noise', 'rock_probability', 'cues', 'known', 'mask')


def enlarged(detection: Detection, frame: Frame) -> Detection:
    """Return a detection at the size of a frame.

    Parameters
    ----------
    detection : Detection
        Made from the same images at the same or a lower resolution.
    frame : Frame
        As it was recorded.
    """
    if detection.camera.shape == frame.camera.shape:
        return detection
    factor = frame.camera.width / detection.camera.width
    own = {each.name: getattr(detection, each.name) for each in fields(detection)}
    own |= {name: resized(own[name], frame.camera.shape) for name in _PER_PIXEL}
    disparity = resized(detection.disparity * np.float32(factor), frame.camera.shape)
    if frame.excluded is not None:
        for name in ('cues', 'known', 'mask'):
            own[name][frame.excluded] = 0
    own |= {
        'camera': frame.camera,
        'grey': frame.pair[0],
        'disparity': disparity,
        'study': replace(
            detection.study, grey=frame.pair[0], disparity=disparity, camera=frame.camera
        ),
        'correction': detection.correction.reduced(1 / factor),
    }
    return EnlargedDetection(**own, judged=detection)


@dataclass(frozen=True, eq=False, repr=False)
class EnlargedDetection(Detection):
    """A detection whose pixels each take what was found at the nearest pixel of another one.

    Clouds have a point for each pixel that was judged, not several for the same measurement. The
    grey image is the given one; the one that was matched, and `remapping`, are those of `judged`.

    Parameters
    ----------
    judged : Detection
        At the resolution at which it was made.
    """

    judged: Detection = None  # type: ignore[assignment]

    @cached_property
    def obstacle_numbers(self) -> NDArray[np.int32]:
        """Number of each pixel's obstacle: ``obstacles[0]`` has number 1; 0 is no obstacle."""
        numbers = resized(self.judged.obstacle_numbers, self.camera.shape)
        numbers[self.mask == 0] = 0
        return _read_only(numbers)

    @cached_property
    def evidence(self) -> ObstacleEvidence:
        """Evidence for each of the obstacles, in their order."""
        return self.judged.evidence

    @cached_property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The connected obstacles, each with its box in the image and in space, largest first."""
        found, judged = self.judged.obstacles, self.judged.camera
        numbers = self.obstacle_numbers[self.mask > 0]
        pixels = np.bincount(numbers, minlength=len(found) + 1)[1:]
        columns = _first_pixels(judged.width, self.camera.width)
        rows = _first_pixels(judged.height, self.camera.height)
        return tuple(
            _at_full_size(each, columns, rows, int(count))
            for each, count in zip(found, pixels, strict=True)
        )

    @cached_property
    def rims(self) -> Rims:
        """Pixels at the rims of obstacles that were matched to the other side of the outline."""
        return Rims(*(_read_only(resized(each, self.camera.shape)) for each in self.judged.rims))

    @cached_property
    def obstacle_points(self) -> NDArray[np.float32]:
        """Points on obstacles, as those of `judged`."""
        return self.judged.obstacle_points

    @cached_property
    def obstacle_point_kinds(self) -> NDArray[np.uint8]:
        """Kinds of the obstacle points, as those of `judged`."""
        return self.judged.obstacle_point_kinds

    @cached_property
    def ground_points(self) -> NDArray[np.float32]:
        """Points on free ground, as those of `judged`."""
        return self.judged.ground_points

    @cached_property
    def grid(self) -> ObstacleGrid:
        """The ground from above, as that of `judged`."""
        return self.judged.grid

    @property
    def _rays(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        if self.judged.remapping is None:
            return self.camera.rays()
        x, y = self.judged.remapping.rays(self.judged.camera)
        return resized(x, self.camera.shape), resized(y, self.camera.shape)


def _first_pixels(judged: int, full: int) -> NDArray[np.intp]:
    """First pixel of a row that takes the value of each judged one, and the end of the row."""
    nearest = resized(np.arange(judged, dtype=np.int32)[np.newaxis], (1, full))[0]
    return np.searchsorted(nearest, np.arange(judged + 1))


def _at_full_size(
    obstacle: Obstacle, columns: NDArray[np.intp], rows: NDArray[np.intp], pixels: int
) -> Obstacle:
    """Let the box cover the pixels that take the values of the judged ones."""
    left, right = (int(columns[obstacle.left + each]) for each in (0, obstacle.width))
    top, bottom = (int(rows[obstacle.top + each]) for each in (0, obstacle.height))
    return replace(
        obstacle, left=left, top=top, width=right - left, height=bottom - top, pixels=pixels
    )


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    array.flags.writeable = False
    return array
