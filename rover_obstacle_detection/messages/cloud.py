"""Encode and decode ``sensor_msgs/PointCloud2``."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.messages.factory import MessageFactory

FIELDS = ('x', 'y', 'z', 'height', 'confidence')
GROUND_FIELDS = FIELDS[:4]
"""Field names in order; ground clouds have no confidence."""

# sensor_msgs/PointField
_UINT8 = 2
_FLOAT32 = 7
_FORMATS = {_UINT8: 'u1', _FLOAT32: 'f4'}


def encode_cloud(
    points: NDArray[np.float32],
    header: Any,
    factory: MessageFactory,
    kinds: NDArray[np.uint8] | None = None,
) -> Any:
    """Encode points as an unorganised, little-endian ``sensor_msgs/PointCloud2``.

    Readers get each value at a multiple of its size: three bytes of padding follow a `kind`.

    Parameters
    ----------
    points : ndarray of float32, shape (n, 4) or (n, 5)
        x, y, z, height (m) and optionally confidence. All values must be finite, because
        Nav2 does not check for NaN. ``n`` may be 0.
    header : std_msgs/Header
    factory : MessageFactory
    kinds : ndarray of uint8, shape (n,), optional
        Values of an additional field ``kind``: `KIND_NUMBERS`.
    """
    packed = np.ascontiguousarray(points, '<f4').view(np.uint8)
    layout = [(name, 4 * index, _FLOAT32) for index, name in enumerate(FIELDS[: points.shape[1]])]
    if kinds is not None:
        layout.append(('kind', packed.shape[1], _UINT8))
        packed = np.pad(packed, ((0, 0), (0, 4)))
        packed[:, -4] = kinds
    point_step = packed.shape[1]
    fields = [
        factory.make(
            'sensor_msgs/msg/PointField', name=name, offset=offset, datatype=datatype, count=1
        )
        for name, offset, datatype in layout
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
        data=packed.reshape(-1),
        is_dense=True,
    )


def decode_cloud(message: Any) -> NDArray[np.float32]:
    """Decode a ``sensor_msgs/PointCloud2`` whose fields are all float32 or uint8.

    Returns
    -------
    ndarray of float32, shape (n, k)
        One row per point, one column per field in message order.

    Raises
    ------
    ValueError
        If a field has another type.
    """
    others = [field.name for field in message.fields if field.datatype not in _FORMATS]
    if others:
        msg = f'field {others[0]!r} is neither float32 nor uint8'
        raise ValueError(msg)
    order = '>' if message.is_bigendian else '<'
    layout = np.dtype(
        {
            'names': [field.name for field in message.fields],
            'formats': [order + _FORMATS[field.datatype] for field in message.fields],
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
