"""Periodic fractal noise for terrain and textures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

_CHUNK = 1 << 18
"""Positions read at a time, which bounds memory."""


@dataclass(frozen=True)
class Tile:
    """Periodic 2D noise with zero mean and unit RMS, defined on the whole plane.

    Parameters
    ----------
    values : ndarray of float32, shape (n, n)
    period_m : float
        Period along both axes of the tile, metres.
    rotation_rad : float
        Rotation of the tile's axes, so that summed tiles repeat along different lines.
    """

    values: Floats
    period_m: float
    rotation_rad: float = 0.0

    def smooth(self, x_m: Floats, y_m: Floats) -> Floats:
        """Interpolate with a cubic B-spline (twice differentiable), for surfaces.

        Parameters
        ----------
        x_m, y_m : ndarray of float32, any one shape

        Returns
        -------
        ndarray of float32, the same shape
        """
        return self._read(x_m, y_m, cubic=True)

    def linear(self, x_m: Floats, y_m: Floats) -> Floats:
        """Interpolate bilinearly, for textures; four times faster than `smooth`."""
        return self._read(x_m, y_m, cubic=False)

    def _read(self, x_m: Floats, y_m: Floats, *, cubic: bool) -> Floats:
        x_flat, y_flat = np.ravel(x_m), np.ravel(y_m)
        result = np.empty(x_flat.shape, np.float32)
        size = self.values.shape[0]
        padded = np.pad(self.values, ((1, 2), (1, 2)), mode='wrap').ravel()
        cosine, sine = np.cos(self.rotation_rad), np.sin(self.rotation_rad)
        scale = size / self.period_m
        for start in range(0, x_flat.size, _CHUNK):
            part = slice(start, start + _CHUNK)
            column = (cosine * x_flat[part] + sine * y_flat[part]) * scale
            row = (cosine * y_flat[part] - sine * x_flat[part]) * scale
            whole_column, whole_row = np.floor(column), np.floor(row)
            base = (whole_row.astype(np.int64) % size) * (size + 3) + (
                whole_column.astype(np.int64) % size
            )
            column_weights = _weights((column - whole_column).astype(np.float32), cubic)
            row_weights = _weights((row - whole_row).astype(np.float32), cubic)
            first = 0 if cubic else 1
            total = np.zeros(base.shape, np.float32)
            for i, row_weight in enumerate(row_weights, first):
                line = np.zeros(base.shape, np.float32)
                for j, column_weight in enumerate(column_weights, first):
                    line += column_weight * padded.take(base + (i * (size + 3) + j))
                total += row_weight * line
            result[part] = total
        return result.reshape(np.shape(x_m))


def _weights(fraction: Floats, cubic: bool) -> tuple[Floats, ...]:
    """Return the weights of two (linear) or four (cubic B-spline) neighbouring samples."""
    if not cubic:
        return 1 - fraction, fraction
    rest = 1 - fraction
    square, cube = fraction * fraction, fraction * fraction * fraction
    sixth = np.float32(1 / 6)
    return (
        rest * rest * rest * sixth,
        (3 * cube - 6 * square + 4) * sixth,
        (-3 * cube + 3 * square + 3 * fraction + 1) * sixth,
        cube * sixth,
    )


def fractal_tile(
    rng: np.random.Generator,
    period_m: float,
    longest_m: float,
    shortest_m: float,
    exponent: float = 1.8,
    size: int = 512,
) -> Tile:
    """Synthesise a tile with an amplitude spectrum of frequency to the power -`exponent`.

    Parameters
    ----------
    rng : numpy.random.Generator
    period_m : float
        Side length, metres.
    longest_m, shortest_m : float
        Range of wavelengths, metres, with a smooth roll-off at both ends.
    exponent : float
        About 1.8 to 2.2 for eroded ground, 0 to 1 for grain.
    size : int
        Samples per side.
    """
    noise = rng.standard_normal((size, size)).astype(np.float32)
    frequency = np.hypot(
        np.fft.fftfreq(size, period_m / size)[:, np.newaxis],
        np.fft.rfftfreq(size, period_m / size)[np.newaxis],
    )
    frequency[0, 0] = 1.0
    amplitude = frequency**-exponent
    amplitude *= np.exp(-((1 / (longest_m * frequency)) ** 4))
    amplitude *= np.exp(-((shortest_m * frequency) ** 4))
    amplitude[0, 0] = 0.0
    values = np.fft.irfft2(np.fft.rfft2(noise) * amplitude, s=(size, size))
    return Tile(
        (values / values.std()).astype(np.float32), period_m, float(rng.uniform(0, 2 * np.pi))
    )


@dataclass(frozen=True)
class SolidNoise:
    """Periodic 3D noise, for the shape and the texture of rocks."""

    values: Floats

    def read(self, points: Floats) -> Floats:
        """Interpolate trilinearly at points in units of the period, shape (..., 3)."""
        size = self.values.shape[0]
        scaled = points * np.float32(size)
        whole = np.floor(scaled)
        fraction = scaled - whole
        index = whole.astype(np.int64)
        total = np.zeros(points.shape[:-1], np.float32)
        for corner in range(8):
            offset = (corner & 1, corner >> 1 & 1, corner >> 2)
            weight = np.ones(points.shape[:-1], np.float32)
            flat = np.zeros(points.shape[:-1], np.int64)
            for axis in range(3):
                part = fraction[..., axis]
                weight *= part if offset[axis] else 1 - part
                flat = flat * size + (index[..., axis] + offset[axis]) % size
            total += weight * self.values.ravel().take(flat)
        return total


def solid_noise(rng: np.random.Generator, exponent: float = 1.5, size: int = 64) -> SolidNoise:
    """Synthesise periodic 3D noise with zero mean and unit RMS."""
    noise = rng.standard_normal((size, size, size)).astype(np.float32)
    axis, half = np.fft.fftfreq(size, 1 / size), np.fft.rfftfreq(size, 1 / size)
    frequency = np.sqrt(axis[:, np.newaxis, np.newaxis] ** 2 + axis[:, np.newaxis] ** 2 + half**2)
    frequency[0, 0, 0] = 1.0
    amplitude = frequency ** -(exponent + 0.5)
    amplitude[0, 0, 0] = 0.0
    values = np.fft.irfftn(np.fft.rfftn(noise) * amplitude, s=(size, size, size), axes=(0, 1, 2))
    return SolidNoise((values / values.std()).astype(np.float32))
