"""The pixels that show the rover itself, given as an image, a polygon, or both."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.errors import ConfigurationError

Polygon = tuple[tuple[float, float], ...]

MIN_CORNERS = 3
# Far beyond any image, and small enough for OpenCV's fixed-point drawing coordinates.
MAX_COORDINATE_PX = 30_000
MAX_POLYGON_CHARACTERS = 10_000
MAX_SHOWN = 100


@dataclass(frozen=True, eq=False)
class RoverMask:
    """The rover's body in the left image; the union of an image and a polygon.

    Parameters
    ----------
    image : ndarray of bool, shape (height, width), optional
        True on the rover.
    polygon : tuple of (column, row), optional
        Outline in pixels of the left image; may extend beyond it.
    """

    image: NDArray[np.bool_] | None = None
    polygon: Polygon = ()

    @classmethod
    def load(cls, path: str = '', polygon: str = '') -> RoverMask | None:
        """Load the mask from the parameters ``rover_mask`` and ``rover_polygon``.

        Parameters
        ----------
        path : str
            Image file that is not black where the left image shows the rover; '' for none.
        polygon : str
            ``[[column, row], ...]`` in pixels, the syntax of Nav2's ``footprint``; '' for none.

        Returns
        -------
        RoverMask or None
            None if neither is given.

        Raises
        ------
        ConfigurationError
            If the image cannot be read or the polygon is invalid.
        """
        if not path and not polygon:
            return None
        return cls(
            image=_read_image(path) if path else None,
            polygon=_parse_polygon(polygon) if polygon else (),
        )

    def pixels(self, height: int, width: int) -> NDArray[np.bool_]:
        """Return the mask for an image of the given size.

        Returns
        -------
        ndarray of bool, shape (height, width)

        Raises
        ------
        ConfigurationError
            If the mask image has another size.
        """
        drawn = np.zeros((height, width), np.uint8)
        if self.polygon:
            corners = np.rint(np.asarray(self.polygon)).astype(np.int32)
            cv2.fillPoly(drawn, [corners], 1)
        if self.image is None:
            return drawn.astype(bool)
        if self.image.shape != (height, width):
            raise ConfigurationError(
                f'rover_mask is {self.image.shape[1]} x {self.image.shape[0]}: '
                f'expected the size of the left image, {width} x {height}'
            )
        return np.asarray(self.image | drawn.astype(bool))


def _read_image(path: str) -> NDArray[np.bool_]:
    file = Path(path).expanduser()
    if not file.is_file():
        raise ConfigurationError(f'rover_mask is {path!r}: no such file')
    # cv2.imread would print its own warning about an unreadable file.
    try:
        data = np.frombuffer(file.read_bytes(), np.uint8)
        image = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE) if data.size else None
    except OSError as error:
        raise ConfigurationError(f'rover_mask is {path!r}: {error.strerror}') from None
    except cv2.error:
        # Such as a size that OpenCV refuses.
        image = None
    if image is None:
        raise ConfigurationError(f'rover_mask is {path!r}: expected an image file, such as a PNG')
    return np.asarray(image > 0)


def _parse_polygon(text: str) -> Polygon:
    try:
        if len(text) > MAX_POLYGON_CHARACTERS:
            raise ValueError('too long')
        corners = [_corner(corner) for corner in json.loads(text)]
        if len(corners) < MIN_CORNERS:
            raise ValueError('too few corners')
    except (ValueError, TypeError, OverflowError, RecursionError) as error:
        shown = repr(text) if len(text) <= MAX_SHOWN else f'{text[:MAX_SHOWN]!r} ...'
        raise ConfigurationError(
            f'rover_polygon is {shown}: expected three or more corners in pixels, '
            'such as [[0, 700], [1023, 700], [1023, 767], [0, 767]]'
        ) from error
    return tuple(corners)


def _corner(corner: Any) -> tuple[float, float]:
    column, row = (float(value) for value in corner)
    if not (abs(column) < MAX_COORDINATE_PX and abs(row) < MAX_COORDINATE_PX):
        raise ValueError(f'{column}, {row} is not a pixel')
    return column, row
