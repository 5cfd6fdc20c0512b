"""Which pixels show the rover itself: from a picture, from a polygon, or both."""

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


@dataclass(frozen=True, eq=False)
class RoverMask:
    """The rover's own body in the left image.

    Parameters
    ----------
    picture : ndarray of bool, shape (height, width), optional
        True on the rover.
    polygon : tuple of (column, row), optional
        Outline in pixels of the left image; may reach beyond it.
    """

    picture: NDArray[np.bool_] | None = None
    polygon: Polygon = ()

    @classmethod
    def load(cls, path: str = '', polygon: str = '') -> RoverMask | None:
        """Read what the parameters ``rover_mask`` and ``rover_polygon`` name.

        Parameters
        ----------
        path : str
            A picture, not black where the left image shows the rover; '' for none.
        polygon : str
            ``[[column, row], ...]`` in pixels, written as Nav2's ``footprint``; '' for none.

        Returns
        -------
        RoverMask or None
            None where neither is given.

        Raises
        ------
        ConfigurationError
            If the picture cannot be read or the polygon is none.
        """
        if not path and not polygon:
            return None
        return cls(
            picture=_read_picture(path) if path else None,
            polygon=_parse_polygon(polygon) if polygon else (),
        )

    def pixels(self, height: int, width: int) -> NDArray[np.bool_]:
        """Draw the mask for an image.

        Returns
        -------
        ndarray of bool, shape (height, width)

        Raises
        ------
        ConfigurationError
            If the picture has another size than the image.
        """
        drawn = np.zeros((height, width), np.uint8)
        if self.polygon:
            corners = np.rint(np.asarray(self.polygon)).astype(np.int32)
            cv2.fillPoly(drawn, [corners], 1)
        if self.picture is None:
            return drawn.astype(bool)
        if self.picture.shape != (height, width):
            msg = (
                f'rover_mask is {self.picture.shape[1]} x {self.picture.shape[0]}: '
                f'expected the size of the left image, {width} x {height}'
            )
            raise ConfigurationError(msg)
        return np.asarray(self.picture | drawn.astype(bool))


def _read_picture(path: str) -> NDArray[np.bool_]:
    file = Path(path).expanduser()
    if not file.is_file():
        msg = f'rover_mask is {path!r}: no such file'
        raise ConfigurationError(msg)
    # Read as bytes: OpenCV prints its own complaint about a file that it cannot open.
    data = np.frombuffer(file.read_bytes(), np.uint8)
    picture = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE) if data.size else None
    if picture is None:
        msg = f'rover_mask is {path!r}: expected a picture, such as a PNG'
        raise ConfigurationError(msg)
    return np.asarray(picture > 0)


def _parse_polygon(text: str) -> Polygon:
    try:
        corners = [_corner(corner) for corner in json.loads(text)]
    except (ValueError, TypeError) as error:
        corners = []
        cause: Exception | None = error
    else:
        cause = None
    if len(corners) < 3:
        msg = (
            f'rover_polygon is {text!r}: expected three or more corners in pixels, '
            'such as [[0, 700], [1023, 700], [1023, 767], [0, 767]]'
        )
        raise ConfigurationError(msg) from cause
    return tuple(corners)


def _corner(corner: Any) -> tuple[float, float]:
    column, row = (float(value) for value in corner)
    # Far beyond any image; what is drawn there must still fit OpenCV's coordinates.
    if not (abs(column) < 30000 and abs(row) < 30000):
        msg = f'{column}, {row} is no pixel'
        raise ValueError(msg)
    return column, row
