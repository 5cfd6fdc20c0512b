"""Encode the disparity of a detection as ``stereo_msgs/DisparityImage``."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.messages.encodings import FLOAT_ENCODING
from rover_obstacle_detection.messages.factory import MessageFactory
from rover_obstacle_detection.messages.image import encode_image

# Below min_disparity, which is how the message marks a pixel without a match.
_INVALID_PX = np.float32(-1)
# SGBM's subpixel resolution.
_STEP_PX = 1 / 16


def encode_disparity(detection: Detection, header: Any, factory: MessageFactory) -> Any:
    """Make a ``stereo_msgs/DisparityImage``, in which depth is ``Z = f T / d``.

    The disparity of a point at infinity is already subtracted. Pixels without a match are -1.

    Parameters
    ----------
    detection : Detection
    header : std_msgs/Header
    factory : MessageFactory
    """
    camera, disparity = detection.camera, detection.disparity
    valid = disparity > 0
    nearest = camera.disparity_at(detection.config.min_range)
    return factory.make(
        'stereo_msgs/msg/DisparityImage',
        header=header,
        image=encode_image(
            np.where(valid, disparity, _INVALID_PX), FLOAT_ENCODING, header, factory
        ),
        f=float(camera.fx),
        t=float(camera.baseline_m),
        valid_window=factory.make('sensor_msgs/msg/RegionOfInterest', **_window(valid)),
        min_disparity=0.0,
        max_disparity=max(nearest, float(disparity.max())),
        delta_d=_STEP_PX,
    )


def _window(valid: NDArray[np.bool_]) -> dict[str, int]:
    """Return the bounding box of the matched pixels."""
    columns, rows = np.flatnonzero(valid.any(axis=0)), np.flatnonzero(valid.any(axis=1))
    if not columns.size:
        return {}
    return {
        'x_offset': int(columns[0]),
        'y_offset': int(rows[0]),
        'width': int(columns[-1] - columns[0]) + 1,
        'height': int(rows[-1] - rows[0]) + 1,
    }
