"""Write pictures of a detection as PNG files, each with a colour key below, or as JPEG."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection import pictures
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.pictures import Colour, Picture
from rover_obstacle_detection.wording import counted

PICTURE_NAMES = ('overlay', *pictures.PICTURES)
JPEG_QUALITY = 85

_BACKGROUND: Colour = (34, 34, 34)
_TEXT: Colour = (225, 225, 225)
_FONT = cv2.FONT_HERSHEY_SIMPLEX
# For the distance of disparity 0, which would be infinite.
_SMALLEST_DISPARITY_PX = 1e-3


@dataclass(frozen=True)
class ColourBar:
    """A bar of an OpenCV colour map, from low to high."""

    colour_map: int


KeyItem = str | Colour | ColourBar
"""A text, a colour swatch or a colour bar."""


def write_pictures(
    detection: Detection,
    image: NDArray[Any] | None,
    folder: Path,
    prefix: str = '',
    names: Sequence[str] = PICTURE_NAMES,
) -> None:
    """Write the overlay and the study's pictures as ``<prefix><name>.png``.

    Parameters
    ----------
    detection : Detection
    image : ndarray, shape (height, width) or (height, width, 3), optional
        The left image, grey or BGR, for the overlay.
    folder : Path
        Created if it does not exist.
    prefix : str
    names : sequence of str
        Those of `PICTURE_NAMES` to write.
    """
    folder.mkdir(exist_ok=True)
    for name in names:
        if name == 'overlay':
            picture = pictures.overlay_picture(detection, image)
        else:
            picture = pictures.PICTURES[name](detection)
        write_png(folder / f'{prefix}{name}.png', with_key(picture, _KEYS[name](detection)))


def write_png(path: Path, image: NDArray[np.uint8]) -> None:
    """Write a grey or BGR image as PNG."""
    _, data = cv2.imencode('.png', image)
    path.write_bytes(data.tobytes())


def encode_jpeg(picture: Picture, quality: int = JPEG_QUALITY) -> bytes:
    """Return a grey or BGR image as a JPEG file."""
    _, data = cv2.imencode('.jpg', picture, (cv2.IMWRITE_JPEG_QUALITY, quality))
    return data.tobytes()


def with_key(picture: Picture, items: Sequence[KeyItem]) -> Picture:
    """Append a key below a picture: texts, swatches and bars from left to right."""
    width = picture.shape[1]
    scale = max(0.35, width / 1900.0)
    line = round(30 * scale)
    strip = np.full((2 * line, width, 3), _BACKGROUND, np.uint8)
    cursor, top, bottom = line // 2, line // 2, line // 2 + line
    for item in items:
        if isinstance(item, str):
            position = (cursor, bottom - line // 6)
            cv2.putText(strip, item, position, _FONT, scale, _TEXT, 1, cv2.LINE_AA)
            (text_width, _), _ = cv2.getTextSize(item, _FONT, scale, 1)
            cursor += text_width + line
            continue
        if isinstance(item, ColourBar):
            ramp = np.linspace(0, 255, 6 * line).astype(np.uint8)[np.newaxis]
            swatch: NDArray[Any] = cv2.applyColorMap(ramp, item.colour_map)
        else:
            swatch = np.full((1, round(1.4 * line), 3), item, np.uint8)
        room = strip[top:bottom, cursor : cursor + swatch.shape[1]]
        room[:] = swatch[:, : room.shape[1]]
        cursor += swatch.shape[1] + line // 3
    return np.vstack((picture, strip))


def overlay_key(detection: Detection) -> Sequence[KeyItem]:
    """Name the colours of the overlay: those of the kinds of obstacle in it, and of unknown."""
    swatches: list[KeyItem] = []
    for kind in pictures.pixels_by_kind(detection):
        swatches += [pictures.KIND_COLOURS[kind], kind]
    return (
        *(swatches or ['no obstacle']),
        '@: distance',
        pictures.LIGHT_GREY,
        'hatched: unknown',
        'no colour: free',
    )


def _disparity_key(detection: Detection) -> Sequence[KeyItem]:
    lowest, highest = pictures.disparity_limits(detection)
    far_m, near_m = (
        detection.camera.depth_m(max(each, _SMALLEST_DISPARITY_PX)) for each in (lowest, highest)
    )
    return (
        f'disparity {lowest:.1f} px, {far_m:.1f} m away',
        ColourBar(cv2.COLORMAP_TURBO),
        f'{highest:.1f} px, {near_m:.1f} m',
        pictures.BLACK,
        'no match',
    )


def _regions_key(detection: Detection) -> Sequence[KeyItem]:
    count = len(np.unique(detection.regions))
    return (
        f'{counted(count, "mean-shift region")}, one colour each, mean brightness of the image',
    )


def _seeds_key(detection: Detection) -> Sequence[KeyItem]:
    return (
        pictures.TEAL,
        'seed region (enough 3D points)',
        pictures.ORANGE,
        'too few 3D points (method study: judged by grey level)',
    )


def _roughness_step_key(detection: Detection) -> Sequence[KeyItem]:
    low_m, high_m = pictures.ROUGHNESS_STEP_RANGE_M
    return (
        f'roughness + step per window: {1000 * low_m:g} mm',
        ColourBar(cv2.COLORMAP_INFERNO),
        f'{high_m:g} m, log scale',
        pictures.BLACK,
        'no 3D',
    )


def _obstacle_map_key(detection: Detection) -> Sequence[KeyItem]:
    return (
        pictures.WHITE,
        'obstacle',
        pictures.BLACK,
        'free',
        pictures.DARK_GREY,
        'unknown',
    )


_KEYS: Mapping[str, Callable[[Detection], Sequence[KeyItem]]] = {
    'overlay': overlay_key,
    'disparity': _disparity_key,
    'regions': _regions_key,
    'seeds': _seeds_key,
    'roughness_step': _roughness_step_key,
    'obstacle_map': _obstacle_map_key,
}
