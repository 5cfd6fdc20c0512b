"""Input images as an 8-bit grey pair of the camera's size."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.errors import ImageError

GreyPair = tuple[NDArray[np.uint8], NDArray[np.uint8]]


def grey_pair(left: NDArray[Any], right: NDArray[Any], camera: StereoCamera) -> GreyPair:
    """Check both images against the camera and convert them to 8-bit grey.

    Parameters
    ----------
    left, right : ndarray of uint8 or uint16, shape (height, width) or (height, width, 3)
        Grey or BGR.
    camera : StereoCamera

    Returns
    -------
    tuple of two ndarray of uint8, shape (height, width)
        Copies, so that the caller may reuse the buffers.

    Raises
    ------
    ImageError
        If an image has another size than the camera, another type or number of channels.

    Notes
    -----
    16-bit images keep their eight most significant bits in use. Both are shifted equally, by the
    bits that the brighter one needs.
    """
    for name, image in (('left', left), ('right', right)):
        _check(name, image, camera)
    shift = max(_excess_bits(left), _excess_bits(right))
    return _to_grey(left, shift), _to_grey(right, shift)


def equalized(pair: GreyPair) -> GreyPair:
    """Equalise the histogram of each image (study, section 3.3)."""
    return _as_uint8(cv2.equalizeHist(pair[0])), _as_uint8(cv2.equalizeHist(pair[1]))


def _check(name: str, image: NDArray[Any], camera: StereoCamera) -> None:
    if not isinstance(image, np.ndarray):
        msg = (
            f'{name} image is {type(image).__name__}: expected an array (cv2.imread returns None '
            'for a file that it cannot read)'
        )
        raise ImageError(msg)
    if image.dtype not in (np.uint8, np.uint16):
        msg = f'{name} image has type {image.dtype}: expected uint8 or uint16'
        raise ImageError(msg)
    if image.ndim != 2 and not (image.ndim == 3 and image.shape[2] == 3):
        msg = f'{name} image has shape {image.shape}: expected grey or three channels'
        raise ImageError(msg)
    if image.shape[:2] != camera.shape:
        msg = (
            f'{name} image is {image.shape[1]} x {image.shape[0]}: the calibration says '
            f'{camera.width} x {camera.height}'
        )
        raise ImageError(msg)


def _excess_bits(image: NDArray[Any]) -> int:
    if image.dtype == np.uint8:
        return 0
    return max(int(image.max()).bit_length() - 8, 0)


def _to_grey(image: NDArray[Any], shift: int) -> NDArray[np.uint8]:
    if image.ndim == 3:
        image = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))
    if image.dtype == np.uint16:
        image = np.minimum(image >> shift, 255).astype(np.uint8)
    # A copy even of a grey image: the caller may reuse the buffer.
    return np.array(image, np.uint8, order='C')


def _as_uint8(image: Any) -> NDArray[np.uint8]:
    return np.asarray(image, np.uint8)
