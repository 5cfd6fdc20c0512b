"""Encode the grid of obstacles as ``nav_msgs/OccupancyGrid``."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.result.grid import ObstacleGrid
from rover_obstacle_detection.messages.factory import MessageFactory


def encode_grid(grid: ObstacleGrid, header: Any, factory: MessageFactory) -> Any:
    """Make a ``nav_msgs/OccupancyGrid``: 0 free, 100 obstacle, -1 unknown.

    ``info.origin`` places the grid in the left optical frame: x of the grid is forward, y to the
    left, z up.

    Parameters
    ----------
    grid : ObstacleGrid
    header : std_msgs/Header
    factory : MessageFactory
    """
    x, y, z = (float(each) for each in grid.origin_m)
    rows, columns = grid.cells.shape
    origin = factory.make(
        'geometry_msgs/msg/Pose',
        position=factory.make('geometry_msgs/msg/Point', x=x, y=y, z=z),
        orientation=factory.make('geometry_msgs/msg/Quaternion', **_quaternion(grid.axes.T)),
    )
    info = factory.make(
        'nav_msgs/msg/MapMetaData',
        map_load_time=header.stamp,
        resolution=float(grid.cell_m),
        width=columns,
        height=rows,
        origin=origin,
    )
    return factory.make(
        'nav_msgs/msg/OccupancyGrid', header=header, info=info, data=grid.cells.reshape(-1)
    )


def _quaternion(rotation: NDArray[np.float64]) -> dict[str, float]:
    vector = np.asarray(cv2.Rodrigues(rotation)[0], np.float64).ravel()
    half = float(np.linalg.norm(vector)) / 2
    # sin(half) / (2 half), also at 0.
    x, y, z = (float(each) for each in vector * np.sinc(half / math.pi) / 2)
    return {'x': x, 'y': y, 'z': z, 'w': math.cos(half)}
