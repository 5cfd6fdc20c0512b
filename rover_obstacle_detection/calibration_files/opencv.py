"""Calibrations that ``cv2.FileStorage`` has written, as YAML or XML."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any
from xml.etree import ElementTree

from rover_obstacle_detection.calibration_files import values
from rover_obstacle_detection.calibration_files.numbers import Cameras, Size, rectified_camera
from rover_obstacle_detection.calibration_files.stereo_rectify import (
    FISHEYE,
    PINHOLE,
    Lens,
    rectified,
)
from rover_obstacle_detection.errors import CameraError
from rover_obstacle_detection.yaml_file import parse_yaml

# The names in OpenCV's documentation and samples, and those of widespread scripts.
_NAMES = {
    f'{name}{number}': tuple(f'{each}{number}' for each in (name, *others))
    for number in (1, 2)
    for name, others in (
        ('K', ('M', 'cameraMatrix', 'camera_matrix_', 'CM')),
        ('D', ('distCoeffs', 'dist_coeffs_', 'dist')),
        ('R', ()),
        ('P', ()),
    )
} | {'R': ('R',), 'T': ('T',)}
_SIZES = ('image_size', 'imageSize', 'img_size', 'size')
_LENSES = ('K1', 'D1', 'K2', 'D2')
_COEFFICIENTS = (4, 5, 8, 12, 14)
_FISHEYE_NAMES = ('equidistant', 'fisheye')


def read_storage(text: str) -> Mapping[str, Any]:
    """Read the matrices and numbers of a file's text; see `stereo_storage`.

    ``cv2.FileStorage`` itself is not used: damaged files make it overwrite memory.

    Raises
    ------
    CameraError
        If it is neither YAML nor XML as `FileStorage` writes it.
    """
    try:
        content = _xml(text) if text.lstrip('\ufeff \t\r\n').startswith('<') else _yaml(text)
    except (ValueError, ElementTree.ParseError) as error:
        raise CameraError(f'is not a file of cv2.FileStorage: {error}') from None
    return {str(name): _value(value) for name, value in content.items()}


def stereo_storage(content: Mapping[str, Any], size: Callable[[], Size]) -> Cameras:
    """Make the cameras of a calibration with ``cv2.stereoCalibrate``.

    With R1, R2, P1 and P2, of ``cv2.stereoRectify``, these are used. Without, they are computed
    from K1, D1, K2, D2, R and T. With P1 and P2 alone, the images are rectified.

    Parameters
    ----------
    content : mapping
        See `read_storage`.
    size : callable
        Returns the size of the images, which the file does not need to have.

    Raises
    ------
    CameraError
        Naming the missing or invalid key.
    """
    found = {
        name: name_in_file
        for name, names in _NAMES.items()
        for name_in_file in reversed(names)
        if name_in_file in content
    }
    # Any other key is that of raw images.
    is_rectified = found.keys() == {'P1', 'P2'}
    has_rectification = {'R1', 'R2', 'P1', 'P2'} <= found.keys()
    needed = (*_LENSES, *(() if has_rectification else ('R', 'T')))
    lacking = [name for name in needed if name not in found]
    if lacking and not is_rectified:
        raise CameraError(
            f'lacks {", ".join(lacking)}: expected K1 (or M1), D1, K2 (or M2), D2, R and '
            'T, or P1 and P2 alone'
        )

    def get(name: str, *counts: int) -> tuple[float, ...]:
        return values.numbers(content, found.get(name, name), counts)

    shape = _size(content) or size()
    if is_rectified:
        return rectified_camera(shape, get('P1', 12)), rectified_camera(shape, get('P2', 12))
    model = FISHEYE if content.get('distortion_model') in _FISHEYE_NAMES else PINHOLE
    left, right = (
        Lens(shape, get(f'K{number}', 9), get(f'D{number}', *_COEFFICIENTS), model)
        for number in '12'
    )
    if not has_rectification:
        return rectified(left, right, get('R', 9), get('T', 3))
    return (
        left.with_rectification(get('R1', 9), get('P1', 12)),
        right.with_rectification(get('R2', 9), get('P2', 12)),
    )


def _size(content: Mapping[str, Any]) -> Size | None:
    if 'image_width' in content and 'image_height' in content:
        (width,) = values.numbers(content, 'image_width', (1,))
        (height,) = values.numbers(content, 'image_height', (1,))
        return int(width), int(height)
    return next((values.size(content, each) for each in _SIZES if each in content), None)


def _yaml(text: str) -> Mapping[Any, Any]:
    # YAML 1.2 has neither this header nor these tags.
    content = parse_yaml(re.sub(r'^\ufeff?%YAML:.*|!!opencv-[a-z-]+', '', text))
    if not isinstance(content, Mapping):
        raise ValueError('expected name: value')
    return content


def _xml(text: str) -> Mapping[str, Any]:
    if '<!' in text:
        raise ValueError('expected no declarations')
    return {
        node.tag: {each.tag: each.text for each in node} if len(node) else node.text
        for node in ElementTree.fromstring(text)
    }


def _value(value: Any) -> Any:
    """Return a matrix or a list of numbers as a flat list, anything else as it is."""
    if isinstance(value, Mapping):
        value = value.get('data')
    if isinstance(value, str) and len(value.split()) > 1:
        value = value.split()
    return value
