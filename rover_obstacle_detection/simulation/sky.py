"""Sun and sky."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.simulation.description import LightParameters

Floats = NDArray[np.float32]

_SUN = np.array([1.0, 0.93, 0.84])
_DUST = np.array([0.80, 0.60, 0.42])
_HALO = np.array([0.85, 0.80, 0.78])
_EXTINCTION = np.array([0.035, 0.05, 0.075])
"""Optical depth of the dust at the zenith, in RGB."""
_OVERHEAD = 3.0
"""Irradiance of the sun at the zenith, in arbitrary units."""
_BELOW_HORIZON = 0.12
"""Brightness of the ground beyond the meshes, relative to its irradiance."""


@dataclass(frozen=True)
class Light:
    """Light sources of a scene.

    Parameters
    ----------
    sun_direction : ndarray of float64, shape (3,)
        Unit vector towards the sun, in world coordinates.
    sun_irradiance : ndarray of float64, shape (3,)
        RGB irradiance of a surface facing the sun.
    sky : ndarray of float32, shape (rows, columns, 3), or None
        RGB radiance. Rows run from zenith to nadir, columns anticlockwise from x. None for a
        black sky.
    """

    sun_direction: NDArray[np.float64]
    sun_irradiance: NDArray[np.float64]
    sky: Floats | None


def make_light(parameters: LightParameters, world: str) -> Light:
    """Return the light of a world. Azimuths are relative to the first heading."""
    elevation = math.radians(parameters.sun_elevation_deg)
    azimuth = math.radians(parameters.sun_azimuth_deg)
    sun = np.array(
        [
            math.cos(elevation) * math.cos(azimuth),
            math.cos(elevation) * math.sin(azimuth),
            math.sin(elevation),
        ]
    )
    if world == 'moon' or parameters.sky == 0:
        return Light(sun, _OVERHEAD * np.ones(3), None)
    # The path through the dust is longer for a low sun, which dims and reddens it.
    air = min(1 / math.sin(elevation), 8.0)
    irradiance = _OVERHEAD * _SUN * np.exp(-_EXTINCTION * (air - 1))
    brightness = parameters.sky * _OVERHEAD * (0.1 + 0.9 * math.sin(elevation))
    return Light(sun, irradiance, _sky(sun, brightness))


def through_haze(radiance: Floats, depth_m: Floats, light: Light, haze_m: float) -> Floats:
    """Blend distant surfaces into the haze. The sky stays unchanged.

    Parameters
    ----------
    radiance : ndarray of float32, shape (height, width, 3)
    depth_m : ndarray of float32, shape (height, width)
        NaN where there is no surface.
    light : Light
    haze_m : float
        Distance at which contrast falls to 1/e.
    """
    if light.sky is None:
        return radiance
    rows = light.sky.shape[0]
    horizon = light.sky[rows // 2 - 2 : rows // 2].mean((0, 1))
    left = np.exp(-np.nan_to_num(depth_m, nan=0.0) / np.float32(haze_m))[..., np.newaxis]
    return np.asarray(radiance * left + horizon * (1 - left), np.float32)


def _sky(sun: NDArray[np.float64], irradiance: float) -> Floats:
    """Return a dusty sky that gives level ground the requested irradiance."""
    rows, columns = 128, 256
    elevation = math.pi / 2 - (np.arange(rows) + 0.5) * math.pi / rows
    azimuth = (np.arange(columns) + 0.5) * 2 * math.pi / columns
    cosine = (
        np.cos(elevation)[:, np.newaxis] * (sun[0] * np.cos(azimuth) + sun[1] * np.sin(azimuth))
        + (sun[2] * np.sin(elevation))[:, np.newaxis]
    )
    # Dust scatters forward, so there is a halo around the sun and a bright horizon.
    halo = 1.3 * np.exp(-(1 - cosine) / 0.05) + 0.7 * np.exp(-(1 - cosine) / 0.35)
    horizon = 0.55 + 0.45 * np.exp(-np.abs(np.sin(elevation)) / 0.25)[:, np.newaxis]
    radiance = (horizon * np.ones_like(cosine))[..., np.newaxis] * _DUST
    radiance = radiance + halo[..., np.newaxis] * _HALO
    below = elevation < 0
    radiance[below] = _BELOW_HORIZON * _DUST
    weight = np.maximum(np.sin(elevation), 0) * np.cos(elevation)
    cell = (math.pi / rows) * (2 * math.pi / columns)
    on_ground = (radiance.mean(2).sum(1) * weight).sum() * cell
    radiance[~below] *= irradiance / on_ground
    radiance[below] *= irradiance / math.pi
    return np.asarray(radiance, np.float32)
