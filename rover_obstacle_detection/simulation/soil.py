"""Soil texture: reflectance and fine relief of every ground texel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.simulation import streams
from rover_obstacle_detection.simulation.description import SoilParameters
from rover_obstacle_detection.simulation.ground_mesh import Fan
from rover_obstacle_detection.simulation.noise import Tile, fractal_tile
from rover_obstacle_detection.simulation.rock_shapes import RockTones
from rover_obstacle_detection.simulation.terrain import Terrain

Floats = NDArray[np.float32]


_ALONG_FACES = tuple(np.array([(1.0, 0.5), (0.5, -1.0), (-0.8, 0.7)], np.float32))
"""Shift of the texture along x and y per metre of height, for each scale of texture."""


@dataclass(frozen=True)
class Palette:
    """Linear RGB reflectances of one world."""

    soil: Floats
    dark_soil: Floats
    bedrock: Floats
    rocks: RockTones


def _rgb(*values: float | tuple[float, float, float]) -> Floats:
    return np.array(values, np.float32)


PALETTES = {
    'mars': Palette(
        soil=_rgb(0.36, 0.225, 0.13),
        dark_soil=_rgb(0.22, 0.155, 0.105),
        bedrock=_rgb(0.25, 0.18, 0.125),
        rocks=RockTones(
            tones=_rgb(
                (0.17, 0.14, 0.12),
                (0.22, 0.18, 0.15),
                (0.13, 0.115, 0.105),
                (0.26, 0.19, 0.14),
                (0.20, 0.185, 0.15),
                (0.30, 0.25, 0.20),
            ),
            dust=_rgb(0.36, 0.235, 0.145),
            dust_strength=1.0,
        ),
    ),
    'moon': Palette(
        soil=_rgb(0.135, 0.13, 0.12),
        dark_soil=_rgb(0.095, 0.092, 0.088),
        bedrock=_rgb(0.15, 0.147, 0.14),
        rocks=RockTones(
            tones=_rgb(
                (0.13, 0.127, 0.123),
                (0.16, 0.155, 0.15),
                (0.105, 0.104, 0.10),
                (0.19, 0.187, 0.18),
            ),
            dust=_rgb(0.135, 0.13, 0.12),
            dust_strength=1.1,
        ),
    ),
}


@dataclass(frozen=True)
class SoilTexture:
    """Texture of a `Fan`.

    Parameters
    ----------
    reflectance : ndarray of float32, shape (rows, columns, 3)
        Linear RGB.
    relief_m : ndarray of float32, shape (rows, columns)
        Height of the grain, which is finer than the mesh and used for shading only.
    """

    reflectance: Floats
    relief_m: Floats


class Soil:
    """Soil of a world, defined everywhere independently of the camera.

    Parameters
    ----------
    parameters : SoilParameters
    seed : int
    """

    def __init__(self, parameters: SoilParameters, seed: int) -> None:
        rng = np.random.default_rng([seed, streams.SOIL])
        self._parameters = parameters
        self._patch = fractal_tile(rng, 37.0, 9.0, 0.5, 1.7)
        self._mottle = fractal_tile(rng, 5.3, 0.7, 0.04, 1.3)
        self._crumb = fractal_tile(rng, 1.31, 0.09, 0.008, 1.0)
        self._grain = fractal_tile(rng, 0.61, 0.02, 0.0018, 0.5)
        rng = np.random.default_rng([seed, streams.SOIL_PATCHES])
        self._stains = fractal_tile(rng, 9.0, 1.6, 0.06, 1.9)
        # Patches cover the highest values of the noise.
        self._stain_level = float(np.quantile(self._stains.values, 1 - parameters.patch_cover))

    def texture(self, texels: Fan, terrain: Terrain) -> SoilTexture:
        """Return the texture of the texels of a fan."""
        p = self._parameters
        palette = PALETTES[p.world]
        x, y, texel = texels.x_m, texels.y_m, texels.cell_m
        patch = self._patch.linear(x, y)
        place = [(x, y)] * 3
        landforms = terrain.landforms
        z = landforms.height(x, y) if landforms.present else None
        if z is not None:
            # Seen from above, a steep face has no area: its height moves the texture along. Each
            # tile moves in another direction, since none suits faces of all directions.
            place = [((x + a * z), (y + b * z)) for a, b in _ALONG_FACES]
        mottle = _faded(self._mottle, 0.15, *place[0], texel)
        crumb = _faded(self._crumb, 0.03, *place[1], texel)
        grain = _faded(self._grain, 0.005, *place[2], texel)
        cloddy = terrain.cloddiness(x, y)
        # Single dark grains make the surface look like sand.
        specks = np.maximum(grain - 1.3, 0) * (0.5 + 0.5 * cloddy)
        tone = 0.08 * patch + 0.09 * mottle + 0.09 * crumb + 0.11 * grain * (0.7 + 0.3 * cloddy)
        tone = np.exp(p.contrast * (tone - 0.25 * specks))
        mix = np.clip(0.35 + 0.3 * patch + 0.12 * mottle, 0, 1) * min(p.contrast, 1.0)
        colour = palette.soil + (palette.dark_soil - palette.soil) * mix[..., np.newaxis]
        if z is not None:
            rock = landforms.bedrock(x, y)[..., np.newaxis]
            # Layers a few centimetres thick differ in tone.
            strata = self._mottle.linear((x / 9).astype(np.float32), (3 * z).astype(np.float32))
            strata = np.exp(0.16 * p.contrast * strata)
            colour = colour + (palette.bedrock * strata[..., np.newaxis] - colour) * rock
        if p.patch_cover:
            # Patches have sharp but irregular outlines.
            stain = self._stains.linear(x, y) + 0.15 * mottle - self._stain_level
            stained = np.clip(stain / 0.08 + 0.5, 0, 1)[..., np.newaxis]
            colour = colour * (1 + (p.patch_tone - 1) * stained)
        reflectance = np.clip(colour * tone[..., np.newaxis], 0.01, 0.9)
        relief = p.grain_m * (1.6 * crumb * cloddy + 0.55 * grain)
        return SoilTexture(reflectance.astype(np.float32), relief.astype(np.float32))


def _faded(tile: Tile, wavelength_m: float, x: Floats, y: Floats, texel_m: Floats) -> Floats:
    """Read a tile, fading it where texels are too large to resolve its wavelength."""
    fade = 1 / (1 + (2.0 * texel_m / wavelength_m) ** 3)
    needed = fade > 0.01
    result = np.zeros(x.shape, np.float32)
    if needed.any():
        result[needed] = fade[needed, np.newaxis] * tile.linear(x[needed], y[needed])
    return result
