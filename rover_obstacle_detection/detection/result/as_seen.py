"""Back from what straight lenses would show to the left image as it is."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.reprojection import reproject
from rover_obstacle_detection.detection.rectification.lens_distortion import Lenses
from rover_obstacle_detection.detection.result.detection import FREE, Detection, Product

# What is said of pixels that straight lenses would not show; regions go on.
_NOT_SHOWN: dict[str, Any] = {
    'disparity': 0,
    'points': np.nan,
    'roughness': np.nan,
    'step': np.nan,
    'height': np.nan,
    'height_noise': np.inf,
    'rock_probability': np.nan,
    'cues': 0,
    'known': False,
    'mask': FREE,
}
_NEVER_OF_THE_ROVER = ('cues', 'known', 'mask')


def as_seen(
    detection: Detection,
    lenses: Lenses,
    grey: NDArray[np.uint8],
    rover_mask: NDArray[np.bool_] | None,
) -> Detection:
    """Give a detection in the straightened left image as one in the left image.

    Parameters
    ----------
    detection : Detection
    lenses : Lenses
        By which the image was straightened.
    grey : ndarray of uint8, shape (height, width)
        The left image as it is.
    rover_mask : ndarray of bool, shape (height, width), optional
        Pixels of the left image that show the rover: never judged.

    Notes
    -----
    Each pixel takes what was found at the nearest one of the straightened image. Its point is
    where a straight lens would have shown it.
    """
    camera = detection.camera
    columns, rows = (np.rint(each) for each in lenses.straight_left_places(camera))
    shown = (columns >= 0) & (columns < camera.width) & (rows >= 0) & (rows < camera.height)
    # What is shown nowhere stays where it is; one flat index, since lazy products hold on to it.
    own_rows, own_columns = np.mgrid[: camera.height, : camera.width]
    rows = np.clip(np.where(np.isnan(rows), own_rows, rows), 0, camera.height - 1)
    columns = np.clip(np.where(np.isnan(columns), own_columns, columns), 0, camera.width - 1)
    place = (rows * camera.width + columns).astype(np.int32)

    def seen(name: str, product: Product) -> NDArray[Any]:
        straight = product() if callable(product) else product
        flat = straight.reshape(-1, *straight.shape[2:])
        array = np.asarray(np.take(flat, place, axis=0))
        if name in _NOT_SHOWN:
            array[~shown] = _NOT_SHOWN[name]
        if rover_mask is not None and name in _NEVER_OF_THE_ROVER:
            array[rover_mask] = 0
        return array

    def later(name: str, product: Product) -> Product:
        return lambda: seen(name, product)

    disparity = detection.disparity
    products = {
        name: later(name, product) if callable(product) else seen(name, product)
        for name, product in detection.products.items()
    }
    products['points'] = later('points', lambda: reproject(disparity, camera))
    products['grey'] = grey
    return replace(detection, products=products)
