"""Encode and decode ``sensor_msgs/PointCloud2``."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.messages.factory import MessageFactory

FIELDS = ('x', 'y', 'z', 'height', 'confidence')
GROUND_FIELDS = FIELDS[:4]
"""Field names in order; ground clouds have no confidence."""

_FLOAT32 = 7  # sensor_msgs/PointField.FLOAT32


def encode_cloud(points: NDArray[np.float32], header: Any, factory: MessageFactory) -> Any:
    """Encode points as an unorganised, unpadded, little-endian ``sensor_msgs/PointCloud2``.

    Parameters
    ----------
    points : ndarray of float32, shape (n, 4) or (n, 5)
        x, y, z, height (m) and optionally confidence. All values must be finite, because
        Nav2 does not check for NaN. ``n`` may be 0.
    header : std_msgs/Header
    factory : MessageFactory
    """
    packed = np.ascontiguousarray(points, '<f4')
    names = FIELDS[: points.shape[1]]
    point_step = 4 * len(names)
    fields = [
        factory.make(
            'sensor_msgs/msg/PointField', name=name, offset=4 * index, datatype=_FLOAT32, count=1
        )
        for index, name in enumerate(names)
    ]
    return factory.make(
        'sensor_msgs/msg/PointCloud2',
        header=header,
        height=1,
        width=len(packed),
        fields=fields,
        is_bigendian=False,
        point_step=point_step,
        row_step=point_step * len(packed),
        data=packed.reshape(-1).view(np.uint8),
        is_dense=True,
    )


def decode_cloud(message: Any) -> NDArray[np.float32]:
    """Decode a ``sensor_msgs/PointCloud2`` whose fields are all float32.

    Returns
    -------
    ndarray of float32, shape (n, k)
        One row per point, one column per field in message order.

    Raises
    ------
    ValueError
        If a field has another type.
    """
    others = [field.name for field in message.fields if field.datatype != _FLOAT32]
    if others:
        msg = f'field {others[0]!r} is not float32'
        raise ValueError(msg)
    layout = np.dtype(
        {
            'names': [field.name for field in message.fields],
            'formats': ['>f4' if message.is_bigendian else '<f4'] * len(message.fields),
            'offsets': [field.offset for field in message.fields],
            'itemsize': message.point_step,
        }
    )
    rows = np.ndarray(
        (message.height, message.width),
        layout,
        memoryview(message.data),
        strides=(message.row_step, message.point_step),
    )
    columns = [rows[name].reshape(-1) for name in layout.names or ()]
    return np.column_stack(columns).astype(np.float32)
