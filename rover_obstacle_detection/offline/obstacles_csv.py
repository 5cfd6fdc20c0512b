"""Write the obstacles of all frames as a table, ``obstacles.csv``."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable
from pathlib import Path

from rover_obstacle_detection.detection.result.obstacles import Obstacle
from rover_obstacle_detection.errors import OutputError

COLUMNS = (
    'frame',
    'stamp_ns',
    'kind',
    'range_m',
    'height_m',
    'confidence',
    'pixels',
    'box_left_px',
    'box_top_px',
    'box_width_px',
    'box_height_px',
    *(f'{side}_{axis}_m' for side in ('minimum', 'maximum') for axis in 'xyz'),
)


class ObstacleTable:
    """An open ``obstacles.csv``: one row per frame and obstacle.

    Missing numbers, such as the distance of an obstacle without 3D points, are empty. Use it as a
    context manager.

    Parameters
    ----------
    path : Path

    Raises
    ------
    OutputError
        If the file cannot be written; also from `add` and at the end.
    """

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> ObstacleTable:
        try:
            self._file = self._path.open('w', encoding='ascii', newline='')
        except OSError as error:
            raise self._failure(error) from error
        self._writer = csv.writer(self._file, lineterminator='\n')
        self._writer.writerow(COLUMNS)
        return self

    def add(self, number: int, stamp_ns: int, obstacles: Iterable[Obstacle]) -> None:
        """Add the obstacles of a frame."""
        try:
            self._writer.writerows(_row(number, stamp_ns, each) for each in obstacles)
        except OSError as error:
            raise self._failure(error) from error

    def __exit__(self, exc_type: object, *others: object) -> None:
        try:
            self._file.close()
        except OSError as error:
            if exc_type is None:
                raise self._failure(error) from error

    def _failure(self, error: OSError) -> OutputError:
        return OutputError(f'cannot write {self._path.name}: {error.strerror}')


def _row(number: int, stamp_ns: int, obstacle: Obstacle) -> tuple[int | str, ...]:
    return (
        number,
        stamp_ns,
        obstacle.kind,
        _decimal(obstacle.range_m),
        _decimal(obstacle.max_height_m),
        _decimal(obstacle.confidence),
        obstacle.pixels,
        obstacle.left,
        obstacle.top,
        obstacle.width,
        obstacle.height,
        *map(_decimal, (*obstacle.minimum_m, *obstacle.maximum_m)),
    )


def _decimal(value: float) -> str:
    return f'{value:.4f}' if math.isfinite(value) else ''
