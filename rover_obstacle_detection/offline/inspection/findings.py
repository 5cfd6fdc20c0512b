"""What keeps a recorded camera from being replayed, and what makes the result doubtful."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rover_obstacle_detection.detection.rectification.correction import RECALIBRATE_PX
from rover_obstacle_detection.offline.inspection.calibration import Calibration
from rover_obstacle_detection.offline.inspection.sample import Sample
from rover_obstacle_detection.offline.inspection.streams import Stream, Synchronisation
from rover_obstacle_detection.wording import counted

# Mean of a pair's images beyond which their contrast or brightness is doubtful.
_MAX_GREY_RATIO = 1.3
_MAX_SHARPNESS_RATIO = 2.0
_MAX_SATURATED_SHARE = 0.02
_DARK_GREY = 15


def what_is_missing(
    left: Stream,
    right: Stream,
    synchronisation: Synchronisation,
    calibration: Calibration,
    sample: Sample,
) -> list[str]:
    """List all that keeps a camera from being replayed."""
    missing = [
        f'{stream.topic} has no usable image{_first(stream.bad)}'
        for stream in _streams(left, right)
        if not stream.images
    ]
    if not missing and not synchronisation.pairs:
        missing.append(
            'left and right images show different moments: smallest stamp gap '
            f'{synchronisation.smallest_gap_ms:.3f} ms, median '
            f'{synchronisation.median_gap_ms:.3f} ms: expected synchronised cameras'
        )
    if calibration.problem:
        missing.append(calibration.problem)
    if sample.bad and not sample.pairs:
        missing.append(f'no pair can be used: {sample.bad[0]}')
    if sum(each.swapped for each in sample.geometry) > len(sample.geometry) / 2:
        missing.append('left and right images are swapped: exchange the topics')
    if sample.unjudgeable and not missing:
        missing.append(f'no sampled pair can be judged: {sample.unjudgeable[0]}')
    return missing


def what_is_doubtful(
    left: Stream,
    right: Stream,
    synchronisation: Synchronisation,
    calibration: Calibration,
    sample: Sample,
) -> list[str]:
    """List all that makes the result doubtful."""
    warnings = []
    for stream in _streams(left, right):
        if stream.images and stream.bad:
            warnings.append(f'{stream.topic}: bad messages: {len(stream.bad)}{_first(stream.bad)}')
        if stream.repeats:
            warnings.append(
                f'{stream.topic}: {stream.repeats} of {counted(stream.images, "image")} '
                f'repeat{"s" if stream.repeats == 1 else ""} the one before, byte for byte: the '
                'camera or its driver was frozen'
            )
        if len(stream.sizes) > 1:
            warnings.append(f'{stream.topic} changes size: {", ".join(sorted(stream.sizes))}')
    lone = max(left.images, right.images) - synchronisation.pairs
    if lone and synchronisation.pairs:
        warnings.append(f'{counted(lone, "image has", "images have")} no partner')
    changes = sum(each.changes for each in (calibration.left, calibration.right) if each)
    if changes:
        warnings.append(
            f'the calibration changes {counted(changes, "time")}: the first one is shown'
        )
    if sample.bad and sample.pairs:
        warnings.append(
            f'{counted(len(sample.bad), "sampled pair")} cannot be used{_first(sample.bad)}'
        )
    if synchronisation.pairs:
        warnings += _doubtful_geometry(calibration, sample)
    return [*warnings, *_doubtful_images(sample)]


def _streams(left: Stream, right: Stream) -> tuple[Stream, ...]:
    """Return both streams, or the one with both views."""
    return (left,) if left is right else (left, right)


def _doubtful_geometry(calibration: Calibration, sample: Sample) -> list[str]:
    if calibration.camera and sample.pairs and not sample.geometry and not sample.bad:
        return ['too few matches to measure the rectification']
    warnings = []
    if sample.is_upside_down:
        warnings.append(
            'the ground is at the top of the images: the camera is taken for one that is mounted '
            'upside down; if it is upright, check that both images come from the same moment'
        )
    usable = [each for each in sample.geometry if not each.swapped]
    for name, values in (
        ('the right image is off by rows', [each.rows_off_px for each in usable]),
        ('the lenses are distorted after rectification', [each.lens_bend_px for each in usable]),
    ):
        if values and np.median(values) >= RECALIBRATE_PX:
            warnings.append(f'{name}: median {np.median(values):.1f} px: recalibrate')
    return warnings


def _doubtful_images(sample: Sample) -> list[str]:
    if not sample.images:
        return []
    warnings = []
    greys, sharpness, saturated = (
        np.median([[getattr(side, name) for side in each] for each in sample.images], axis=0)
        for name in ('median_grey', 'sharpness', 'saturated_share')
    )
    if (greys.max() + 1) / (greys.min() + 1) > _MAX_GREY_RATIO:
        darker = 'left' if greys[0] < greys[1] else 'right'
        warnings.append(
            f'the {darker} image is darker: median grey {greys[0]:.0f} and {greys[1]:.0f}: use '
            'one exposure for both'
        )
    if (sharpness.max() + 1e-4) / (sharpness.min() + 1e-4) > _MAX_SHARPNESS_RATIO:
        duller = 'left' if sharpness[0] < sharpness[1] else 'right'
        warnings.append(f'the {duller} image is less sharp: check its focus and its lens')
    for side, grey, share in zip(('left', 'right'), greys, saturated, strict=True):
        if grey < _DARK_GREY:
            warnings.append(f'the {side} image is dark: median grey {grey:.0f} of 255')
        if share > _MAX_SATURATED_SHARE:
            warnings.append(f'{share:.0%} of the {side} image is saturated: check the exposure')
    return warnings


def _first(reasons: Sequence[str]) -> str:
    return f': {reasons[0]}' if reasons else ''
