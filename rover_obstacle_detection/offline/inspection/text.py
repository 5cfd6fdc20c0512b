"""An inspection as text of 80 columns, and as JSON."""

from __future__ import annotations

import math
import shlex
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from rover_obstacle_detection.messages.raw_images import ALWAYS, BY_NAME
from rover_obstacle_detection.offline.inspection.corrected_calibration import (
    CorrectedCalibration,
)
from rover_obstacle_detection.offline.inspection.inspection import (
    BagInspection,
    CameraInspection,
)
from rover_obstacle_detection.offline.inspection.sample import Sample
from rover_obstacle_detection.offline.inspection.streams import Stream
from rover_obstacle_detection.wording import counted

_COLUMNS = 80
_LABEL = 16
_DIFFERENCE_ONLY = '; of both, only the difference is corrected: pairs hardly show the rest.'
_TOPICS = ('left_image', 'right_image', 'left_info', 'right_info')


def inspection_text(bag: BagInspection) -> str:
    """Describe a recording."""
    lines = [str(bag.path)]
    lines += _row('length', f'{bag.length_s:.1f} s, {bag.size_bytes / 1e6:.1f} MB')
    lines += _row('damage', '; '.join(bag.damage) or 'none')
    gravity = (f'{topic} (gravity_source: {kind})' for topic, kind in bag.gravity.items())
    lines += _row('gravity', ', '.join(gravity) or 'no IMU or TF topic')
    for camera in bag.cameras:
        lines += ['', *_camera_lines(camera)]
    if not bag.cameras:
        lines += ['', *_verdict(bag.missing, (), bag.command)]
    return '\n'.join(lines)


def inspection_json(bag: BagInspection) -> dict[str, Any]:
    """Return the same for JSON; missing numbers are None."""
    return {
        'bag': str(bag.path),
        'can_be_replayed': bag.can_be_replayed,
        'length_s': bag.length_s,
        'size_bytes': bag.size_bytes,
        'damage': list(bag.damage),
        'gravity': bag.gravity,
        'missing': list(bag.missing),
        'command': bag.command if not bag.cameras else None,
        'cameras': [_camera_json(camera) for camera in bag.cameras],
    }


def corrected_text(corrected: CorrectedCalibration) -> str:
    """Describe the calibration files that were written."""
    files = ' and '.join(map(str, corrected.files))
    lines = _row(
        'written',
        f'{files}: rows off {corrected.rows_off_px:.2f} px before, '
        f'{corrected.remaining_px:.2f} px after; median of {corrected.pairs} pairs, 80% within '
        f'{corrected.spread_px:.2f} px of it',
    )
    if corrected.lens_problem:
        lines += _row('', f'Lens distortion is not corrected: {corrected.lens_problem}.')
    elif corrected.lens_bend_px:
        lines += _row(
            '',
            f'Lenses bend {corrected.lens_bend_px:.2f} px before, '
            f'{corrected.remaining_lens_bend_px:.2f} px after'
            + ('.' if corrected.is_common_lens_corrected else _DIFFERENCE_ONLY),
        )
        if corrected.zoom > 1:
            lines += _row(
                '',
                f'Rectified images are enlarged by {corrected.zoom - 1:.1%}, so that no border '
                'turns black.',
            )
    else:
        lines += _row('', 'No lens distortion to correct was found.')
    if corrected.for_raw_images:
        lines += _row(
            '',
            'The files are for raw images. Those of this recording are rectified already, and '
            'stay as they are: give the files to the camera driver.',
        )
    elif corrected.rectify == ALWAYS:
        lines += _row(
            '',
            'The files are for the images as recorded, rectified or not: use them with '
            '--rectify always.',
        )
    return '\n'.join(lines)


def corrected_json(corrected: CorrectedCalibration) -> dict[str, Any]:
    """Return the same for JSON."""
    return {**asdict(corrected), 'files': [str(each) for each in corrected.files]}


def _camera_json(camera: CameraInspection) -> dict[str, Any]:
    calibration, stereo = camera.calibration, camera.calibration.camera
    return {
        'topics': {name: getattr(camera.topics, name) for name in _TOPICS},
        'left': _stream_json(camera.left),
        'right': _stream_json(camera.right),
        'synchronisation': asdict(camera.synchronisation),
        'calibration': {
            'camera': asdict(stereo) if stereo else None,
            'problem': calibration.problem or None,
            'left_changes': calibration.left.changes if calibration.left else None,
            'right_changes': calibration.right.changes if calibration.right else None,
        },
        'rectified_by_name': replace(camera.topics, rectify=BY_NAME).is_rectified,
        'rectify': camera.topics.rectify,
        'sample': {
            'pairs': camera.sample.pairs,
            'bad': list(camera.sample.bad),
            'unjudgeable': list(camera.sample.unjudgeable),
            'images': [
                {'left': asdict(left), 'right': asdict(right)}
                for left, right in camera.sample.images
            ],
            'geometry': [asdict(each) for each in camera.sample.geometry],
        },
        'missing': list(camera.missing),
        'warnings': list(camera.warnings),
        'command': camera.command,
    }


def _stream_json(stream: Stream) -> dict[str, Any]:
    return {
        'type': stream.type_name,
        'images': stream.images,
        'bad': stream.bad,
        'encodings': sorted(stream.encodings),
        'sizes': sorted(stream.sizes),
        'rate_hz': stream.rate_hz,
        'repeats': stream.repeats,
    }


def _camera_lines(camera: CameraInspection) -> Iterator[str]:
    yield f'stereo camera {camera.topics.namespace or "/"}'
    sides = [('left', camera.left), ('right', camera.right)]
    for side, stream in [('both', camera.left)] if camera.topics.is_side_by_side else sides:
        yield from _row(side, stream.topic)
        yield from _row('', _stream(stream))
    yield from _row('synchronised', _synchronised(camera))
    yield from _row('calibrated', _calibrated(camera))
    yield from _row('rectified', _rectified(camera))
    yield from _row('exposure', _exposure(camera.sample))
    yield from _row('sharpness', _sharpness(camera.sample))
    yield from _verdict(camera.missing, camera.warnings, camera.command)


def _stream(stream: Stream) -> str:
    parts = [
        stream.type_name.rpartition('/')[2],
        '/'.join(sorted(stream.encodings)),
        '/'.join(sorted(stream.sizes)),
    ]
    rate = f', {stream.rate_hz:.1f} Hz' if stream.rate_hz else ''
    return f'{" ".join(filter(None, parts))}, {counted(stream.images, "image")}{rate}'


def _synchronised(camera: CameraInspection) -> str:
    found = camera.synchronisation
    if camera.topics.is_side_by_side:
        return f'both views in one image, {counted(found.pairs, "pair")}'
    if found.smallest_gap_ms is None:
        return 'nothing to compare'
    gaps = f'stamp gap {found.smallest_gap_ms:.3f} ms, median {found.median_gap_ms:.3f} ms'
    if found.approximate_sync_s:
        needed = f'with --approximate-sync {found.approximate_sync_s:g}'
        return f'{needed}: {counted(found.pairs, "pair")}; smallest {gaps}'
    if found.pairs:
        return f'equal stamps, {counted(found.pairs, "pair")}'
    return f'no: smallest {gaps}'


def _calibrated(camera: CameraInspection) -> str:
    calibration, stereo = camera.calibration, camera.calibration.camera
    if stereo is None or calibration.stereo is None:
        return 'no, see below'
    views = (
        2 * math.degrees(math.atan(pixels / 2 / focal))
        for pixels, focal in ((stereo.width, stereo.fx), (stereo.height, stereo.fy))
    )
    messages = [each for each in (calibration.left, calibration.right) if each]
    constant = messages and not any(each.changes for each in messages)
    return (
        f'{calibration.stereo.source}; {stereo.width} x {stereo.height}, baseline '
        f'{stereo.baseline_m:.4g} m, focal length {stereo.fx:.1f} px, field of view '
        f'{" x ".join(f"{view:.0f}" for view in views)} deg'
        f'{", constant" if constant else ""}'
    )


def _rectified(camera: CameraInspection) -> str:
    rectify = camera.topics.rectify
    reason = 'by name' if rectify == BY_NAME else f'with --rectify {rectify}'
    text = f'{"yes" if camera.topics.is_rectified else "raw"} {reason}'
    if rectification := camera.calibration.rectification:
        text += (
            ': replay rectifies them'
            if rectification.is_needed
            else ': used as they are, as the calibration has no distortion or rotation'
        )
    usable = [each for each in camera.sample.geometry if not each.swapped]
    if not usable:
        return f'{text}; not measured'
    return (
        f'{text}; rows off {_spread([each.rows_off_px for each in usable])}, lenses bend '
        f'{_spread([each.lens_bend_px for each in usable])} in {counted(len(usable), "pair")}'
    )


def _spread(values: Sequence[float]) -> str:
    return f'{np.median(values):.2f} px ({min(values):.2f} to {max(values):.2f})'


def _exposure(sample: Sample) -> str:
    if not sample.images:
        return 'not measured'
    grey, saturated = (
        np.median([[getattr(side, name) for side in each] for each in sample.images], axis=0)
        for name in ('median_grey', 'saturated_share')
    )
    return (
        f'median grey {grey[0]:.0f} left, {grey[1]:.0f} right; saturated {saturated[0]:.1%} and '
        f'{saturated[1]:.1%}'
    )


def _sharpness(sample: Sample) -> str:
    if not sample.images:
        return 'not measured'
    ratio = np.median(
        [(left.sharpness + 1e-4) / (right.sharpness + 1e-4) for left, right in sample.images]
    )
    return f'left over right {ratio:.2f}'


def _verdict(missing: Sequence[str], warnings: Sequence[str], command: str) -> Iterator[str]:
    for warning in warnings:
        yield from _row('warning', warning)
    for each in missing:
        yield from _row('missing', each)
    yield from _row('replay', 'not yet; then:' if missing else 'can be replayed:')
    yield from _command_lines(command)


def _command_lines(command: str) -> Iterator[str]:
    """Break a command between its options, so that it can be copied."""
    words = [shlex.quote(word) for word in shlex.split(command)]
    lines, line = [], ' '
    for index, word in enumerate(words):
        is_option = word.startswith('--')
        value = words[index + 1] if is_option and index + 1 < len(words) else ''
        if is_option and len(f'{line} {word} {value} \\') > _COLUMNS:
            lines.append(f'{line} \\')
            line = '     '
        line += f' {word}'
    yield from [*lines, line]


def _row(label: str, value: str) -> list[str]:
    """Wrap a value beside its label."""
    # A recording may hold any text, also the control codes of a terminal.
    printable = ''.join(each if each.isprintable() else '?' for each in value)
    return textwrap.wrap(
        printable,
        _COLUMNS,
        initial_indent=f'  {label}'.ljust(_LABEL),
        subsequent_indent=' ' * _LABEL,
        break_on_hyphens=False,
        break_long_words=False,
    ) or [f'  {label}']
