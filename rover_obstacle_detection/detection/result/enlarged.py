"""A detection at the size of the images, made at a lower resolution."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.resampling import resized
from rover_obstacle_detection.detection.result.detection import OBSTACLE, Detection
from rover_obstacle_detection.detection.result.evidence import ObstacleEvidence
from rover_obstacle_detection.detection.result.grid import ObstacleGrid
from rover_obstacle_detection.detection.result.obstacles import Obstacle
from rover_obstacle_detection.detection.result.rims import Rims
from rover_obstacle_detection.detection.stereo.judged_range import too_far, too_near

_PER_PIXEL = ('height', 'height_noise', 'rock_probability', 'known')
_NEIGHBOURS = np.ones((3, 3), np.uint8)
# The network's output counts at most this much above or below its limit, and exactly as much where
# it draws no outline, so that the outline runs half way there.
_FULL = np.float32(0.5)


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
    obstacle = outlined(detection, frame.camera.shape)
    # In a corner, an outline may reach into pixels beyond the range.
    p = detection.parameters
    obstacle &= ~too_near(disparity, frame.camera, p.stereo.min_range_m)
    obstacle &= ~too_far(disparity, frame.camera, p.terrain.max_range_m)
    own['mask'] = obstacle * np.uint8(OBSTACLE)
    own['cues'] = resized(with_surroundings(detection.cues), frame.camera.shape) * obstacle
    # What the outline leaves out of an obstacle is not free.
    own['known'] &= ~resized(detection.mask == OBSTACLE, frame.camera.shape)
    own['known'] |= obstacle
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


def outlined(detection: Detection, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Draw the outlines of the obstacles at a larger size.

    They run between the judged pixels, where the network's output, interpolated, reaches the
    limit. Where it draws no outline, they run half way.

    Parameters
    ----------
    detection : Detection
    shape : tuple of int
        Height and width.

    Returns
    -------
    ndarray of bool, shape `shape`
        Pixels on obstacles. Each of them has an obstacle at one of the judged pixels around it.
    """
    over = detection.rock_probability - np.float32(detection.parameters.rocks.outline_probability)
    obstacle = detection.mask == OBSTACLE
    # Where other stages overruled the network, as where it was not asked, it draws no outline.
    undrawn = np.isnan(over) | (obstacle != (over > 0))
    over = np.clip(over, -_FULL, _FULL)
    over[undrawn] = np.where(obstacle[undrawn], _FULL, -_FULL)
    return np.asarray(cv2.resize(over, shape[::-1], interpolation=cv2.INTER_LINEAR) > 0)


def with_surroundings(image: NDArray[Any]) -> NDArray[Any]:
    """Give the pixels that are 0 the highest value of those around them."""
    grown = cv2.dilate(image, _NEIGHBOURS)
    return np.where(image > 0, image, grown)


@dataclass(frozen=True, eq=False, repr=False)
class EnlargedDetection(Detection):
    """A detection whose pixels each take what was found at the nearest pixel of another one.

    Outlines of obstacles run between those pixels. Clouds have a point for each pixel of `judged`.
    The grey image is the given one; `remapping` is that of `judged`.

    Parameters
    ----------
    judged : Detection
        At the resolution at which it was made.
    """

    judged: Detection = None  # type: ignore[assignment]

    @cached_property
    def obstacle_numbers(self) -> NDArray[np.int32]:
        """Number of each pixel's obstacle: ``obstacles[0]`` has number 1; 0 is no obstacle."""
        # OpenCV does not dilate integers of this size.
        judged = self.judged.obstacle_numbers.astype(np.float32)
        numbers = resized(with_surroundings(judged), self.camera.shape).astype(np.int32)
        numbers[self.mask == 0] = 0
        return _read_only(numbers)

    @cached_property
    def evidence(self) -> ObstacleEvidence:
        """Evidence for each of the obstacles, in their order."""
        return self.judged.evidence

    @cached_property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The connected obstacles, each with its box in the image and in space, largest first."""
        numbers, judged = self.obstacle_numbers, self.judged.camera
        return tuple(
            _at_full_size(each, number, numbers, judged)
            for number, each in enumerate(self.judged.obstacles, start=1)
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


def _at_full_size(
    obstacle: Obstacle, number: int, numbers: NDArray[np.int32], judged: StereoCamera
) -> Obstacle:
    """Let the box cover the pixels with the obstacle's number; if there are none, where it was."""
    down, across = (full / own for full, own in zip(numbers.shape, judged.shape, strict=True))
    first = np.floor((obstacle.top * down, obstacle.left * across)).astype(int)
    size = np.ceil((obstacle.height * down, obstacle.width * across)).astype(int)
    # Outlines reach no farther than one judged pixel beyond the judged box.
    reach = math.ceil(max(down, across))
    rows, columns = (
        slice(max(start - reach, 0), start + length + reach)
        for start, length in zip(first.tolist(), size.tolist(), strict=True)
    )
    own = numbers[rows, columns] == number
    if own.any():
        own_rows, own_columns = (np.flatnonzero(own.any(axis=axis)) for axis in (1, 0))
        first = np.array((rows.start + own_rows[0], columns.start + own_columns[0]))
        size = np.array((np.ptp(own_rows), np.ptp(own_columns))) + 1
    return replace(
        obstacle,
        left=int(first[1]),
        top=int(first[0]),
        width=int(size[1]),
        height=int(size[0]),
        pixels=int(np.count_nonzero(own)),
    )


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    array.flags.writeable = False
    return array
