"""The ground plane found in the images themselves, where matching is ambiguous."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import product

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.geometry.parameters import PlaneFitParameters
from rover_obstacle_detection.detection.geometry.plane_fit import (
    height_surprise,
    known_height_m,
)
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.stereo.parameters import SweepParameters

Image = NDArray[np.float32]


def is_doubtful(
    ground: GroundPlane, plane_fit: PlaneFitParameters, parameters: SweepParameters
) -> bool:
    """Whether matching found no ground, few points on it, or an unlikely height."""
    p = parameters
    unlikely = abs(height_surprise(ground.height_m, 0.0, plane_fit)) > p.max_surprise
    return not ground.measured or ground.residual > p.max_residual or bool(unlikely)


def likelier_ground(
    frame: Frame,
    found: GroundPlane,
    plane_fit: PlaneFitParameters,
    parameters: SweepParameters,
) -> GroundPlane:
    """Replace a doubtful ground plane by the level one that makes both images agree best.

    On slabs or tiles, each pixel matches at many disparities, and the most common false ones form
    planes of their own. As a whole the image agrees with few planes, and of those, the height of
    the camera tells which is the ground.

    Parameters
    ----------
    frame : Frame
        At a fraction of the resolution. If it has no gravity, pitch is searched, and roll is 0.
    found : GroundPlane
        Fitted to the matches, or not measured.
    plane_fit : PlaneFitParameters
        What is expected of pitch and height.
    parameters : SweepParameters

    Returns
    -------
    GroundPlane
        The given one unless another agrees clearly better, or as well at a more likely height.

    Notes
    -----
    Plane sweep (Collins 1996) with zero-mean normalised cross-correlation, over the lower part of
    the image.
    """
    p, gravity = parameters, frame.gravity
    score = _Score(frame, known_height_m(gravity, plane_fit), plane_fit, p)
    pitches_deg = p.pitches_deg if gravity is None else (0.0,)
    heights_m = np.geomspace(p.min_height_m, p.max_height_m, p.heights)
    best = _best(score, product(pitches_deg, heights_m), gravity)
    fine = product(
        best.pitch_deg + p.pitch_step_deg * np.linspace(-0.5, 0.5, 5)
        if gravity is None
        else (0.0,),
        best.height_m * np.linspace(0.95, 1.05, 5),
    )
    best = _best(score, fine, gravity)
    steepest_deg = min(p.max_pitch_deg, plane_fit.max_pitch_deg)
    is_wall = gravity is None and best.pitch_deg > steepest_deg
    if is_wall or score.agreement(best) < p.min_agreement:
        return found
    if found.measured and score(best) < score(found) + p.min_gain:
        return found
    return best


def _best(
    score: Callable[[GroundPlane], float],
    planes: Iterable[tuple[float, float]],
    gravity: Gravity | None,
) -> GroundPlane:
    """Return the plane with the best score, of the given pitches and heights."""

    def plane(pitch_deg: float, height_m: float) -> GroundPlane:
        up = gravity.up if gravity else Gravity.from_angles(pitch_deg).up
        return GroundPlane(up, float(height_m), up)

    return max((plane(*each) for each in planes), key=score)


class _Score:
    """How well a plane explains a pair: its agreement, less what is unlikely about its height."""

    def __init__(
        self,
        frame: Frame,
        known_m: float,
        plane_fit: PlaneFitParameters,
        parameters: SweepParameters,
    ) -> None:
        self.agreement = _Agreement(frame.pair, frame.camera, parameters)
        self._known_m, self._plane_fit = known_m, plane_fit
        self._weight = parameters.surprise_weight

    def __call__(self, plane: GroundPlane) -> float:
        surprise = float(height_surprise(plane.height_m, self._known_m, self._plane_fit))
        return self.agreement(plane) - self._weight * surprise**2


class _Agreement:
    """Mean correlation of a pair where a plane is expected."""

    def __init__(self, pair: GreyPair, camera: StereoCamera, parameters: SweepParameters) -> None:
        first = round(camera.height * (1 - parameters.lower_share))
        self._camera, self._rows = camera, slice(first, None)
        self._window = (parameters.window_px,) * 2
        self._left = pair[0][self._rows].astype(np.float32)
        self._right = pair[1].astype(np.float32)
        self._left_mean = cv2.blur(self._left, self._window)
        self._left_variance = self._variance(self._left, self._left_mean)
        columns = np.arange(camera.width, dtype=np.float32)
        rows = np.arange(first, camera.height, dtype=np.float32)
        self._columns, self._source_rows = np.meshgrid(columns, rows)

    def __call__(self, plane: GroundPlane) -> float:
        expected = DisparityPlane.from_ground(plane, self._camera).disparity(self._camera)
        source = self._columns - expected[self._rows] - np.float32(self._camera.disparity_offset)
        warped = cv2.remap(self._right, source, self._source_rows, cv2.INTER_LINEAR)
        mean = cv2.blur(warped, self._window)
        covariance = cv2.blur(self._left * warped, self._window) - self._left_mean * mean
        product_ = self._left_variance * self._variance(warped, mean)
        visible = (source > 0) & (source < self._camera.width - 1)
        correlation = covariance[visible] / np.sqrt(product_[visible])
        return float(correlation.mean()) if 2 * correlation.size > visible.size else 0.0

    def _variance(self, image: cv2.typing.MatLike, mean: cv2.typing.MatLike) -> Image:
        squares = cv2.blur(image * image, self._window) - mean * mean
        # One grey level of noise.
        return np.asarray(np.maximum(squares, 0) + 1, np.float32)
