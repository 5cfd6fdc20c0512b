"""Disparity of the detector and of plain SGBM against ground truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.labels import ROCK
from rover_obstacle_detection.evaluation.methods.dense_stereo import match_plainly
from rover_obstacle_detection.evaluation.tables import NONE, Table, number, percent
from rover_obstacle_detection.evaluation.true_disparity import true_disparity, visible_in_both
from studies.disparity_error import DisparityErrors, pooled_errors
from studies.motorcycle import StereoWithTruth

OWN, PLAIN = 'hybrid', 'plain SGBM'
MATCHERS = (OWN, PLAIN)
GROUND, ROCKS = 'ground', 'rocks'
PARTS = (GROUND, ROCKS)
THRESHOLDS_PX = (0.5, 1.0, 2.0)

Errors = Mapping[tuple[str, str], DisparityErrors]
"""Errors by part of the image and matcher."""


@dataclass(frozen=True)
class SceneDisparity:
    """Errors on ground and on rocks, pooled over the frames of a scene."""

    scene: str
    conditions: tuple[str, ...]
    errors: Errors


def match_both(
    camera: StereoCamera, left: NDArray[Any], right: NDArray[Any], config: DetectorConfig
) -> dict[str, NDArray[np.float32]]:
    """Match a pair with the detector and with plain SGBM; see `match_plainly`."""
    return {
        OWN: Detector(camera, config).detect(left, right).disparity,
        PLAIN: match_plainly(camera, left, right, config),
    }


def frame_errors(frame: LabelledFrame, config: DetectorConfig) -> Errors:
    """Compare both matchers with the true depth of a frame; empty without depth.

    Only pixels visible in both images and within the detection range count. Ground is free of
    rocks of any size; rocks are those labelled as obstacles.
    """
    if frame.depth_m is None:
        return {}
    truth = true_disparity(frame.depth_m, frame.camera)
    counted = visible_in_both(truth, frame.camera)
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
    """Pool errors over frames or scenes."""
    keys = dict.fromkeys(key for part in parts for key in part)
    return {key: pooled_errors([part[key] for part in parts if key in part]) for key in keys}


def pair_errors(pair: StereoWithTruth, config: DetectorConfig) -> Errors:
    """Compare both matchers with the true disparity of a pair, on three sets of pixels."""
    disparities = match_both(pair.camera, pair.left, pair.right, config)
    visible = visible_in_both(pair.disparity, pair.camera)
    matched = np.logical_and.reduce([disparity > 0 for disparity in disparities.values()])
    kinds = {
        'all with a true disparity': np.ones_like(visible),
        'visible in both images': visible,
        'visible in both images, matched by both': visible & matched,
    }
    return {
        (kind, matcher): DisparityErrors.of(disparity, pair.disparity, where)
        for kind, where in kinds.items()
        for matcher, disparity in disparities.items()
    }


def pair_table(errors: Errors) -> Table:
    """Tabulate one pair, one row per set of pixels and matcher."""
    rows = [
        (
            kind,
            matcher,
            percent(found.density, 1),
            *(percent(found.share_off(threshold), 1) for threshold in THRESHOLDS_PX),
            number(found.median_px, 2),
            number(found.mean_px, 2),
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
    """Tabulate groups of scenes: median / mean error, and share matched."""
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
    spread = f'{number(errors.median_px, 2)} / {number(errors.mean_px, 2)}'
    return f'{spread}, {percent(errors.density, 1)}'
