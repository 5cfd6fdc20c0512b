"""What is measured of the ground in each cell of a map: its rise, and its depth below a rim."""

from __future__ import annotations

from dataclasses import dataclass

from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.terrain.gradient import Rise, ground_height, ground_rise
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.slope import Hollows, hollow_depth, level_heights
from rover_obstacle_detection.detection.terrain.terrain import Layer, Terrain


@dataclass(frozen=True, eq=False)
class CellEvidence:
    """A map and what is measured on it.

    Parameters
    ----------
    layer : Layer
    rise : Rise
    hollows : Hollows
    """

    layer: Layer
    rise: Rise
    hollows: Hollows


def cell_evidence(
    terrain: Terrain, ground: GroundPlane, parameters: TerrainParameters
) -> tuple[CellEvidence, ...]:
    """Measure each map of the terrain, nearest first.

    Parameters
    ----------
    terrain : Terrain
    ground : GroundPlane
        The plane, and the vertical.
    parameters : TerrainParameters
    """

    def measured(layer: Layer) -> CellEvidence:
        cell_m = layer.positions.cell_m
        height_m, noise_m = ground_height(layer, parameters)
        level_m = level_heights(height_m, cell_m, ground)
        depth_m = hollow_depth(level_m, layer.seen, cell_m, parameters)
        return CellEvidence(
            layer, ground_rise(layer, parameters), Hollows(level_m, depth_m, noise_m)
        )

    return tuple(measured(layer) for layer in terrain.layers)
