"""Calibrations of KITTI: ``calib.txt`` and ``calib_cam_to_cam.txt``."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

import numpy as np

from rover_obstacle_detection.calibration_files import values
from rover_obstacle_detection.calibration_files.numbers import Cameras, Size, rectified_camera
from rover_obstacle_detection.errors import CameraError

_LINE = re.compile(r'^(\w+):[ \t]*(\S.*)$', re.M)
_CAMERA = re.compile(r'image_0?([0-3])(?!\d)|(left_color)')
# The cameras stand some millimetres apart in the other directions, which are corrected by rows.
_MAX_OFF_ROW = 0.05


def is_kitti(text: str) -> bool:
    """Whether a text has lines such as ``P0: 7.188560e+02 ...``."""
    return bool(re.search(r'^P(_rect_0)?[0-3]:', text, re.M))


def is_colour(name: str) -> bool:
    """Whether a path or topic names one of the colour cameras, 2 and 3."""
    found = list(_CAMERA.finditer(name))
    return bool(found) and (found[-1][1] in ('2', '3') or bool(found[-1][2]))


def projections(text: str, size: Callable[[], Size], *, colour: bool) -> Cameras:
    """Read the grey cameras, 0 and 1, or the colour cameras, 2 and 3, of rectified images.

    Parameters
    ----------
    text : str
    size : callable
        Returns the size of the images, if the file has none.
    colour : bool

    Raises
    ------
    CameraError
        Naming the missing or invalid key.
    """
    content = {key: value.split() for key, value in _LINE.findall(text)}
    left, right = ('2', '3') if colour else ('0', '1')
    prefix = 'P_rect_0' if f'P_rect_0{left}' in content else 'P'
    p_left, p_right = (
        np.reshape(values.numbers(content, f'{prefix}{each}', (12,)), (3, 4))
        for each in (left, right)
    )
    if p_left[0, 0] <= 0 or p_left[1, 1] <= 0:
        raise CameraError(f'{prefix}{left} has a focal length of {p_left[0, 0]:g}: expected more')
    try:
        moved = np.linalg.solve(p_left[:, :3], p_right[:, 3] - p_left[:, 3])
    except np.linalg.LinAlgError:
        raise CameraError('the left P has no inverse: expected a projection matrix') from None
    if np.abs(moved[1:]).max() > _MAX_OFF_ROW * abs(moved[0]):
        raise CameraError(
            f'{prefix}{right} moves the camera by {moved.round(4).tolist()} m: expected along x'
        )
    shape = _size(content, left) or size()
    p_left[:, 3] = 0
    p_right[:, 3] = (p_right[0, 0] * moved[0], 0, 0)
    return (
        rectified_camera(shape, tuple(map(float, p_left.ravel()))),
        rectified_camera(shape, tuple(map(float, p_right.ravel()))),
    )


def _size(content: Mapping[str, list[str]], camera: str) -> Size | None:
    key = f'S_rect_0{camera}'
    return values.size(content, key) if key in content else None
