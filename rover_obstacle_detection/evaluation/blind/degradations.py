"""Damage to a single grey image: lens, exposure, noise, coding.

Every function takes an image of uint8, shape (height, width), and returns a new one. Damage to the
light in front of the sensor is followed by fresh sensor noise: without it, the result would be
cleaner than any camera's. Noise depends only on the image size and ``seed``, so that two strengths
differ in nothing else.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Grey = NDArray[np.uint8]
Floats = NDArray[np.float32]

READ_NOISE = 1.0
"""Standard deviation of the sensor noise of a good camera, grey levels."""

BLACK_LEVEL = 4.0
"""Subtracted by a camera that clips black, grey levels."""

DIRT_LEVEL = 40.0
"""Grey level of dirt on a lens, which is too close to be in focus."""

FOG_LEVEL = 160.0
"""Grey level of thick fog or dust."""

FLAT_SIDE_PX = 9
"""A pixel says nothing where a window with this side is featureless; size of a matching window."""


def flat(shape: tuple[int, ...], level: float, sigma: float = 0.0, seed: int = 0) -> Grey:
    """Make a featureless image with noise of standard deviation `sigma`, grey levels."""
    return to_grey(np.full(shape, level, np.float32) + noise(shape, sigma, seed))


def noise(shape: tuple[int, ...], sigma: float, seed: int) -> Floats:
    """Draw Gaussian noise, grey levels."""
    drawn = np.random.default_rng(seed).standard_normal(shape, np.float32)
    return np.asarray(np.float32(sigma) * drawn, np.float32)


def to_grey(image: Floats) -> Grey:
    """Round and clip to 0 to 255."""
    return np.asarray(np.clip(np.rint(image), 0, 255), np.uint8)


def noisy(image: Grey, sigma: float, seed: int = 0) -> Grey:
    """Add Gaussian noise of standard deviation `sigma`, grey levels."""
    return to_grey(image + noise(image.shape, sigma, seed))


def blurred(image: Grey, sigma_px: float, seed: int = 0) -> Grey:
    """Put the lens out of focus: Gaussian blur."""
    soft = cv2.GaussianBlur(image.astype(np.float32), (0, 0), sigma_px)
    return _sensed(np.asarray(soft, np.float32), seed)


def motion_blurred(image: Grey, length_px: int, seed: int = 0) -> Grey:
    """Smear along the rows by an odd number of pixels."""
    kernel = np.full((1, length_px), 1 / length_px, np.float32)
    soft = cv2.filter2D(image.astype(np.float32), -1, kernel, borderType=cv2.BORDER_REPLICATE)
    return _sensed(np.asarray(soft, np.float32), seed)


def over_exposed(image: Grey, gain: float) -> Grey:
    """Multiply by `gain` and clip white."""
    return to_grey(np.float32(gain) * image.astype(np.float32))


def under_exposed(image: Grey, gain: float, seed: int = 0) -> Grey:
    """Multiply by `gain`, below 1, subtract the black level and clip black."""
    return _sensed(np.float32(gain) * image.astype(np.float32) - np.float32(BLACK_LEVEL), seed)


def foggy(image: Grey, contrast: float, seed: int = 0) -> Grey:
    """Reduce the contrast to this share and fill up with the grey of fog."""
    veil = np.float32((1 - contrast) * FOG_LEVEL)
    return _sensed(np.float32(contrast) * image.astype(np.float32) + veil, seed)


def as_jpeg(image: Grey, quality: int) -> Grey:
    """Compress and decompress with a JPEG quality of 1 to 100."""
    _, data = cv2.imencode('.jpg', image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE), np.uint8)


def shifted(image: Grey, columns: int = 0, rows: int = 0) -> Grey:
    """Move the content right and down; the border repeats the outermost pixels."""
    matrix = np.array([[1, 0, columns], [0, 1, rows]], np.float32)
    size = image.shape[1], image.shape[0]
    return np.asarray(
        cv2.warpAffine(
            image, matrix, size, flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE
        ),
        np.uint8,
    )


def zoomed(image: Grey, factor: float) -> Grey:
    """Enlarge about the image centre, as if the camera had moved forward."""
    height, width = image.shape
    centre = (width - 1) / 2, (height - 1) / 2
    matrix = cv2.getRotationMatrix2D(centre, 0.0, factor)
    return np.asarray(
        cv2.warpAffine(
            image, matrix, (width, height), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        ),
        np.uint8,
    )


def covered(image: Grey, area: NDArray[np.bool_], level: float = 8.0, seed: int = 0) -> Grey:
    """Replace an area by featureless dark with sensor noise."""
    return np.where(area, flat(image.shape, level, READ_NOISE, seed), image).astype(np.uint8)


def dirt(shape: tuple[int, int], share: float, seed: int = 0) -> Floats:
    """Opacity of blobs of dirt on a lens.

    Parameters
    ----------
    shape : tuple of int
        Height and width of the image.
    share : float
        Part of the image that the blobs cover, 0 to 1.
    seed : int
        The blobs of a larger share contain those of a smaller one.

    Returns
    -------
    ndarray of float32, shape (height, width)
        0 clear to 1 opaque, with soft edges.
    """
    # Blobs of a tenth of the image, with edges of a fiftieth.
    rough = noise(shape, 1.0, seed)
    relief = cv2.GaussianBlur(rough, (0, 0), shape[1] / 20, borderType=cv2.BORDER_REFLECT)
    blobs = (relief > np.quantile(relief, 1 - share)).astype(np.float32)
    return np.asarray(cv2.GaussianBlur(blobs, (0, 0), shape[1] / 100), np.float32)


def dirty(image: Grey, opacity: Floats, seed: int = 0) -> Grey:
    """Look through a dirty lens."""
    return _sensed(image * (1 - opacity) + np.float32(DIRT_LEVEL) * opacity, seed)


def featureless(clipped: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mark pixels around which a whole matching window is clipped."""
    window = np.ones((FLAT_SIDE_PX, FLAT_SIDE_PX), np.uint8)
    return np.asarray(cv2.erode(clipped.astype(np.uint8), window), np.bool_)


def _sensed(light: Floats, seed: int) -> Grey:
    return to_grey(light + noise(light.shape, READ_NOISE, seed))
