"""Take residual lens distortion into the coefficients of a calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.rectification.lens_distortion import LensDistortion, Lenses
from rover_obstacle_detection.messages.calibration import CameraInfo, StereoCalibration
from rover_obstacle_detection.messages.rectification import FISHEYE_MODEL, Rectification

Floats = NDArray[np.float64]

# The first coefficients are fitted. Those that follow in rational_polynomial are kept: together
# with them, many solutions would fit as well.
_FISHEYE_COEFFICIENTS, _PINHOLE_COEFFICIENTS = 4, 5
_GRID = 25
_RADII = 20
_PASSES = 5
_DIFFERENCE = 1e-6
_MAX_ZOOM, _HALVINGS = 1.3, 8
_SHARE_TOLERANCE = 2e-4


def median_lenses(found: Sequence[Lenses], camera: StereoCamera) -> Lenses:
    """Lenses that move each radius by the median of how far the found ones move it.

    The two coefficients of one pair depend on each other, so their own medians would not do.

    Parameters
    ----------
    found : sequence of Lenses
        At least one.
    camera : StereoCamera
    """

    def median(lenses: Sequence[LensDistortion], columns: NDArray[np.float32]) -> LensDistortion:
        corner = np.hypot(np.abs(columns).max(), np.abs(camera.rays()[1]).max())
        radius = np.linspace(0, float(corner), _RADII)
        powers = radius[:, np.newaxis] ** (3, 5, 7)
        bend = np.median([powers @ each.coefficients for each in lenses], axis=0)
        solution, *_ = np.linalg.lstsq(powers[:, :2], bend, rcond=None)
        return LensDistortion(*solution.tolist())

    left, right = (view.rays()[0] for view in found[0].views(camera))
    return Lenses(
        median([each.left for each in found], left), median([each.right for each in found], right)
    )


def difference(lenses: Lenses) -> Lenses:
    """Lenses that differ as much, without what both have in common.

    What they have in common hardly shifts rows, so pairs show little of it.
    """
    left, right = lenses.left.coefficients, lenses.right.coefficients
    half = [(one - other) / 2 for one, other in zip(left, right, strict=True)]
    return Lenses(LensDistortion(*half), LensDistortion(*(-each for each in half)))


def with_lens(info: CameraInfo, lens: LensDistortion) -> tuple[CameraInfo, float]:
    """Change D so that rectification also removes a distortion of the rectified image.

    Parameters
    ----------
    info : CameraInfo
        A calibration that rectification accepts.
    lens : LensDistortion
        What the rectified image still shows.

    Returns
    -------
    CameraInfo
    off_px : float
        Mean distance by which the new coefficients miss a place in the raw image, pixels.

    Notes
    -----
    The rectified image bends about its own centre, D about that of the raw image, after the
    rotation R. So D is fitted (Gauss-Newton) to where the raw image shows the points of a grid.
    """
    if not lens:
        return info, 0.0
    p = np.reshape(info.p, (3, 4))
    columns, rows = np.meshgrid(
        np.linspace(0, info.width - 1, _GRID), np.linspace(0, info.height - 1, _GRID)
    )
    x, y = (columns - p[0, 2]) / p[0, 0], (rows - p[1, 2]) / p[1, 1]
    stretch = 1 + lens.stretch(x.astype(np.float32), y.astype(np.float32)).astype(np.float64)
    is_fisheye = info.distortion_model == FISHEYE_MODEL
    count = _FISHEYE_COEFFICIENTS if is_fisheye else _PINHOLE_COEFFICIENTS
    d = np.zeros(max(count, len(info.d)))
    d[: len(info.d)] = info.d
    wanted = _raw_places(info, x * stretch, y * stretch, d)
    column, row = wanted.T
    shown = (column >= 0) & (column < info.width) & (row >= 0) & (row < info.height)
    x, y, wanted = x.ravel()[shown], y.ravel()[shown], wanted[shown]
    places = _raw_places(info, x, y, d)
    for _ in range(_PASSES):
        slopes = [
            (_raw_places(info, x, y, moved) - places).ravel() / _DIFFERENCE
            for moved in d + _DIFFERENCE * np.identity(d.size)[:count]
        ]
        solution, *_ = np.linalg.lstsq(np.transpose(slopes), (wanted - places).ravel(), rcond=None)
        d[:count] += solution
        places = _raw_places(info, x, y, d)
    off_px = np.linalg.norm(wanted - places, axis=-1)
    return replace(info, d=tuple(d.tolist())), float(off_px.mean())


def without_border(changed: StereoCalibration, former: StereoCalibration) -> StereoCalibration:
    """Enlarge the rectified images until they show no more black border than before.

    The border of a rectified image is black where it lies outside the raw one, and black borders
    look like obstacles. The calibration stays as it is if `_MAX_ZOOM` is not enough.
    """
    wanted = _seen_share(former) - _SHARE_TOLERANCE
    low, high = 1.0, _MAX_ZOOM
    if _seen_share(changed) >= wanted or _seen_share(_enlarged(changed, high)) < wanted:
        return changed
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        if _seen_share(_enlarged(changed, middle)) < wanted:
            low = middle
        else:
            high = middle
    return _enlarged(changed, high)


def _seen_share(calibration: StereoCalibration) -> float:
    cameras = calibration.left, calibration.right
    return min(Rectification(each, calibration.source).seen_share for each in cameras)


def _enlarged(calibration: StereoCalibration, zoom: float) -> StereoCalibration:
    def camera(info: CameraInfo) -> CameraInfo:
        fx, fy, offset = (zoom * info.p[index] for index in (0, 5, 3))
        p = fx, info.p[1], info.p[2], offset, info.p[4], fy, *info.p[6:]
        return replace(info, p=p)

    left, right = camera(calibration.left), camera(calibration.right)
    return StereoCalibration(left, right, calibration.source)


def _raw_places(info: CameraInfo, x: Floats, y: Floats, d: Floats) -> Floats:
    """Column and row in the raw image of directions in the rectified one, shape (n, 2)."""
    directions = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=-1)
    points = directions @ np.reshape(info.r, (3, 3))
    k = np.reshape(info.k, (3, 3))
    none = np.zeros(3)
    places: Any
    if info.distortion_model == FISHEYE_MODEL:
        places, _ = cv2.fisheye.projectPoints(points[:, np.newaxis], none, none, k, d)
    else:
        places, _ = cv2.projectPoints(points, none, none, k, d)
    return np.asarray(places, np.float64).reshape(-1, 2)
