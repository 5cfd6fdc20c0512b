"""The disparity that the detector works on, beside plain SGBM's, against the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.evaluation.disparity_error import (
    DisparityErrors,
    pooled_errors,
    seen_by_both,
    true_disparity,
)
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.labels import ROCK
from rover_obstacle_detection.evaluation.methods.dense_stereo import match_plainly
from rover_obstacle_detection.evaluation.tables import NONE, Table
from studies.motorcycle import StereoWithTruth

OWN, PLAIN = 'hybrid', 'plain SGBM'
MATCHERS = (OWN, PLAIN)
GROUND, ROCKS = 'ground', 'rocks'
PARTS = (GROUND, ROCKS)
THRESHOLDS_PX = (0.5, 1.0, 2.0)

Errors = Mapping[tuple[str, str], DisparityErrors]
"""By part of the image and matcher."""


@dataclass(frozen=True)
class SceneDisparity:
    """Errors on ground and on rocks, over all frames of a scene."""

    scene: str
    conditions: tuple[str, ...]
    errors: Errors


def match_both(
    camera: StereoCamera, left: NDArray[Any], right: NDArray[Any], config: DetectorConfig
) -> dict[str, NDArray[np.float32]]:
    """Match a pair as the detector does and with plain SGBM; see `match_plainly`."""
    return {
        OWN: Detector(camera, config).detect(left, right).disparity,
        PLAIN: match_plainly(camera, left, right, config),
    }


def frame_errors(frame: LabelledFrame, config: DetectorConfig) -> Errors:
    """Compare both matchers with the true depth of a frame.

    Only pixels count that both eyes see, in the range that is judged. Ground is where no rock of
    any size is, rocks are those that are obstacles.
    """
    if frame.depth_m is None:
        return {}
    truth = true_disparity(frame.depth_m, frame.camera)
    counted = seen_by_both(truth, frame.camera)
    with np.errstate(invalid='ignore'):
        counted &= (frame.depth_m >= config.min_range) & (frame.depth_m <= config.max_range)
    where = {
        GROUND: counted & (frame.instances == 0),
        ROCKS: counted & (frame.labels == ROCK),
    }
    return {
        (part, matcher): DisparityErrors.of(disparity, truth, where[part])
        for matcher, disparity in match_both(frame.camera, frame.left, frame.right, config).items()
        for part in PARTS
    }


def summed(parts: Sequence[Errors]) -> Errors:
    """Sum errors over frames or scenes."""
    keys = dict.fromkeys(key for part in parts for key in part)
    return {key: pooled_errors([part[key] for part in parts if key in part]) for key in keys}


def pair_errors(pair: StereoWithTruth, config: DetectorConfig) -> Errors:
    """Compare both matchers with a pair's true disparity, on three kinds of pixels."""
    disparities = match_both(pair.camera, pair.left, pair.right, config)
    seen = seen_by_both(pair.disparity, pair.camera)
    matched = np.logical_and.reduce([disparity > 0 for disparity in disparities.values()])
    kinds = {
        'all with a true disparity': np.ones_like(seen),
        'seen by both eyes': seen,
        'seen by both eyes, matched by both': seen & matched,
    }
    return {
        (kind, matcher): DisparityErrors.of(disparity, pair.disparity, where)
        for kind, where in kinds.items()
        for matcher, disparity in disparities.items()
    }


def pair_table(errors: Errors) -> Table:
    """Tabulate one pair, a row a kind of pixels and a matcher."""
    rows = [
        (
            kind,
            matcher,
            _percent(found.density),
            *(_percent(found.share_off(threshold)) for threshold in THRESHOLDS_PX),
            _pixels(found.median_px),
            _pixels(found.mean_px),
        )
        for (kind, matcher), found in errors.items()
    ]
    header = (
        'pixels',
        'matcher',
        'matched',
        *(f'off by {threshold:g} px' for threshold in THRESHOLDS_PX),
        'median (px)',
        'mean (px)',
    )
    return Table('Disparity of a pair', header, rows)


def scenes_table(groups: Mapping[str, Sequence[SceneDisparity]]) -> Table:
    """Tabulate rendered scenes, a row a group: median / mean error, and share matched."""
    columns = [(part, matcher) for part in PARTS for matcher in MATCHERS]
    rows = []
    for name, scenes in groups.items():
        errors = summed([scene.errors for scene in scenes])
        rows.append((name, str(len(scenes)), *(_cell(errors.get(key)) for key in columns)))
    header = ('scenes', 'number', *(f'{part}: {matcher}' for part, matcher in columns))
    return Table('Disparity of rendered scenes', header, rows)


def _cell(errors: DisparityErrors | None) -> str:
    if errors is None or errors.density is None:
        return NONE
    spread = f'{_pixels(errors.median_px)} / {_pixels(errors.mean_px)}'
    return f'{spread}, {_percent(errors.density)}'


def _pixels(value: float | None) -> str:
    return NONE if value is None else f'{value:.2f}'


def _percent(value: float | None) -> str:
    return NONE if value is None else f'{100 * value:.1f} %'
