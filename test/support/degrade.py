"""What goes wrong with the images of a stereo camera, as functions of a good pair.

All take and return ``left, right``: uint8, shape (height, width). Values stay 8 bit.
"""

from __future__ import annotations

import cv2
import numpy as np

Image = np.ndarray
Pair = tuple[Image, Image]

SIDES = ('left', 'right', 'both')


def _on(pair: Pair, side: str, change) -> Pair:
    """Change the left, the right, or both images."""
    assert side in SIDES, side
    left, right = pair
    return (
        change(left, 0) if side in ('left', 'both') else left,
        change(right, 1) if side in ('right', 'both') else right,
    )


def _grey(values: Image) -> Image:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def black(left: Image, right: Image, side: str = 'both') -> Pair:
    return _on((left, right), side, lambda image, _: np.zeros_like(image))


def white(left: Image, right: Image, side: str = 'both') -> Pair:
    return _on((left, right), side, lambda image, _: np.full_like(image, 255))


def covered(left: Image, right: Image, side: str = 'both', grey: float = 90.0) -> Pair:
    """A lens cap that lets some light through: nothing but shading and noise."""

    def change(image, seed):
        rows, columns = (np.linspace(-1, 1, size) for size in image.shape)
        shade = grey * (1 - 0.1 * np.hypot(rows[:, np.newaxis], columns))
        return _grey(shade + np.random.default_rng((9, seed)).normal(0, 1.5, image.shape))

    return _on((left, right), side, change)


def half_covered(left: Image, right: Image, side: str = 'left') -> Pair:
    """Something hangs before the right half of a lens."""
    cover = covered(left, right, side, grey=40.0)

    def change(image, which):
        half = image.copy()
        half[:, image.shape[1] // 2 :] = cover[which][:, image.shape[1] // 2 :]
        return half

    return _on((left, right), side, change)


def same_twice(left: Image, right: Image, noise: float = 0.0) -> Pair:
    """One camera on both topics. With noise, two images of it."""
    twin = left + np.random.default_rng(8).normal(0, noise, left.shape)
    return left, _grey(twin)


def exchanged(left: Image, right: Image) -> Pair:
    return right, left


def upside_down(left: Image, right: Image) -> Pair:
    """The camera mounted upside down: both images turned by 180 degrees, and exchanged."""
    return right[::-1, ::-1].copy(), left[::-1, ::-1].copy()


def defocused(left: Image, right: Image, side: str = 'left', sigma_px: float = 3.0) -> Pair:
    """Out of focus. The noise of the sensor stays sharp."""

    def change(image, seed):
        soft = cv2.GaussianBlur(image.astype(np.float32), (0, 0), sigma_px)
        return _grey(soft + np.random.default_rng((7, seed)).normal(0, 1.4, image.shape))

    return _on((left, right), side, change)


def smudged(left: Image, right: Image, side: str = 'left', radius: float = 0.25) -> Pair:
    """Dirt on a lens: a round part of the image is blurred and pale."""

    def change(image, _):
        height, width = image.shape
        rows, columns = np.ogrid[:height, :width]
        away = np.hypot(columns - 0.55 * width, rows - 0.6 * height) / (radius * height)
        share = np.clip(2 * (1 - away), 0, 1)
        soft = 0.5 * cv2.GaussianBlur(image.astype(np.float32), (0, 0), 0.02 * height) + 80
        return _grey((1 - share) * image + share * soft)

    return _on((left, right), side, change)


def shifted(left: Image, right: Image, right_px: float = 0.0, down_px: float = 0.0) -> Pair:
    """Move the right image: rectification or calibration that is off."""
    move = np.float32([[1, 0, right_px], [0, 1, down_px]])
    size = right.shape[::-1]
    return left, cv2.warpAffine(
        right, move, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )


def turned(left: Image, right: Image, angle_deg: float = 1.0) -> Pair:
    """Turn the right image about its centre."""
    height, width = right.shape
    move = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), angle_deg, 1.0)
    return left, cv2.warpAffine(
        right, move, (width, height), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )


def exposed(left: Image, right: Image, side: str = 'both', gain: float = 2.0) -> Pair:
    """Another exposure; bright parts clip. The noise of a dark sensor stays."""

    def change(image, seed):
        noise = np.random.default_rng((6, seed)).normal(0, 1.0, image.shape)
        return _grey(image.astype(np.float32) * gain + noise)

    return _on((left, right), side, change)


def gamma(left: Image, right: Image, side: str = 'both', exponent: float = 2.0) -> Pair:
    return _on((left, right), side, lambda image, _: _grey(255 * (image / 255.0) ** exponent))


def vignetted(left: Image, right: Image, side: str = 'both', loss: float = 0.7) -> Pair:
    """Darken towards the corners, where this share of the light is lost."""

    def change(image, _):
        rows, columns = (np.linspace(-1, 1, size) for size in image.shape)
        return _grey(image * (1 - loss * (rows[:, np.newaxis] ** 2 + columns**2) / 2))

    return _on((left, right), side, change)


def compressed(left: Image, right: Image, side: str = 'both', quality: int = 30) -> Pair:
    """Compress as JPEG."""

    def change(image, _):
        _, data = cv2.imencode('.jpg', image, [cv2.IMWRITE_JPEG_QUALITY, quality])
        return cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)

    return _on((left, right), side, change)
