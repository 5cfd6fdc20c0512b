"""Sensor model: lens, exposure, noise, quantisation."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.simulation.description import SensorParameters

Floats = NDArray[np.float32]

_BRIGHT_LEVEL = 0.42
"""Automatic exposure maps the 95th percentile of the ground to this fraction of full scale."""
_SHARPENING_PX = 1.0
"""Standard deviation of the blur that sharpening subtracts."""
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Weights of linear RGB (ITU-R BT.709)."""


def automatic_exposure(radiance: Floats, on_surface: NDArray[np.bool_]) -> float:
    """Return the gain from radiance to full scale that exposes for the ground in view.

    Parameters
    ----------
    radiance : ndarray of float32, shape (height, width, 3)
    on_surface : ndarray of bool, shape (height, width)
        False for sky. If there is no surface, the whole image counts.
    """
    luminance = radiance @ _LUMINANCE
    seen = luminance[on_surface] if on_surface.any() else luminance.ravel()
    bright = float(np.percentile(seen, 95))
    return _BRIGHT_LEVEL / max(bright, 1e-9)


def develop(
    radiance: Floats,
    parameters: SensorParameters,
    exposure: float,
    rng: np.random.Generator,
    *,
    gain: float = 1.0,
    blur_px: float = 0.0,
    colour: bool = False,
) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Turn light into an image.

    Parameters
    ----------
    radiance : ndarray of float32, shape (height, width, 3)
        Linear RGB.
    parameters : SensorParameters
    exposure : float
        Gain from radiance to full scale.
    rng : numpy.random.Generator
        Source of noise and dust. Each camera needs its own.
    gain : float
        Additional gain of this camera.
    blur_px : float
        Additional blur of this camera's lens (standard deviation).
    colour : bool
        Whether to return RGB instead of luminance.

    Returns
    -------
    ndarray of uint8, or uint16 above 8 bits
        Shape (height, width), or (height, width, 3) in colour.
    """
    light = radiance if colour else (radiance @ _LUMINANCE)[..., np.newaxis]
    if blur_px:
        light = _blurred(light, blur_px)
    light = _through_lens(light, parameters, rng)
    signal = light * np.float32(exposure * parameters.exposure * gain)
    electrons = np.maximum(signal, 0) * parameters.full_well
    noise = rng.standard_normal(electrons.shape, np.float32)
    noisy = electrons + noise * np.sqrt(electrons + parameters.read_noise**2)
    # The sensor saturates before gamma is applied.
    level = np.clip(noisy / parameters.full_well, 0, 1) ** np.float32(1 / parameters.gamma)
    if parameters.sharpening:
        sharper = level + np.float32(parameters.sharpening) * (
            level - _blurred(level, _SHARPENING_PX)
        )
        level = np.clip(sharper, 0, 1)
    top = (1 << parameters.bits) - 1
    kind = np.uint8 if parameters.bits == 8 else np.uint16
    image = np.rint(level * top).astype(kind)
    picture: NDArray[np.uint8] | NDArray[np.uint16] = image if colour else image[..., 0]
    return _compressed(picture, parameters.jpeg_quality) if parameters.jpeg_quality else picture


def _blurred(light: Floats, sigma_px: float) -> Floats:
    blurred = cv2.GaussianBlur(light, (0, 0), sigma_px, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(blurred.reshape(light.shape), np.float32)


def _compressed(image: NDArray[np.uint8] | NDArray[np.uint16], quality: int) -> NDArray[np.uint8]:
    """Compress and decompress an 8-bit grey or RGB image."""
    colour = image.ndim == 3
    ordered = image[..., ::-1] if colour else image
    _, data = cv2.imencode('.jpg', ordered.astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, quality])
    decoded = cv2.imdecode(data, cv2.IMREAD_COLOR if colour else cv2.IMREAD_GRAYSCALE)
    if decoded is None:
        raise AssertionError('OpenCV cannot read the JPEG image it wrote')
    return np.ascontiguousarray(decoded[..., ::-1] if colour else decoded, np.uint8)


def _through_lens(light: Floats, parameters: SensorParameters, rng: np.random.Generator) -> Floats:
    """Apply motion blur, lens blur, vignetting, dust and glare."""
    height, width = light.shape[:2]
    if parameters.motion_blur_px:
        kernel = _motion_kernel(parameters.motion_blur_px, parameters.motion_blur_deg)
        blurred = cv2.filter2D(light, -1, kernel, borderType=cv2.BORDER_REPLICATE)
        light = blurred.reshape(light.shape).astype(np.float32)
    if parameters.blur_px:
        light = _blurred(light, parameters.blur_px)
    y = (np.arange(height, dtype=np.float32) - (height - 1) / 2)[:, np.newaxis]
    x = (np.arange(width, dtype=np.float32) - (width - 1) / 2)[np.newaxis]
    square = (x * x + y * y) / ((width * width + height * height) / 4)
    transmission = 1 - np.float32(parameters.vignetting) * square
    for _ in range(parameters.dust_spots):
        radius = float(np.exp(rng.uniform(math.log(0.004), math.log(0.03)))) * width
        centre_x = rng.uniform(-width / 2, width / 2)
        centre_y = rng.uniform(-height / 2, height / 2)
        depth = rng.uniform(0.15, 0.5)
        distance = ((x - centre_x) ** 2 + (y - centre_y) ** 2) / radius**2
        transmission = transmission * (1 - depth * np.exp(-(distance**2)))
    light = light * transmission[..., np.newaxis].astype(np.float32)
    if parameters.glare:
        light = light + np.float32(parameters.glare) * light.mean((0, 1), keepdims=True)
    return np.asarray(light, np.float32)


def _motion_kernel(length_px: float, direction_deg: float) -> Floats:
    """Return a line of the given length, drawn with bilinear weights and sum 1."""
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
