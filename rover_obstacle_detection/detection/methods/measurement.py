"""The first half of the hybrid method: from a pair to heights above the ground."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_check import (
    ground_warnings,
)
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.geometry.plane_fit import (
    estimate_ground,
    is_upside_down,
    known_height_m,
)
from rover_obstacle_detection.detection.geometry.resolution import working_camera
from rover_obstacle_detection.detection.images.brightness import Spread
from rover_obstacle_detection.detection.images.contrast import with_even_contrast
from rover_obstacle_detection.detection.images.image_noise import (
    Smoothed,
    image_gradient,
    image_noise,
    smoothed_against_noise,
)
from rover_obstacle_detection.detection.images.texture import texture_level
from rover_obstacle_detection.detection.methods.stages import (
    HYBRID_STAGES,
    HybridStages,
    Vector,
)
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.rectification.correction import Correction
from rover_obstacle_detection.detection.rectification.rectify import Rectified
from rover_obstacle_detection.detection.rectification.reduced_pair import ReducedPair
from rover_obstacle_detection.detection.stereo.coarse import CoarseMatcher, coarse_camera
from rover_obstacle_detection.detection.stereo.judged_range import within_range
from rover_obstacle_detection.detection.stereo.matching import (
    Stereo,
    image_penalties,
    match_against_ground,
)
from rover_obstacle_detection.detection.stereo.pair_check import check_pair
from rover_obstacle_detection.detection.stereo.plane_sweep import is_doubtful, likelier_ground
from rover_obstacle_detection.detection.stereo.support import measure_support, sparse_areas
from rover_obstacle_detection.detection.stereo.warped_matching import residual_range
from rover_obstacle_detection.detection.terrain.backdrop import with_backdrop
from rover_obstacle_detection.detection.terrain.level_brims import AllBrims, brims_by_vertical
from rover_obstacle_detection.detection.terrain.terrain import Terrain
from rover_obstacle_detection.errors import UnjudgeablePairError

Finished = Callable[[str], None]
Mask = NDArray[np.bool_]


class Measurement(NamedTuple):
    """What a stereo pair shows of the terrain.

    Parameters
    ----------
    frame : Frame
        The given frame at the working resolution, smoothed if its images are noisy.
    correction : Correction
        Of the rectification, in pixels of that frame.
    stereo : Stereo
        In the straightened left image.
    terrain : Terrain
        Likewise.
    brims : AllBrims
        Likewise.
    sparse : ndarray of bool, shape (height, width)
        Areas without texture, or with too little for matches to be trusted: see `Support` and
        `sparse_areas`.
    warnings : tuple of str
    """

    frame: Frame
    correction: Correction
    stereo: Stereo
    terrain: Terrain
    brims: AllBrims
    sparse: Mask
    warnings: tuple[str, ...] = ()


def measure(
    frame: Frame,
    parameters: DetectorParameters,
    finished: Finished = lambda stage: None,
    stages: HybridStages = HYBRID_STAGES,
) -> Measurement:
    """Run the first half of the hybrid method: from the images to heights above the ground.

    Parameters
    ----------
    frame : Frame
    parameters : DetectorParameters
    finished : callable
        Called with the name of each stage when it ends.
    stages : HybridStages

    Raises
    ------
    UnjudgeablePairError
        If the pair says nothing about the ground, or contradicts itself.
    """
    p, full = parameters, frame.camera
    reduced = frame.resized(coarse_camera(full, p.stereo))
    coarse = match_coarsely(reduced, full, p, stages)
    reduced = coarse.correction.straightened(reduced)
    coarse = without_excluded(coarse, reduced.excluded)
    finished('coarse disparity')
    ground, doubts = find_ground(reduced, coarse, p)
    finished('ground plane')
    frame = frame.resized(working_camera(full, ground, p.resolution))
    reduction = full.width / frame.camera.width
    correction = coarse.correction.reduced(reduction)
    finished('resize')
    left, right = (without_noise(image, p, stages) for image in frame.pair)
    frame = replace(frame, pair=(left.grey, right.grey))
    straight = correction.straightened(frame)
    finished('noise')
    stereo = match(straight, coarse, correction, ground, left, p, stages, finished)
    stereo, sparse, warnings = supported(stereo, (left.noise, right.noise), reduction, p)
    stereo = within_range(stereo, p.stereo.min_range_m, p.terrain.max_range_m)
    if not ground.measured and frame.gravity is None:
        # Images that do not belong together may seem to show ground anywhere.
        check_upright(coarse, p)
    finished('support')
    # Puddles mirror far hills too.
    ends = stages.reflections(with_backdrop(stereo, straight.excluded, p.terrain), p.terrain)
    reflected = ends.disparity <= 0
    stereo = replace(stereo, disparity=np.where(reflected, np.float32(0), stereo.disparity))
    brims = AllBrims((stages.brims(ends, p.terrain),))
    finished('brims')
    terrain = stages.survey(stereo, p.terrain)
    finished('local ground')
    verticals: Sequence[Vector] = [ground.up]
    if frame.gravity is None and ground.measured:
        beyond = brims.beyond()
        before = [layer.without(beyond) for layer in terrain.layers]
        verticals = stages.verticals(before, ground, p.terrain)
    brims, up = brims_by_vertical(brims, verticals, ends, stages.brims, p.terrain)
    stereo = replace(stereo, ground=replace(ground, up=up))
    finished('vertical')
    return Measurement(frame, correction, stereo, terrain, brims, sparse, doubts + warnings)


def without_noise(
    grey: NDArray[np.uint8], parameters: DetectorParameters, stages: HybridStages
) -> Smoothed:
    """Smooth an image where noise hides its texture."""
    p = parameters.images
    noise = image_noise(grey, p)
    share = stages.noise_share(noise, image_gradient(grey, p), p)
    return smoothed_against_noise(grey, noise, share, p)


def match_coarsely(
    reduced: Frame, full: StereoCamera, parameters: DetectorParameters, stages: HybridStages
) -> Rectified:
    """Match at a fraction of the resolution, and measure the rectification on the way."""
    matcher = CoarseMatcher(full, reduced.camera, parameters.stereo)
    pair = ReducedPair(reduced.pair, reduced.camera, full.width / reduced.camera.width)
    return stages.rectify(pair, matcher, parameters.rectification)


def find_ground(
    reduced: Frame, coarse: Rectified, parameters: DetectorParameters
) -> tuple[GroundPlane, tuple[str, ...]]:
    """Find the ground plane in the matches and, where they leave doubt, in the images.

    Parameters
    ----------
    reduced : Frame
        The straightened images that were matched.
    coarse : Rectified
    parameters : DetectorParameters

    Returns
    -------
    ground : GroundPlane
    warnings : tuple of str
    """
    p, gravity = parameters, reduced.gravity
    ground = estimate_ground(coarse.disparity, coarse.camera, p.plane_fit, gravity)
    if is_doubtful(ground, p.plane_fit, p.stereo.sweep):
        ground = likelier_ground(reduced, ground, p.plane_fit, p.stereo.sweep)
    unaided = None
    if not ground.measured and gravity:
        unaided = estimate_ground(coarse.disparity, coarse.camera, p.plane_fit, None)
    known_m = known_height_m(gravity, p.plane_fit)
    return ground, ground_warnings(ground, unaided, gravity, known_m, p.ground_check)


def check_upright(coarse: Rectified, parameters: DetectorParameters) -> None:
    """Reject a view whose ground is at its top.

    Raises
    ------
    UnjudgeablePairError
    """
    if is_upside_down(coarse.disparity, coarse.camera, parameters.plane_fit):
        if parameters.config.upside_down:
            msg = (
                'the ground is at the bottom of the images, but upside_down is true: is the '
                'camera mounted upright? Then set upside_down to false'
            )
        else:
            msg = (
                'the ground is at the top of the images: is the camera mounted upside down? Then '
                'set upside_down to true'
            )
        raise UnjudgeablePairError(msg)


def without_excluded(coarse: Rectified, excluded: Mask | None) -> Rectified:
    """Remove the matches of pixels that are not judged."""
    if excluded is None:
        return coarse
    return replace(coarse, disparity=np.where(excluded, np.float32(0), coarse.disparity))


def match(
    frame: Frame,
    coarse: Rectified,
    correction: Correction,
    ground: GroundPlane,
    smoothed: Smoothed,
    parameters: DetectorParameters,
    stages: HybridStages,
    finished: Finished,
) -> Stereo:
    """Match the straightened images relative to the ground, to a fraction of a pixel."""
    p, rows, left = parameters, correction.rows, frame.pair[0]
    gradient = image_gradient(left, p.images)
    plane = DisparityPlane.from_ground(ground, coarse.camera)
    reduction = frame.camera.width / coarse.camera.width
    search = residual_range(coarse.disparity, coarse.camera, reduction, plane, p.stereo)
    even = with_even_contrast(frame.pair, gradient, smoothed.noise_gradient, p.images)
    penalties = image_penalties(gradient.overall, smoothed.share, p.stereo)
    expected, disparity = match_against_ground(
        frame, even, ground, search, penalties, correction, p.stereo
    )
    finished('disparity')
    refined = stages.refine(frame.pair, disparity, frame.camera, rows, p.stereo)
    finished('subpixel')
    return Stereo(
        frame,
        ground,
        expected,
        refined.disparity,
        refined.noise_px,
        refined.grey_noise,
        texture_level(left, p.images),
        rows,
    )


def supported(
    stereo: Stereo,
    noise: tuple[Spread, Spread],
    reduction: float,
    parameters: DetectorParameters,
) -> tuple[Stereo, Mask, tuple[str, ...]]:
    """Remove the matches that the images do not support; warn of images that hardly agree.

    Parameters
    ----------
    stereo : Stereo
    noise : tuple of Spread
        Standard deviation of the noise of each image, grey levels.
    reduction : float
        Side of a pixel in pixels of the images as recorded.
    parameters : DetectorParameters

    Raises
    ------
    UnjudgeablePairError
        If the images do not belong together, or show nothing.
    """
    frame, p = stereo.frame, parameters.stereo.support
    columns = np.arange(frame.camera.width, dtype=np.float32)[np.newaxis]
    visible = (stereo.expected > 0) & (stereo.expected <= columns - frame.camera.disparity_offset)
    if frame.excluded is not None:
        visible &= ~frame.excluded
    # Fine texture looks like noise, noise of the difference includes false matches.
    most = stereo.grey_noise / 2**0.5
    left_noise, right_noise = (
        each.by_brightness * min(1.0, most / each.overall) for each in noise
    )
    support = measure_support(
        frame.pair,
        stereo.disparity,
        stereo.expected,
        frame.camera,
        stereo.rows,
        visible,
        (left_noise, right_noise),
        p,
    )
    matched_share = np.count_nonzero(support.supported & visible) / max(1, visible.sum())
    warnings = check_pair(frame.pair, support, matched_share, reduction, p)
    disparity = np.where(support.supported, stereo.disparity, np.float32(0))
    sparse = support.plain | sparse_areas(support.supported, visible, p)
    return replace(stereo, disparity=disparity), sparse, warnings
