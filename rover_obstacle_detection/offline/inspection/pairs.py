"""Measure what a pair of images tells about its cameras."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.bags.reader import BadMessage, BagReader
from rover_obstacle_detection.bags.stereo import check_equal_sizes
from rover_obstacle_detection.bags.topics import StereoTopics
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.plane_fit import is_upside_down
from rover_obstacle_detection.detection.images.grey_pair import GreyPair, grey_pair
from rover_obstacle_detection.detection.methods.measurement import find_ground, match_coarsely
from rover_obstacle_detection.detection.methods.stages import HYBRID_STAGES
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.rectification.correction import Correction
from rover_obstacle_detection.detection.rectification.rectify import Rectified
from rover_obstacle_detection.detection.rectification.row_alignment import RowAlignment
from rover_obstacle_detection.detection.stereo.coarse import coarse_camera
from rover_obstacle_detection.detection.stereo.pair_check import row_offset
from rover_obstacle_detection.messages.header import stamp_ns
from rover_obstacle_detection.messages.image import decode_any_image, halves
from rover_obstacle_detection.pairing import Pair
from rover_obstacle_detection.swapped_images import are_swapped

_SATURATED = 250
_PARAMETERS = DetectorParameters.from_config(DetectorConfig())
Images = tuple[NDArray[Any], NDArray[Any]]


@dataclass(frozen=True)
class ImageMeasures:
    """Exposure and sharpness of one image.

    Parameters
    ----------
    median_grey : float
        0 to 255.
    saturated_share : float
        Share of pixels with a grey level of 250 or more.
    sharpness : float
        Variance of the Laplacian over that of the image.
    """

    median_grey: float
    saturated_share: float
    sharpness: float

    @classmethod
    def of(cls, image: NDArray[np.uint8]) -> ImageMeasures:
        """Measure a grey image."""
        fine = float(cv2.Laplacian(image, cv2.CV_32F).var())
        return cls(
            float(np.median(image)),
            float(np.mean(image >= _SATURATED)),
            fine / (float(image.var()) + 1),
        )


@dataclass(frozen=True)
class GeometryMeasures:
    """Rectification and orientation of a rectified pair.

    Parameters
    ----------
    rows : RowAlignment
        Rows by which the right image is off, pixels.
    rows_off_px : float
        The same at the worst border.
    lens_bend_px : float
        Residual lens distortion, mean over the image.
    swapped, upside_down : bool
    """

    rows: RowAlignment
    rows_off_px: float
    lens_bend_px: float
    swapped: bool
    upside_down: bool


def sample_images(
    bag: BagReader, topics: StereoTopics, pairs: Sequence[Pair], most: int
) -> Iterator[tuple[str, Images | Exception]]:
    """Decode up to `most` pairs spread over the recording.

    Yields
    ------
    files : str
        Those of the pair; empty unless the recording is a folder of images.
    images : tuple of two ndarray, or Exception
        Or why they cannot be decoded.
    """
    if not pairs:
        return
    places = np.linspace(0, len(pairs) - 1, min(most, len(pairs))).round().astype(int)
    chosen = [pairs[place] for place in np.unique(places)]
    sides = (topics.left_image, topics.right_image)
    wanted = {
        (topic, *item): (index, side)
        for index, pair in enumerate(chosen)
        for side, (topic, item) in enumerate(zip(sides, (pair.left, pair.right), strict=True))
    }
    log_times = [item[0] for pair in chosen for item in (pair.left, pair.right)]
    waiting: dict[int, dict[int, Any]] = {}
    for topic, log_time_ns, message in bag.messages(sides, min(log_times), max(log_times) + 1):
        if isinstance(message, BadMessage):
            continue
        place = wanted.pop((topic, log_time_ns, stamp_ns(message.header)), None)
        if place is None:
            continue
        index, side = place
        waiting.setdefault(index, {})[side] = message
        if topics.is_side_by_side or len(waiting[index]) == 2:
            stamps = chosen[index].left[1], chosen[index].right[1]
            names = [bag.name_of(*each) for each in zip(sides, stamps, strict=True)]
            files = '' if names[0] == sides[0] else ', '.join(dict.fromkeys(names))
            images = _decoded(waiting.pop(index), names, is_side_by_side=topics.is_side_by_side)
            yield files, images


def _decoded(
    messages: dict[int, Any], names: Sequence[str], *, is_side_by_side: bool
) -> Images | Exception:
    """Decode the images of both sides, or the one image with both views."""
    left_name, right_name = names
    try:
        if is_side_by_side:
            (both,) = messages.values()
            return halves(decode_any_image(both, left_name), left_name)
        left = decode_any_image(messages[0], left_name)
        right = decode_any_image(messages[1], right_name)
        check_equal_sizes(left, right, names)
        return left, right
    except Exception as error:
        return error


def as_grey(left: NDArray[Any], right: NDArray[Any]) -> GreyPair:
    """Convert a pair of any size to 8-bit grey.

    Raises
    ------
    ImageError
        If the images differ in size, or are no images.
    """
    height, width = left.shape[:2]
    any_camera = StereoCamera(width, height, width, width, width / 2, height / 2, 0.1)
    return grey_pair(left, right, any_camera)


def measure_geometry(pair: GreyPair, camera: StereoCamera) -> GeometryMeasures | None:
    """Measure a rectified pair; None if it has too few matches.

    Parameters
    ----------
    pair : tuple of two ndarray of uint8, shape (height, width)
    camera : StereoCamera
    """
    p = _PARAMETERS
    if are_swapped(*pair, camera):
        return GeometryMeasures(RowAlignment(), 0.0, 0.0, swapped=True, upside_down=False)
    matched = _match(pair, camera)
    if matched is None:
        return None
    found, reduced, coarse = matched
    ground, _ = find_ground(found.straightened(reduced), coarse, p)
    return GeometryMeasures(
        found.rows,
        found.rows.most_px(camera),
        found.lenses.mean_bend_px(camera),
        swapped=False,
        upside_down=not ground.measured
        and is_upside_down(coarse.disparity, coarse.camera, p.plane_fit),
    )


def measure_rectification(pair: GreyPair, camera: StereoCamera) -> Correction | None:
    """Measure only the rectification error of a pair; None if it has too few matches."""
    matched = _match(pair, camera)
    return matched[0] if matched else None


def _match(pair: GreyPair, camera: StereoCamera) -> tuple[Correction, Frame, Rectified] | None:
    """Return the rectification error, the pair that was matched, and its match."""
    p = _PARAMETERS
    # The detector looks for row shifts of a few pixels; a larger one is taken out before.
    shift_px = row_offset(pair, p.stereo.support)
    if abs(shift_px) <= p.rectification.max_row_shift_px / 2:
        shift_px = 0
    left, right = pair
    aligned = np.asarray(np.roll(right, -shift_px, axis=0), np.uint8)
    reduced = Frame((left, aligned), camera).resized(coarse_camera(camera, p.stereo))
    coarse = match_coarsely(reduced, camera, p, HYBRID_STAGES)
    if np.count_nonzero(coarse.disparity) < p.rectification.min_matched_pixels:
        return None
    rows = coarse.correction.rows
    rows = replace(rows, offset_px=rows.offset_px + shift_px)
    return replace(coarse.correction, rows=rows), reduced, coarse
