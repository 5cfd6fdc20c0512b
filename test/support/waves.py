"""Stereo pairs of one plane whose texture is a sum of waves: exact at any fraction of a pixel.

Here ``lens`` is the `LensDistortion` of an image. A *straight* place is where a lens without
distortion would show the point.
"""

from __future__ import annotations

import numpy as np

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane
from rover_obstacle_detection.detection.rectification.lens_distortion import (
    STRAIGHT_LENSES,
    LensDistortion,
    Lenses,
)
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT, RowAlignment

WAVES = 60


def texture(columns, rows, *, towards_deg=(0.0, 180.0), shortest_px=5.0, contrast=30.0):
    """Grey level around 128 with a standard deviation of ``contrast``.

    Waves of ``shortest_px`` to 30 px run in directions between two angles, 0 to the right and 90
    down. Between close angles all the texture slants the same way.
    """
    generator = np.random.default_rng(0)
    lengths = np.geomspace(shortest_px, 30, WAVES)
    angles = np.radians(generator.uniform(*towards_deg, WAVES))
    phases = generator.uniform(0, 2 * np.pi, WAVES)
    grey = np.full(np.shape(columns), 128.0)
    for length, angle, phase in zip(lengths, angles, phases, strict=True):
        along = np.cos(angle) * columns + np.sin(angle) * rows
        grey += contrast * np.sqrt(2 / WAVES) * np.sin(2 * np.pi / length * along + phase)
    return grey


def as_image(grey, noise=0.0, seed=1):
    noisy = grey + np.random.default_rng(seed).normal(0, noise, grey.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def stereo_pair(
    camera: StereoCamera,
    plane: DisparityPlane,
    alignment: RowAlignment = STRAIGHT,
    *,
    lenses: Lenses = STRAIGHT_LENSES,
    noise=0.0,
    brighter=0.0,
    **look,
):
    """Left and right image; the right image's rows are off by ``alignment``."""
    columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    left = texture(*straight_left(camera, columns, rows, lenses.left), **look)
    columns, rows = straight_right(camera, columns, rows, lenses.right)
    # The left pixel that each right pixel shows: its column and row depend on each other.
    straight = rows - alignment.offset_px + alignment.turn * camera.cx
    seen_at = columns + camera.disparity_offset + plane.level - plane.slope_u * camera.cx
    # A turn also moves columns: lower rows lie further to the left.
    down = plane.slope_v + alignment.turn
    seen_at += down * (straight - camera.cy)
    seen_at /= 1 - plane.slope_u + down * alignment.turn
    right = texture(seen_at, straight - alignment.turn * seen_at, **look)
    return as_image(left, noise, 1), as_image(right + brighter, noise, 2)


def straight_left(camera: StereoCamera, columns, rows, lens: LensDistortion):
    """Straight places of some places in the left image."""
    return _straight(camera, camera.cx, columns, rows, lens)


def straight_right(camera: StereoCamera, columns, rows, lens: LensDistortion):
    """Straight places of some places in the right image."""
    return _straight(camera, camera.cx - camera.disparity_offset, columns, rows, lens)


def disparity_seen(
    camera: StereoCamera,
    plane: DisparityPlane,
    alignment: RowAlignment = STRAIGHT,
    lenses: Lenses = STRAIGHT_LENSES,
):
    """Disparity of the distorted pair, as matching finds it.

    Only for rows that are slightly off: their effect on the column is ignored.
    """
    columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    straight = straight_left(camera, columns, rows, lenses.left)
    at, down = straight[0] - camera.cx, straight[1] - camera.cy
    disparity = plane.level + plane.slope_u * at + plane.slope_v * down
    reached = straight[0] - disparity - camera.disparity_offset - alignment.turn * down
    right_cx = camera.cx - camera.disparity_offset
    seen, _ = _seen(camera, right_cx, reached, straight[1], lenses.right)
    return (columns - seen - camera.disparity_offset).astype(np.float32)


def _straight(camera, cx, columns, rows, lens):
    straight = columns, rows
    for _ in range(20 if lens else 0):
        seen = _seen(camera, cx, *straight, lens)
        straight = straight[0] + columns - seen[0], straight[1] + rows - seen[1]
    return straight


def _seen(camera, cx, columns, rows, lens):
    x, y = (columns - cx) / camera.fx, (rows - camera.cy) / camera.fy
    seen = 1 + lens.stretch(x, y)
    return cx + x * seen * camera.fx, camera.cy + y * seen * camera.fy
