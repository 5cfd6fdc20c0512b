"""Rocks: outlined by the network, kept if they are too high for the rover."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.images.components import components, marked
from rover_obstacle_detection.detection.network.tiles import Window, tiles_around
from rover_obstacle_detection.detection.rocks.judgement import overruled_parts, too_high
from rover_obstacle_detection.detection.rocks.outline_features import outline_features
from rover_obstacle_detection.detection.rocks.outline_model import outline_model
from rover_obstacle_detection.detection.rocks.parameters import RockParameters
from rover_obstacle_detection.detection.rocks.standing import Standing
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
    probability : ndarray of float32, shape (height, width)
        Network output; NaN where the network was not asked, 1 where it was overruled.
    """

    high: NDArray[np.bool_]
    probability: Image

    def possible(self, parameters: RockParameters) -> NDArray[np.bool_]:
        """Mark the pixels that the network does not rule out."""
        with np.errstate(invalid='ignore'):
            return np.asarray(self.probability >= parameters.free_probability)


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
    where = _with_dark_sides(stereo, terrain, standing, parameters)
    # Outlines reach a few pixels farther. Some reach more, so that all of a tile counts.
    reach = np.ones((2 * parameters.outline_reach_px + 1,) * 2, np.uint8)
    asked = cv2.dilate(where.view(np.uint8), reach) > 0
    probability = np.full(where.shape, np.nan, np.float32)
    for tile in tiles_around(asked):
        drawn = draw(stereo, terrain, standing, tile.outer, parameters)
        probability[tile.inner] = drawn[tile.in_outer(tile.inner)]
    outlined = np.nan_to_num(probability) > parameters.outline_probability
    overruled = overruled_parts(outlined, terrain, standing, parameters)
    high = too_high(outlined | overruled, np.nan_to_num(probability), terrain, parameters)
    probability[overruled] = 1
    return Rocks(high, probability)


def _with_dark_sides(
    stereo: Stereo, terrain: Terrain, standing: Standing, parameters: RockParameters
) -> NDArray[np.bool_]:
    """Mark what stands up, with the areas without 3D beside it: shadowed sides of rocks."""
    nearest = stereo.frame.camera.disparity_at(parameters.max_range_m)
    unmeasured = ~terrain.measured & (stereo.expected > nearest)
    kernel = np.ones((parameters.unmeasured_px, parameters.unmeasured_px), np.uint8)
    stands = (standing.parts > 0).astype(np.uint8)
    areas = cv2.morphologyEx(unmeasured.view(np.uint8), cv2.MORPH_OPEN, kernel)
    # A rim of a pixel or two between both belongs to neither.
    where = cv2.dilate(cv2.bitwise_or(areas, stands), np.ones((5, 5), np.uint8)) > 0
    where &= cv2.dilate(stands, np.ones((2 * parameters.dark_side_px + 1,) * 2, np.uint8)) > 0
    pixels, owner, count = components(where)
    beside = np.zeros(count, np.bool_)
    beside[owner[stands.ravel()[pixels] > 0]] = True
    return marked(where.shape, pixels[beside[owner]])
