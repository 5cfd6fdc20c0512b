"""From light to images: lens, exposure, noise, bits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.simulation.description import SensorParameters

Floats = NDArray[np.float32]

_GAMMA = 1 / 2.2
# The automatic exposure puts all but the brightest twentieth of the ground under this level.
_BRIGHT_LEVEL = 0.42
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)


@dataclass(frozen=True)
class Exposure:
    """Gain from radiance to full scale, the same for both eyes before mismatch."""

    gain: float


def automatic_exposure(radiance: Floats, on_surface: NDArray[np.bool_]) -> Exposure:
    """Expose for the ground in view.

    Parameters
    ----------
    radiance : ndarray of float32, shape (height, width, 3)
    on_surface : ndarray of bool, shape (height, width)
        Where there is no sky.
    """
    luminance = radiance @ _LUMINANCE
    seen = luminance[on_surface] if on_surface.any() else luminance.ravel()
    bright = float(np.percentile(seen, 95))
    return Exposure(_BRIGHT_LEVEL / max(bright, 1e-9))


def develop(
    radiance: Floats,
    parameters: SensorParameters,
    exposure: Exposure,
    rng: np.random.Generator,
    *,
    gain: float = 1.0,
    colour: bool = False,
) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Take a picture.

    Parameters
    ----------
    radiance : ndarray of float32, shape (height, width, 3)
        Linear red, green, blue.
    parameters : SensorParameters
    exposure : Exposure
    rng : numpy.random.Generator
        For noise and dust; each eye needs its own.
    gain : float
        Of this eye, on top of the exposure.
    colour : bool
        Whether to keep red, green and blue.

    Returns
    -------
    ndarray of uint8, or uint16 above 8 bits
        Shape (height, width), or (height, width, 3) in colour.
    """
    light = radiance if colour else (radiance @ _LUMINANCE)[..., np.newaxis]
    light = _through_lens(light, parameters, rng)
    signal = light * np.float32(exposure.gain * parameters.exposure * gain)
    electrons = np.maximum(signal, 0) * parameters.full_well
    noise = rng.standard_normal(electrons.shape, np.float32)
    noisy = electrons + noise * np.sqrt(electrons + parameters.read_noise**2)
    # The eye's response, after the sensor has clipped.
    level = np.clip(noisy / parameters.full_well, 0, 1) ** np.float32(_GAMMA)
    top = (1 << parameters.bits) - 1
    kind = np.uint8 if parameters.bits == 8 else np.uint16
    image = np.rint(level * top).astype(kind)
    picture: NDArray[np.uint8] | NDArray[np.uint16] = image if colour else image[..., 0]
    return picture


def _through_lens(light: Floats, parameters: SensorParameters, rng: np.random.Generator) -> Floats:
    height, width = light.shape[:2]
    if parameters.motion_blur_px:
        kernel = _motion_kernel(parameters.motion_blur_px, parameters.motion_blur_deg)
        light = _filtered(light, kernel)
    if parameters.blur_px:
        blurred = cv2.GaussianBlur(
            light, (0, 0), parameters.blur_px, borderType=cv2.BORDER_REPLICATE
        )
        light = blurred.reshape(light.shape).astype(np.float32)
    y = (np.arange(height, dtype=np.float32) - (height - 1) / 2)[:, np.newaxis]
    x = (np.arange(width, dtype=np.float32) - (width - 1) / 2)[np.newaxis]
    square = (x * x + y * y) / ((width * width + height * height) / 4)
    passed = 1 - np.float32(parameters.vignetting) * square
    for _ in range(parameters.dust_spots):
        radius = float(np.exp(rng.uniform(math.log(0.004), math.log(0.03)))) * width
        centre_x, centre_y = (
            rng.uniform(-width / 2, width / 2),
            rng.uniform(-height / 2, height / 2),
        )
        depth = rng.uniform(0.15, 0.5)
        distance = ((x - centre_x) ** 2 + (y - centre_y) ** 2) / radius**2
        passed = passed * (1 - depth * np.exp(-(distance**2)))
    light = light * passed[..., np.newaxis].astype(np.float32)
    if parameters.glare:
        light = light + np.float32(parameters.glare) * light.mean((0, 1), keepdims=True)
    return np.asarray(light, np.float32)


def _motion_kernel(length_px: float, direction_deg: float) -> Floats:
    reach = math.ceil(length_px / 2) + 1
    size = 2 * reach + 1
    kernel = np.zeros((size, size), np.float32)
    steps = np.linspace(-length_px / 2, length_px / 2, max(3, round(8 * length_px)))
    angle = math.radians(direction_deg)
    for step in steps:
        x, y = reach + step * math.cos(angle), reach + step * math.sin(angle)
        column, row = int(x), int(y)
        for i, j, weight in (
            (0, 0, (1 - (y - row)) * (1 - (x - column))),
            (0, 1, (1 - (y - row)) * (x - column)),
            (1, 0, (y - row) * (1 - (x - column))),
            (1, 1, (y - row) * (x - column)),
        ):
            kernel[row + i, column + j] += weight
    return np.asarray(kernel / kernel.sum(), np.float32)


def _filtered(light: Floats, kernel: Floats) -> Floats:
    result = cv2.filter2D(light, -1, kernel, borderType=cv2.BORDER_REPLICATE)
    return result.reshape(light.shape).astype(np.float32)
