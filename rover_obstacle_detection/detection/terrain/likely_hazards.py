"""Ground that the network judges to be too steep or to drop away."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.network.tiles import tiles_around
from rover_obstacle_detection.detection.terrain.cell_evidence import CellEvidence
from rover_obstacle_detection.detection.terrain.cell_features import (
    TRAINED_SLOPES_DEG,
    TRAINED_STEPS_M,
    cell_features,
)
from rover_obstacle_detection.detection.terrain.elevation_map import Grid, cell_means
from rover_obstacle_detection.detection.terrain.hazard_model import (
    HazardProbability,
    hazard_model,
)
from rover_obstacle_detection.detection.terrain.hazards import quiet
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.slope import Hazard
from rover_obstacle_detection.detection.terrain.terrain import Layer, Terrain

Mask = NDArray[np.bool_]

_LEAST_STEP_M = 0.07
"""Least step for which the network may find hazards, metres. For 0.05 m, the least that it was
trained for, it took the troughs of one scene of dunes for drops."""


def likely_hazards(
    terrain: Terrain,
    cells: Sequence[CellEvidence],
    edges: Mask,
    ground: GroundPlane,
    parameters: TerrainParameters,
) -> HazardProbability:
    """Ask the network how likely the ground at each pixel is a hazard.

    Parameters
    ----------
    terrain : Terrain
    cells : sequence of CellEvidence
        Of its maps.
    edges : ndarray of bool, shape (height, width)
        Edges of brims.
    ground : GroundPlane
        The plane, and the vertical.
    parameters : TerrainParameters

    Returns
    -------
    HazardProbability
        Of each pixel, shape (height, width); 0 where nothing is measured.
    """
    model = hazard_model()
    found = HazardProbability(*(np.zeros_like(terrain.height_m) for _ in range(2)))
    for each in cells:
        brim = share_of_cells(edges, each.layer)
        features = cell_features(each.layer, each.rise, each.hollows, brim, ground, parameters)
        grids = HazardProbability(*(np.zeros(each.layer.seen.shape, np.float32) for _ in found))
        for tile in tiles_around(asked_cells(each.layer)):
            inner = tile.in_outer(tile.inner)
            for grid, part in zip(
                grids, model.probability(features[(slice(None), *tile.outer)]), strict=True
            ):
                grid[tile.inner] = part[inner]
        # The network was not trained on what is between the cells that are seen.
        seen = each.layer.seen.astype(np.float32)
        share = np.maximum(each.layer.sampled(seen), np.float32(1e-3))
        for image, grid in zip(found, grids, strict=True):
            each.layer.fill(image, each.layer.sampled(grid * seen) / share)
    return found


def asked_cells(layer: Layer) -> Mask:
    """Mark the cells that are sampled for the pixels within a layer's span."""
    first, last, _, _ = cv2.minMaxLoc(layer.positions.row, layer.pixels.view(np.uint8))
    asked = cv2.dilate(layer.seen.view(np.uint8), np.ones((3, 3), np.uint8)) > 0
    asked[: max(math.floor(first), 0)] = False
    asked[math.ceil(last) + 1 :] = False
    return np.asarray(asked)


def judged_ground(
    likely: HazardProbability | None,
    steep: Hazard,
    dropped: Hazard,
    sparse: Mask,
    terrain: Terrain,
    parameters: TerrainParameters,
) -> tuple[Hazard, Hazard]:
    """Let the network find slopes and drops besides those measured, and rule some of those out.

    What it takes for a hazard counts where both images support most of the matches; elsewhere,
    false matches look like relief. What is measured to be a hazard counts unless the network
    rules it out, and is never free. For rovers with limits that the network does not know well,
    it only makes less ground free.

    Parameters
    ----------
    likely : HazardProbability, optional
        Without it, only what is measured counts.
    steep, dropped : Hazard
        What is measured to be a hazard, and what may be one.
    sparse : ndarray of bool, shape (height, width)
        Areas where too few matches are supported.
    terrain : Terrain
    parameters : TerrainParameters

    Returns
    -------
    slopes, drops : Hazard
    """
    p = parameters
    if likely is None:
        return steep, dropped
    probability = likely.slope + likely.drop
    # What is not a number is not ruled out.
    possible = ~(probability <= p.free_hazard_probability)
    if not is_known_well(p):
        return steep._replace(possible=steep.possible | possible), dropped
    found = (probability > p.hazard_probability) & ~sparse & quiet(terrain, p)
    is_slope = likely.slope >= likely.drop
    return (
        Hazard((steep.found & possible) | (found & is_slope), steep.possible | possible),
        Hazard((dropped.found & possible) | (found & ~is_slope), dropped.possible),
    )


def is_known_well(parameters: TerrainParameters) -> bool:
    """Whether the network may find and rule out hazards for a rover with such limits."""
    (least_deg, most_deg), (_, most_m) = TRAINED_SLOPES_DEG, TRAINED_STEPS_M
    return (
        _LEAST_STEP_M <= parameters.max_step_m <= most_m
        and least_deg <= parameters.max_slope_deg <= most_deg
    )


def share_of_cells(mask: Mask, layer: Layer) -> Grid:
    """Share of the pixels of each cell that are marked in the image."""
    marked = mask[layer.rows]
    if not marked.any():
        return np.zeros(layer.positions.shape, np.float32)
    inside = layer.positions.inside.astype(np.float32)
    share, _ = cell_means(marked.astype(np.float32), inside, layer.positions)
    return share
