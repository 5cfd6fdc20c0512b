"""The supported pixel encodings of ``sensor_msgs/image_encodings``."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import DTypeLike


@dataclass(frozen=True)
class Encoding:
    """Memory layout of an encoding and its conversion to grey or BGR.

    Parameters
    ----------
    dtype : dtype
        Type of one channel, native byte order.
    channels : int
    conversion : int, optional
        OpenCV colour conversion code: to BGR, or to grey for 16-bit Bayer mosaics.
    even : tuple of str
        Dimensions that must be even, because their pixels share colour.
    colour_rows : bool
        Whether the colour lies in half as many rows again below the grey image.
    """

    dtype: DTypeLike
    channels: int
    conversion: int | None = None
    even: tuple[str, ...] = ()
    colour_rows: bool = False

    @property
    def pixel_bytes(self) -> int:
        """Size of one pixel (bytes)."""
        return np.dtype(self.dtype).itemsize * self.channels


_UYVY = Encoding(np.uint8, 2, cv2.COLOR_YUV2BGR_UYVY, ('width',))
_YUYV = Encoding(np.uint8, 2, cv2.COLOR_YUV2BGR_YUY2, ('width',))
_NV_EVEN = ('width', 'height')

IMAGE_ENCODINGS = {
    'mono8': Encoding(np.uint8, 1),
    '8UC1': Encoding(np.uint8, 1),
    'mono16': Encoding(np.uint16, 1),
    '16UC1': Encoding(np.uint16, 1),
    'bgr8': Encoding(np.uint8, 3),
    '8UC3': Encoding(np.uint8, 3),
    'rgb8': Encoding(np.uint8, 3, cv2.COLOR_RGB2BGR),
    'bgra8': Encoding(np.uint8, 4, cv2.COLOR_BGRA2BGR),
    '8UC4': Encoding(np.uint8, 4, cv2.COLOR_BGRA2BGR),
    'rgba8': Encoding(np.uint8, 4, cv2.COLOR_RGBA2BGR),
    'bayer_rggb8': Encoding(np.uint8, 1, cv2.COLOR_BayerRGGB2BGR),
    'bayer_bggr8': Encoding(np.uint8, 1, cv2.COLOR_BayerBGGR2BGR),
    'bayer_gbrg8': Encoding(np.uint8, 1, cv2.COLOR_BayerGBRG2BGR),
    'bayer_grbg8': Encoding(np.uint8, 1, cv2.COLOR_BayerGRBG2BGR),
    'bayer_rggb16': Encoding(np.uint16, 1, cv2.COLOR_BayerRGGB2GRAY),
    'bayer_bggr16': Encoding(np.uint16, 1, cv2.COLOR_BayerBGGR2GRAY),
    'bayer_gbrg16': Encoding(np.uint16, 1, cv2.COLOR_BayerGBRG2GRAY),
    'bayer_grbg16': Encoding(np.uint16, 1, cv2.COLOR_BayerGRBG2GRAY),
    'yuv422': _UYVY,
    'uyvy': _UYVY,
    'yuv422_yuy2': _YUYV,
    'yuyv': _YUYV,
    'nv12': Encoding(np.uint8, 1, cv2.COLOR_YUV2BGR_NV12, _NV_EVEN, colour_rows=True),
    'nv21': Encoding(np.uint8, 1, cv2.COLOR_YUV2BGR_NV21, _NV_EVEN, colour_rows=True),
}

FLOAT_ENCODING = '32FC1'

WRITTEN_ENCODINGS = {
    **{name: each for name, each in IMAGE_ENCODINGS.items() if each.conversion is None},
    'rgb8': IMAGE_ENCODINGS['rgb8'],
    FLOAT_ENCODING: Encoding(np.float32, 1),
}
