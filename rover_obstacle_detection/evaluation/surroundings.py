"""True ground around a part of an image."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane

# Ground within this distance of a part is fitted, metres: enough for a plane, still local.
REACH_M = 0.35
# Parts wider than this are treated as this wide, so that the ground stays local.
MAX_RADIUS_M = 1.0
# Share of a part's points within its radius; the rest are often mismatches.
RADIUS_SHARE = 0.9
# Least margin of the window around a part, pixels.
MIN_MARGIN_PX = 8
# Fewest ground pixels that give a plane, and most that are fitted.
MIN_PIXELS = 30
MAX_PIXELS = 20_000
# Quantile taken as the top of a rock; the pixels above it are mostly mismatches.
TOP_SHARE = 0.98
# Edge of the squares over which a slope is measured, metres: rover scale.
SQUARE_M = 0.4


def plan_axes(up: Sequence[float]) -> NDArray[np.float64]:
    """Horizontal unit vectors ahead of the camera and across, as columns; shape (3, 2)."""
    vertical = np.asarray(up, np.float64)
    ahead = np.array((0.0, 0.0, 1.0)) - vertical[2] * vertical
    ahead /= max(float(np.linalg.norm(ahead)), 1e-9)
    return np.stack((ahead, np.cross(vertical, ahead)), axis=1)


class Surroundings:
    """Interpolates the true ground under a part of an image from the ground around it.

    Parameters
    ----------
    points : ndarray of float32, shape (height, width, 3)
        True points, left optical frame, metres; NaN where there is no surface.
    height_m : ndarray of float32, shape (height, width)
        Height of those points above `plane`.
    is_ground : ndarray of bool, shape (height, width)
        Pixels that show no rock.
    plane : GroundPlane
    camera : StereoCamera
    """

    def __init__(
        self,
        points: NDArray[np.float32],
        height_m: NDArray[np.float32],
        is_ground: NDArray[np.bool_],
        plane: GroundPlane,
        camera: StereoCamera,
    ) -> None:
        self._height_m = height_m
        self._is_ground = is_ground & np.isfinite(height_m)
        self._camera = camera
        self._depth_m = points[..., 2]
        self._places = points @ plan_axes(plane.normal).astype(np.float32)

    def ground(self, inside: NDArray[np.bool_]) -> NDArray[np.float32] | None:
        """Height of the true ground above the plane, at and around a part, metres.

        Returns
        -------
        ndarray of float32, shape (height, width) or None
            Least-squares plane through the ground within 0.35 m of the part; NaN away from it.
            None if too little of that ground is visible.
        """
        window = self.window(inside)
        part = inside[window] & np.isfinite(self._height_m[window])
        if not part.any():
            return None
        places = self._places[window]
        centre = np.median(places[part], axis=0)
        radius_m = float(np.quantile(np.linalg.norm(places[part] - centre, axis=-1), RADIUS_SHARE))
        with np.errstate(invalid='ignore'):
            near = np.linalg.norm(places - centre, axis=-1) < min(radius_m, MAX_RADIUS_M) + REACH_M
        around = near & self._is_ground[window] & ~inside[window]
        if around.sum() < MIN_PIXELS:
            return None
        design = _design(places - centre)
        heights_m = self._height_m[window]
        thin = max(1, int(around.sum()) // MAX_PIXELS)
        chosen = np.flatnonzero(around)[::thin]
        coefficients, *_ = np.linalg.lstsq(
            design.reshape(-1, 3)[chosen], heights_m.ravel()[chosen], rcond=None
        )
        ground_m = np.full(inside.shape, np.nan, np.float32)
        ground_m[window] = design @ coefficients
        return ground_m

    def window(self, inside: NDArray[np.bool_]) -> tuple[slice, slice]:
        """Rows and columns of a part and its surroundings."""
        rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
        depth_m = self._depth_m[inside]
        depth_m = depth_m[np.isfinite(depth_m)]
        # Twice the reach: ground in front of the part is nearer and looks larger.
        reach_px = 2 * REACH_M * self._camera.fx / float(np.median(depth_m)) if depth_m.size else 0
        margin = max(MIN_MARGIN_PX, round(reach_px))
        return (
            slice(max(0, int(rows[0]) - margin), int(rows[-1]) + margin + 1),
            slice(max(0, int(columns[0]) - margin), int(columns[-1]) + margin + 1),
        )


def slope_deg(points: NDArray[np.float32], up: Sequence[float]) -> float:
    """Median slope of a surface at rover scale, degrees.

    Parameters
    ----------
    points : ndarray of float32, shape (n, 3)
        Metres; NaN where there is none.
    up : sequence of float
        Vertical, unit vector.

    Returns
    -------
    float
        Median slope of the planes fitted to squares of 0.4 m; NaN with too few points.
    """
    known = points[np.isfinite(points).all(axis=1)].astype(np.float64)
    places = known @ plan_axes(up)
    heights_m = np.asarray(known @ np.asarray(up, np.float64), np.float64)
    squares = np.floor(places / SQUARE_M).astype(np.int64)
    _, square, counts = np.unique(squares, axis=0, return_inverse=True, return_counts=True)
    square = square.ravel()

    def mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.bincount(square, values, minlength=len(counts)) / counts)

    along: list[NDArray[np.float64]] = [places[:, 0], places[:, 1], heights_m]
    centred = [each - mean(each)[square] for each in along]
    (aa, ab, ah), (_, bb, bh) = ([mean(one * other) for other in centred] for one in centred[:2])
    determinant = aa * bb - ab * ab
    usable = (counts >= MIN_PIXELS) & (determinant > (SQUARE_M / 10) ** 4)
    if not usable.any():
        return float('nan')
    rises = (ah * bb - bh * ab)[usable], (bh * aa - ah * ab)[usable]
    return float(np.median(np.degrees(np.arctan(np.hypot(*rises) / determinant[usable]))))


def top(heights_m: NDArray[np.floating]) -> float:
    """98th percentile of the known heights; NaN without any."""
    return quantile(heights_m, TOP_SHARE)


def median(values: NDArray[np.floating]) -> float:
    """Median of the known values; NaN without any."""
    return quantile(values, 0.5)


def quantile(values: NDArray[np.number], share: float) -> float:
    """Quantile of the known values; NaN without any."""
    known = values[np.isfinite(values)]
    return float(np.quantile(known, share)) if known.size else float('nan')


def _design(places: NDArray[np.floating]) -> NDArray[np.float32]:
    ones = np.ones((*places.shape[:-1], 1), np.float32)
    return np.concatenate((places, ones), axis=-1).astype(np.float32)
