"""A shadow cast into the view by something outside it, such as a cliff or a lander."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.simulation import streams
from rover_obstacle_detection.simulation.description import LightParameters
from rover_obstacle_detection.simulation.ground_mesh import GroundMesh

_HEIGHT_M = 12.0
"""Height of the plate: as high in the sky as the sun, and too high to dim the skylight."""
_SPOKES = 180


def shade_mesh(
    parameters: LightParameters, sun_direction: NDArray[np.float64], ground_m: float, seed: int
) -> GroundMesh | None:
    """Return a level plate whose shadow falls on the requested ground; None for no shadow.

    Parameters
    ----------
    parameters : LightParameters
    sun_direction : ndarray of float64, shape (3,)
        Unit vector towards the sun.
    ground_m : float
        Height of the ground in the shadow (m).
    seed : int
    """
    if not parameters.shade_m:
        return None
    rng = np.random.default_rng([seed, streams.SHADE])
    angle = np.linspace(0, 2 * math.pi, _SPOKES)
    outline = np.ones(_SPOKES)
    for number, phase in enumerate(rng.uniform(0, 2 * math.pi, 12), 2):
        outline += 0.28 / number * np.sin(number * angle + phase)
    radius = 0.5 * parameters.shade_m * np.stack([np.full(_SPOKES, 1e-3), outline])
    x = radius * np.cos(angle) + parameters.shade_ahead_m
    y = radius * np.sin(angle) + parameters.shade_left_m
    vertices = np.stack([x, y, np.full_like(x, ground_m)], 2)
    vertices = vertices + sun_direction * (_HEIGHT_M / sun_direction[2])
    return GroundMesh(vertices.astype(np.float32))
