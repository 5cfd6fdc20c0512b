"""What can go wrong with a view: its images, or what the detector is told of the camera.

Every function returns a new `View`. The truth about the left image stays, or moves along with the
image. Where the pair says nothing about a part of the left image, that part becomes ``blind``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.evaluation.blind import degradations
from rover_obstacle_detection.evaluation.blind.view import Grey, View, exchanged, rotated_by_180
from rover_obstacle_detection.evaluation.vertical import angles_deg

# Seed of the noise of the right image; the left one has 0.
_RIGHT = 1


def both_flat(view: View, level: float, sigma: float = 0.0) -> View:
    """Give both images one grey level and independent noise."""
    shape = view.left.shape
    return replace(
        view,
        left=degradations.flat(shape, level, sigma),
        right=degradations.flat(shape, level, sigma, _RIGHT),
        blind=_everywhere(view),
    )


def right_flat(view: View, level: float, sigma: float = 0.0) -> View:
    """Give the right image one grey level and noise."""
    right = degradations.flat(view.right.shape, level, sigma, _RIGHT)
    return replace(view, right=right, blind=_everywhere(view))


def same_image(view: View, source: str, sigma: float = 0.0) -> View:
    """Use one image, ``left`` or ``right``, for both; each copy has noise of its own."""
    image = view.left if source == 'left' else view.right
    labels, depth_m = view.labels, view.depth_m
    if source == 'right':
        moved = exchanged(view)
        labels, depth_m = moved.labels, moved.depth_m
    return replace(
        view,
        left=degradations.noisy(image, sigma),
        right=degradations.noisy(image, sigma, _RIGHT),
        labels=labels,
        depth_m=depth_m,
        blind=_everywhere(view),
    )


def other_moment(view: View) -> View:
    """Take the right image of another place."""
    return replace(view, right=view.other, blind=_everywhere(view))


def mirrored_left(view: View) -> View:
    """Take the left image, mirrored, as the right one."""
    mirrored = np.ascontiguousarray(view.left[:, ::-1])
    return replace(view, right=mirrored, blind=_everywhere(view))


def moved_on(view: View, factor: float) -> View:
    """Enlarge the right image, as if it had been taken after the rover moved forward."""
    return replace(view, right=degradations.zoomed(view.right, factor))


def torn_right(view: View, share: float) -> View:
    """Take the lower rows of the right image from another moment."""
    rows = _lower_rows(view, share)
    return replace(view, right=np.where(rows, view.other, view.right), blind=rows)


def rows_lost(view: View, share: float) -> View:
    """Blacken a strip of rows in the middle of the right image."""
    height = view.right.shape[0]
    distance = np.abs(np.arange(height) - (height - 1) / 2)
    rows = np.repeat((distance < share * height / 2)[:, np.newaxis], view.right.shape[1], axis=1)
    return replace(view, right=np.where(rows, 0, view.right).astype(np.uint8), blind=rows)


def defocused(view: View, sides: str, sigma_px: float) -> View:
    """Put the lenses named in `sides` (``left``, ``right``, ``both``) out of focus."""
    return _sides(view, sides, degradations.blurred, sigma_px)


def smeared(view: View, sides: str, length_px: int) -> View:
    """Smear the images named in `sides` along the rows."""
    return _sides(view, sides, degradations.motion_blurred, length_px)


def covered_left(view: View, share: float) -> View:
    """Cover the right-hand part of the left image, which the right camera sees as well."""
    columns = np.arange(view.left.shape[1]) >= (1 - share) * view.left.shape[1]
    area = np.repeat(columns[np.newaxis], view.left.shape[0], axis=0)
    return replace(view, left=degradations.covered(view.left, area), blind=area)


def dirty_left(view: View, share: float) -> View:
    """Put blobs of dirt on the left lens."""
    height, width = view.left.shape
    opacity = degradations.dirt((height, width), share)
    left = degradations.dirty(view.left, opacity)
    return replace(view, left=left, blind=opacity > 0.9)


def over_exposed(view: View, gain: float) -> View:
    """Over-expose both images."""
    left, right = (degradations.over_exposed(image, gain) for image in (view.left, view.right))
    return replace(view, left=left, right=right, blind=degradations.featureless(left == 255))


def under_exposed(view: View, gain: float) -> View:
    """Under-expose both images."""
    changed = _sides(view, 'both', degradations.under_exposed, gain)
    return replace(changed, blind=degradations.featureless(changed.left == 0))


def foggy(view: View, contrast: float) -> View:
    """Take the contrast out of both images."""
    return _sides(view, 'both', degradations.foggy, contrast)


def noisy(view: View, sigma: float) -> View:
    """Add noise to both images."""
    return _sides(view, 'both', degradations.noisy, sigma)


def jpeg(view: View, quality: int) -> View:
    """Compress both images."""
    left, right = (degradations.as_jpeg(image, quality) for image in (view.left, view.right))
    return replace(view, left=left, right=right)


def shifted_right_image(view: View, columns: int = 0, rows: int = 0) -> View:
    """Move the content of the right image right and down."""
    return replace(view, right=degradations.shifted(view.right, columns, rows))


def wrong_principal_point(view: View, offset_px: float) -> View:
    """Tell a principal point of the right camera that is too far right by this much."""
    assert view.camera.cx_right is not None
    told = replace(view.camera, cx_right=view.camera.cx_right + offset_px)
    return replace(view, camera=told)


def wrong_baseline(view: View, factor: float) -> View:
    """Tell a baseline that is wrong by a factor, as with millimetres for metres."""
    return replace(view, camera=replace(view.camera, baseline_m=factor * view.camera.baseline_m))


def wrong_focal_length(view: View, factor: float) -> View:
    """Tell a focal length that is wrong by a factor."""
    camera = view.camera
    return replace(view, camera=replace(camera, fx=factor * camera.fx, fy=factor * camera.fy))


def upside_down(view: View) -> View:
    """Mount the camera upside down and exchange the images, so that disparities stay positive."""
    turned = rotated_by_180(exchanged(view))
    camera = turned.camera
    assert camera.cx_right is not None
    return replace(turned, camera=replace(camera, cx=camera.cx_right, cx_right=camera.cx))


def right_upside_down(view: View) -> View:
    """Turn the right image only."""
    right = np.ascontiguousarray(view.right[::-1, ::-1])
    return replace(view, right=right, blind=_everywhere(view))


def told_vertical(
    view: View, pitch_error_deg: float = 0.0, roll_error_deg: float = 0.0
) -> View | None:
    """Tell the vertical, off by these angles; None where the true one is not known."""
    if view.up is None:
        return None
    pitch_deg, roll_deg = angles_deg(view.up.up)
    told = Gravity.from_angles(pitch_deg + pitch_error_deg, roll_deg + roll_error_deg)
    return replace(view, told_gravity=told)


def told_level(view: View) -> View:
    """Tell a camera pitch and roll of 0."""
    return replace(view, told_gravity=Gravity.from_angles(0.0))


def _sides(view: View, sides: str, damage: Callable[..., Grey], strength: float) -> View:
    left, right = view.left, view.right
    if sides in ('left', 'both'):
        left = damage(left, strength, seed=0)
    if sides in ('right', 'both'):
        right = damage(right, strength, seed=_RIGHT)
    return replace(view, left=left, right=right)


def _everywhere(view: View) -> NDArray[np.bool_]:
    return np.ones(view.left.shape, np.bool_)


def _lower_rows(view: View, share: float) -> NDArray[np.bool_]:
    height, width = view.right.shape
    rows = np.arange(height) >= (1 - share) * height
    return np.repeat(rows[:, np.newaxis], width, axis=1)
