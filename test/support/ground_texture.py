"""Procedural textures of the ray-cast scenes: weathered ground, and slabs with joints."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

TEXEL_M = 0.002
COARSE_TEXEL_M = 0.008
SIDE = 1024
LEVELS = 6
# Longest wave of the fine texture, texels: without long waves its repetition does not show.
LONGEST = 80.0
# The axes are turned so that no row of the ground shows the same twice.
TURN = np.array([[np.cos(0.47), -np.sin(0.47)], [np.sin(0.47), np.cos(0.47)]], np.float32)


def weathered(u: np.ndarray, v: np.ndarray, footprint_m: np.ndarray) -> np.ndarray:
    """Sample noise of all octaves from 4 mm to 4 m, mean 0 and standard deviation 1.

    ``u`` and ``v`` are metres on the surface. Details finer than the footprint of a pixel are
    averaged out.
    """
    along = TURN[0, 0] * u + TURN[0, 1] * v
    across = TURN[1, 0] * u + TURN[1, 1] * v
    fine = _sample(_pyramid(LONGEST), along, across, footprint_m, TEXEL_M)
    coarse = _sample(_pyramid(SIDE / 2), across, along, footprint_m, COARSE_TEXEL_M)
    return 0.6 * fine + 0.8 * coarse


def _sample(pyramid, x_m, y_m, footprint_m, texel_m):
    level = np.log2(np.maximum(footprint_m, texel_m) / np.float32(texel_m))
    level = np.minimum(level, LEVELS - 1)
    total = np.zeros(x_m.shape, np.float32)
    for number, image in enumerate(pyramid):
        share = 1 - np.abs(level - np.float32(number))
        rows = np.flatnonzero((share > 0).any(axis=1))
        if not rows.size:
            continue
        part = np.s_[rows[0] : rows[-1] + 1]
        scale, side = np.float32(1 / (texel_m * 2**number)), image.shape[0]
        # Texel centres of a coarser level lie between those of the finer one.
        offset = np.float32(0.5 - 0.5 / 2**number)
        x, y = (np.mod(each[part] * scale - offset, side) for each in (x_m, y_m))
        texture = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        total[part] += np.maximum(share[part], 0) * texture
    return total


def tiles(u, v, footprint_m, tile_m, joint_m) -> np.ndarray:
    """Light of slabs of side ``tile_m`` (0: none), dark in the joints, averaged over a pixel."""
    light = np.ones(u.shape, np.float32)
    tiled = tile_m > 0
    side, joint, pixel = tile_m[tiled], joint_m[tiled], footprint_m[tiled]
    for place in (u[tiled], v[tiled]):
        from_joint = np.abs(np.mod(place / side + 0.5, 1) - 0.5) * side
        cover = np.clip((joint + pixel) / 2 - from_joint, 0, np.minimum(joint, pixel)) / pixel
        light[tiled] *= 1 - np.float32(0.55) * cover
    return light


@cache
def _pyramid(longest: float) -> tuple[np.ndarray, ...]:
    """Periodic noise whose octaves have equal strength, and its averages over 2, 4, ... texels."""
    rows, columns = np.fft.fftfreq(SIDE)[:, np.newaxis], np.fft.rfftfreq(SIDE)[np.newaxis]
    frequency = np.hypot(rows, columns)
    frequency[0, 0] = np.inf
    strength = (frequency > 1 / longest) / frequency
    white = np.random.default_rng(5).standard_normal((SIDE, SIDE), np.float32)
    image = np.fft.irfft2(np.fft.rfft2(white) * strength, s=(SIDE, SIDE))
    levels = [(image / image.std()).astype(np.float32)]
    for _ in range(1, LEVELS):
        levels.append(cv2.resize(levels[-1], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
    return tuple(levels)
