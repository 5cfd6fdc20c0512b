"""Rocks: outlined by the network, kept if they are too high for the rover."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.rocks.judgement import overruled_parts, too_high
from rover_obstacle_detection.detection.rocks.outline_features import outline_features
from rover_obstacle_detection.detection.rocks.outline_model import outline_model
from rover_obstacle_detection.detection.rocks.parameters import RockParameters
from rover_obstacle_detection.detection.rocks.standing import Standing
from rover_obstacle_detection.detection.rocks.windows import Window, windows_around
from rover_obstacle_detection.detection.stereo.matching import Stereo
from rover_obstacle_detection.detection.terrain.terrain import Terrain

Image = NDArray[np.float32]

Draw = Callable[[Stereo, Terrain, Standing, Window, RockParameters], Image]
"""Returns the probability that each pixel of a window is on an obstacle."""


@dataclass(frozen=True, eq=False)
class Rocks:
    """Obstacle pixels found by the network and the height limits.

    Parameters
    ----------
    high : ndarray of bool, shape (height, width)
        Rocks that are too high, or far away too large in the image.
    by_sight : ndarray of bool, shape (height, width)
        Rocks without 3D, judged by their looks and their size in the image.
    probability : ndarray of float32, shape (height, width)
        Network output; NaN where the network was not asked, 1 where it was overruled.
    """

    high: NDArray[np.bool_]
    by_sight: NDArray[np.bool_]
    probability: Image


def network_outlines(
    stereo: Stereo,
    terrain: Terrain,
    standing: Standing,
    window: Window,
    parameters: RockParameters,
) -> Image:
    """Ask the network for the probability that each pixel of a window is on an obstacle."""
    features = outline_features(stereo, terrain, standing, window, parameters)
    return outline_model().probability(features)


def outlined_rocks(
    stereo: Stereo,
    terrain: Terrain,
    standing: Standing,
    parameters: RockParameters,
    draw: Draw = network_outlines,
) -> Rocks:
    """Find rocks that are higher above the local ground than the rover can step.

    Matching blurs the rims of rocks, and their foot is no higher than the ground. The network sees
    height, noise and grey level together and draws the outlines. Metric limits decide which
    outlined parts are obstacles. What stands far above step and noise is an obstacle even if it is
    not outlined.

    Parameters
    ----------
    stereo : Stereo
    terrain : Terrain
    standing : Standing
        Where to look.
    parameters : RockParameters
    draw : callable
        Outlines of a window.
    """
    shape = stereo.disparity.shape
    found = Rocks(
        np.zeros(shape, np.bool_), np.zeros(shape, np.bool_), np.full(shape, np.nan, np.float32)
    )
    unmeasured = _unmeasured_ground(stereo, terrain, parameters)
    kernel = np.ones((parameters.unmeasured_px, parameters.unmeasured_px), np.uint8)
    wide = cv2.erode(unmeasured.astype(np.uint8), kernel) > 0
    for window in windows_around((standing.parts > 0) | wide):
        parts = Standing(standing.parts[window], standing.top_m)
        near = _scaled(stereo, terrain, unmeasured, window)
        probability = draw(stereo, terrain, standing, window, parameters)
        drawn = probability > parameters.outline_probability
        overruled = overruled_parts(drawn, near, parts, parameters)
        drawn |= overruled
        seen = found.probability[window]
        np.fmax(seen, np.where(overruled, 1, probability), out=seen)
        high, by_sight = too_high(drawn, probability, near, unmeasured[window], parameters)
        found.high[window] |= high
        found.by_sight[window] |= by_sight
    return found


def _unmeasured_ground(
    stereo: Stereo, terrain: Terrain, parameters: RockParameters
) -> NDArray[np.bool_]:
    """Pixels without 3D at which the ground plane lies within range."""
    nearest = stereo.frame.camera.disparity_at(parameters.max_range_m)
    unmeasured = ~terrain.measured & (stereo.expected > nearest)
    if stereo.frame.rover_mask is not None:
        unmeasured &= ~stereo.frame.rover_mask
    return np.asarray(unmeasured)


def _scaled(
    stereo: Stereo, terrain: Terrain, unmeasured: NDArray[np.bool_], window: Window
) -> Terrain:
    """Return the terrain of a window, with the scale of the ground plane where there is no 3D."""
    near = terrain.within(window)
    scale = near.pixels_per_metre.copy()
    missing = unmeasured[window]
    scale[missing] = stereo.expected[window][missing] / np.float32(stereo.frame.camera.baseline_m)
    return replace(near, pixels_per_metre=scale)
