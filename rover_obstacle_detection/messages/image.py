"""Decode and encode ``sensor_msgs/Image`` and ``CompressedImage``; no cv_bridge needed."""

from __future__ import annotations

import sys
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.errors import ImageError
from rover_obstacle_detection.messages.encodings import (
    FLOAT_ENCODING,
    IMAGE_ENCODINGS,
    WRITTEN_ENCODINGS,
    Encoding,
)
from rover_obstacle_detection.messages.factory import MessageFactory
from rover_obstacle_detection.messages.image_header import declared_size

MAX_PIXELS = 1 << 26
"""Largest compressed image that is decoded, unless the camera's size is known."""
OVERSIZE = 4
"""Images up to this many times the camera's size are decoded, and then refused by their size."""

# Decoders accept a truncated file and fill the rest with grey; a missing end marker reveals it.
_END_MARKERS = {
    b'\xff\xd8\xff': ('JPEG', b'\xff\xd9'),
    b'\x89PNG': ('PNG', b'IEND\xaeB`\x82'),
}
# Some cameras pad the file to a round size, so the end marker need not be the last bytes.
_MAX_PADDING_BYTES = 4096
# Rows and pixels from which the byte order of a 16-bit image is judged.
_ORDER_ROWS, _ORDER_PIXELS = 64, 1000
# Share of an image's variance between neighbours. Seven real cameras: below 0.06 in the right byte
# order, 0.13 to 0.9 in the wrong one, and always at least four times as much.
_MIN_ROUGHNESS, _MAX_RATIO = 0.1, 0.4


def decode_camera_image(message: Any, name: str, most_pixels: int = MAX_PIXELS) -> NDArray[Any]:
    """Decode what a camera sees; see `decode_any_image`.

    Raises
    ------
    ImageError
        Also if a 16-bit image is only a picture with its bytes swapped.
    """
    encoding = IMAGE_ENCODINGS.get(getattr(message, 'encoding', ''))
    if encoding is not None and encoding.dtype is np.uint16:
        _check_byte_order(_pixels(message, encoding, name), message.is_bigendian, name)
    return decode_any_image(message, name, most_pixels)


def decode_any_image(message: Any, name: str, most_pixels: int = MAX_PIXELS) -> NDArray[Any]:
    """Decode an Image or a CompressedImage; see `decode_image`, `decode_compressed_image`."""
    if hasattr(message, 'encoding'):
        return decode_image(message, name)
    return decode_compressed_image(message, name, most_pixels)


def image_size(message: Any) -> tuple[int, int] | None:
    """Return width and height of an Image or CompressedImage; None if it does not say so."""
    if hasattr(message, 'encoding'):
        size = int(message.width), int(message.height)
    else:
        try:
            size = declared_size(_bytes(message.data).tobytes())
        except ValueError:
            return None
    return size if min(size) > 0 else None


def halves(image: NDArray[Any], name: str) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the left and the right half of an image that shows both views side by side.

    Raises
    ------
    ImageError
        If its width is odd.
    """
    width = image.shape[1]
    if width % 2:
        raise ImageError(
            f'{name}: width is {width}: expected an even number for two views side by side'
        )
    left, right = np.split(image, 2, axis=1)
    return np.ascontiguousarray(left), np.ascontiguousarray(right)


def decode_image(message: Any, name: str) -> NDArray[Any]:
    """Decode a ``sensor_msgs/Image``.

    Parameters
    ----------
    message : sensor_msgs/Image
        From rclpy or rosbags. Row padding (``step``) and endianness are honoured.
    name : str
        Topic or file, for error messages.

    Returns
    -------
    ndarray of uint8 or uint16, shape (height, width), or of uint8, shape (height, width, 3)
        Grey or BGR; 16-bit Bayer mosaics become 16-bit grey. Do not write to the array: without
        a conversion it shares the message's memory.

    Raises
    ------
    ImageError
        Naming the invalid field and the expected value.
    """
    encoding = IMAGE_ENCODINGS.get(message.encoding)
    if encoding is None:
        msg = (
            f'{name}: encoding is {message.encoding!r}: expected one of '
            f'{", ".join(IMAGE_ENCODINGS)}'
        )
        raise ImageError(msg)
    pixels = _pixels(message, encoding, name)
    return pixels if encoding.conversion is None else cv2.cvtColor(pixels, encoding.conversion)


def decode_float_image(message: Any, name: str) -> NDArray[np.float32]:
    """Decode a 32FC1 ``sensor_msgs/Image``, such as depth or disparity.

    Returns
    -------
    ndarray of float32, shape (height, width)

    Raises
    ------
    ImageError
        Naming the invalid field and the expected value.
    """
    if message.encoding != FLOAT_ENCODING:
        msg = f'{name}: encoding is {message.encoding!r}: expected {FLOAT_ENCODING}'
        raise ImageError(msg)
    return _pixels(message, WRITTEN_ENCODINGS[FLOAT_ENCODING], name)


def decode_compressed_image(
    message: Any, name: str, most_pixels: int = MAX_PIXELS
) -> NDArray[Any]:
    """Decode a ``sensor_msgs/CompressedImage``: JPEG, PNG, PNM, BMP or TIFF.

    Parameters
    ----------
    message : sensor_msgs/CompressedImage
    name : str
        Topic or file, for error messages.
    most_pixels : int
        Larger images are refused before memory is allocated for them.

    Returns
    -------
    ndarray
        See `decode_image`.

    Raises
    ------
    ImageError
        If the data is empty, truncated, too large or not an 8- or 16-bit image.
    """
    data = _bytes(message.data)
    _check_complete(data, name)
    _check_declared_size(data, message.format, most_pixels, name)
    try:
        image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    except cv2.error:
        image = None
    if image is None:
        msg = (
            f'{name}: data cannot be decoded as an image (format {message.format!r}, '
            f'{data.size} bytes)'
        )
        raise ImageError(msg)
    if image.dtype not in (np.uint8, np.uint16):
        msg = f'{name}: data decodes to {image.dtype}: expected 8 or 16 bits per channel'
        raise ImageError(msg)
    return _grey_or_bgr(image, message.format)


def encode_image(array: NDArray[Any], encoding: str, header: Any, factory: MessageFactory) -> Any:
    """Encode an array as ``sensor_msgs/Image``, without row padding, in native byte order.

    Parameters
    ----------
    array : ndarray, shape (height, width) or (height, width, channels)
    encoding : str
        mono8, mono16, 8UC1, 16UC1, bgr8, rgb8, 8UC3 or 32FC1. Must already match the array;
        nothing is converted.
    header : std_msgs/Header
    factory : MessageFactory

    Raises
    ------
    ValueError
        If dtype or channels do not match the encoding.
    """
    layout = WRITTEN_ENCODINGS[encoding]
    channels = 1 if array.ndim == 2 else array.shape[2]
    if array.dtype != np.dtype(layout.dtype) or channels != layout.channels:
        msg = f'{encoding} does not fit an array of {array.dtype} with {channels} channels'
        raise ValueError(msg)
    height, width = array.shape[:2]
    return factory.make(
        'sensor_msgs/msg/Image',
        header=header,
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=int(sys.byteorder == 'big'),
        step=width * layout.pixel_bytes,
        data=np.ascontiguousarray(array).reshape(-1).view(np.uint8),
    )


def encode_compressed_image(
    jpeg: bytes, header: Any, factory: MessageFactory, encoding: str = 'bgr8'
) -> Any:
    """Wrap a JPEG file as ``sensor_msgs/CompressedImage``, as image_transport does.

    Parameters
    ----------
    jpeg : bytes
    header : std_msgs/Header
    factory : MessageFactory
    encoding : str
        Of the image before compression.
    """
    return factory.make(
        'sensor_msgs/msg/CompressedImage',
        header=header,
        format=f'{encoding}; jpeg compressed {encoding}',
        data=np.frombuffer(jpeg, np.uint8),
    )


def _pixels(message: Any, encoding: Encoding, name: str) -> NDArray[Any]:
    height, width, step = int(message.height), int(message.width), int(message.step)
    for field, value in (('height', height), ('width', width)):
        if value <= 0:
            msg = f'{name}: {field} is {value}: expected a positive number of pixels'
            raise ImageError(msg)
        if field in encoding.even and value % 2:
            msg = f'{name}: {field} is {value}: expected an even number for {message.encoding}'
            raise ImageError(msg)
    rows, rows_text = height, 'height'
    if encoding.colour_rows:
        rows, rows_text = height * 3 // 2, '1.5 height'
    row_bytes = width * encoding.pixel_bytes
    if step < row_bytes:
        msg = (
            f'{name}: step is {step}: expected at least {row_bytes} bytes for {width} pixels of '
            f'{message.encoding}'
        )
        raise ImageError(msg)
    data = _bytes(message.data)
    if data.size != rows * step:
        msg = (
            f'{name}: data has {data.size} bytes: expected {rows_text} x step = {rows} x {step} = '
            f'{rows * step}'
        )
        raise ImageError(msg)
    stored = np.dtype(encoding.dtype).newbyteorder('>' if message.is_bigendian else '<')
    shape = (rows, width) if encoding.channels == 1 else (rows, width, encoding.channels)
    strides = (step, encoding.pixel_bytes, stored.itemsize)[: len(shape)]
    pixels: NDArray[Any] = np.ndarray(shape, stored, data.data, strides=strides)
    return pixels.astype(encoding.dtype, copy=False)


def _check_byte_order(image: NDArray[np.uint16], is_bigendian: int, name: str) -> None:
    """Reject an image whose neighbouring pixels are much more alike with their bytes swapped."""
    sample = image[:: max(1, len(image) // _ORDER_ROWS)]
    if sample.size < _ORDER_PIXELS or sample.shape[1] < 3:
        return
    roughness = _roughness(sample)
    if roughness > _MIN_ROUGHNESS and _roughness(sample.byteswap()) < _MAX_RATIO * roughness:
        order = int(bool(is_bigendian))
        msg = (
            f'{name}: is_bigendian is {order}, but only in the other byte order do the pixels '
            f'show a picture: expected {1 - order}'
        )
        raise ImageError(msg)


def _roughness(image: NDArray[np.uint16]) -> float:
    """Share of the variance between pixels two columns apart; 1 for noise.

    In a Bayer mosaic, these have the same colour.
    """
    grey = image.astype(np.float32)
    variance = float(grey.var())
    return float(np.square(grey[:, 2:] - grey[:, :-2]).mean()) / 2 / variance if variance else 0.0


def _bytes(data: Any) -> NDArray[np.uint8]:
    return np.frombuffer(data, np.uint8) if len(data) else np.zeros(0, np.uint8)


def _check_complete(data: NDArray[np.uint8], name: str) -> None:
    if not data.size:
        msg = f'{name}: data is empty: expected a compressed image'
        raise ImageError(msg)
    start = data[:4].tobytes()
    for magic, (kind, end) in _END_MARKERS.items():
        if start.startswith(magic) and end not in data[-_MAX_PADDING_BYTES:].tobytes():
            msg = f'{name}: data is a {kind} file of {data.size} bytes cut short'
            raise ImageError(msg)


def _check_declared_size(
    data: NDArray[np.uint8], format_: str, most_pixels: int, name: str
) -> None:
    try:
        width, height = declared_size(data.tobytes())
    except ValueError as error:
        msg = (
            f'{name}: data cannot be decoded as an image (format {format_!r}, {data.size} bytes): '
            f'{error}'
        )
        raise ImageError(msg) from None
    if width * height > most_pixels:
        msg = (
            f'{name}: data is an image of {width} x {height} pixels: expected at most '
            f'{most_pixels} pixels'
        )
        raise ImageError(msg)


def _grey_or_bgr(image: NDArray[Any], format_: str) -> NDArray[Any]:
    if image.ndim == 2:
        source = IMAGE_ENCODINGS.get(format_.split(';')[0].strip())
        # compressed_image_transport stores a Bayer mosaic as a grey image.
        if source is None or source.conversion is None or source.channels != 1:
            return image
        if source.colour_rows:
            return image
        if np.dtype(source.dtype) != image.dtype:
            return image
        return cv2.cvtColor(image, source.conversion)
    if image.dtype == np.uint16:
        alpha = image.shape[2] == 4
        return cv2.cvtColor(image, cv2.COLOR_BGRA2GRAY if alpha else cv2.COLOR_BGR2GRAY)
    return cv2.cvtColor(image, cv2.COLOR_BGRA2BGR) if image.shape[2] == 4 else image
