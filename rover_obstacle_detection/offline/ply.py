"""Write point clouds as PLY files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_VERTEX = np.dtype(
    [
        ('x', '<f4'),
        ('y', '<f4'),
        ('z', '<f4'),
        ('height', '<f4'),
        ('confidence', '<f4'),
        ('red', 'u1'),
        ('green', 'u1'),
        ('blue', 'u1'),
        ('obstacle', 'u1'),
    ]
)
_PLY_TYPES = {'<f4': 'float', '|u1': 'uchar'}
_OBSTACLE_COLOUR = (225, 40, 40)
_GROUND_COLOUR = (170, 160, 145)


def write_ply(
    path: Path, obstacle_points: NDArray[np.float32], ground_points: NDArray[np.float32]
) -> None:
    """Write obstacle and ground points, coloured, to one binary little-endian PLY file.

    Parameters
    ----------
    path : Path
    obstacle_points : ndarray of float32, shape (n, 5)
        x, y, z in the left optical frame and height above the local ground, in metres;
        confidence.
    ground_points : ndarray of float32, shape (m, 4)
        The same without confidence, which is 0 in the file.
    """
    clouds = (
        (obstacle_points, _OBSTACLE_COLOUR, 1),
        (ground_points, _GROUND_COLOUR, 0),
    )
    vertices = np.concatenate([_vertices(*cloud) for cloud in clouds])
    properties = ''.join(
        f'property {_PLY_TYPES[_VERTEX[name].str]} {name}\n' for name in _VERTEX.names or ()
    )
    header = (
        'ply\n'
        'format binary_little_endian 1.0\n'
        'comment left optical frame: x right, y down, z forward; metres\n'
        f'element vertex {len(vertices)}\n'
        f'{properties}'
        'end_header\n'
    )
    path.write_bytes(header.encode('ascii') + vertices.tobytes())


def _vertices(
    points: NDArray[np.float32], colour: tuple[int, int, int], obstacle: int
) -> NDArray[np.void]:
    vertices = np.zeros(len(points), _VERTEX)
    for name, column in zip(_VERTEX.names or (), points.T, strict=False):
        vertices[name] = column
    for name, value in zip(('red', 'green', 'blue'), colour, strict=True):
        vertices[name] = value
    vertices['obstacle'] = obstacle
    return vertices
