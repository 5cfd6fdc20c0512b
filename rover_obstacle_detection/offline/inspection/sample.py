"""What a few pairs of a recording show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rover_obstacle_detection.bags.reader import BagReader
from rover_obstacle_detection.bags.topics import StereoTopics
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.errors import CameraError, ObstacleDetectionError, failure_text
from rover_obstacle_detection.offline.inspection.calibration import Calibration
from rover_obstacle_detection.offline.inspection.pairs import (
    GeometryMeasures,
    ImageMeasures,
    as_grey,
    measure_geometry,
    sample_images,
)
from rover_obstacle_detection.pairing import Pair


@dataclass(frozen=True)
class Sample:
    """What the sampled pairs show.

    Parameters
    ----------
    pairs : int
        Usable ones.
    bad : tuple of str
        Why others cannot be decoded or do not fit the calibration.
    images : tuple of (ImageMeasures, ImageMeasures)
        Of the left and the right image.
    geometry : tuple of GeometryMeasures
        Of the pairs with enough matches.
    unjudgeable : tuple of str
        Why the detector refuses the pairs, if it refuses all of them.
    """

    pairs: int
    bad: tuple[str, ...]
    images: tuple[tuple[ImageMeasures, ImageMeasures], ...]
    geometry: tuple[GeometryMeasures, ...]
    unjudgeable: tuple[str, ...] = ()

    @property
    def is_upside_down(self) -> bool:
        """Whether the camera is mounted upside down, by most pairs."""
        return sum(each.upside_down for each in self.geometry) > len(self.geometry) / 2


def take_sample(
    bag: BagReader,
    topics: StereoTopics,
    pairs: Sequence[Pair],
    calibration: Calibration,
    most: int,
    *,
    of_one_moment: bool,
) -> Sample:
    """Decode and measure up to `most` pairs that are spread over the recording.

    Without `of_one_moment` the images of a pair are not compared.
    """
    bad: list[str] = []
    images: list[tuple[ImageMeasures, ImageMeasures]] = []
    geometry: list[GeometryMeasures] = []
    unjudgeable: list[str] = []
    usable, judged = 0, False
    for files, decoded in sample_images(bag, topics, pairs, most):
        if isinstance(decoded, Exception):
            bad.append(failure_text(decoded))
            continue
        try:
            left, right = decoded
            grey = as_grey(left, right)
            images.append((ImageMeasures.of(grey[0]), ImageMeasures.of(grey[1])))
            if calibration.camera is None:
                usable += 1
                continue
            if calibration.rectification:
                grey = as_grey(*calibration.rectification(*grey))
            if grey[0].shape != calibration.camera.shape:
                height, width = grey[0].shape
                raise CameraError(
                    f'the images are {width} x {height}, but the calibration is for '
                    f'{calibration.camera.width} x {calibration.camera.height}'
                )
            usable += 1
            if not of_one_moment:
                continue
            measured = measure_geometry(grey, calibration.camera)
            if measured is not None:
                geometry.append(measured)
            if not judged:
                upside_down = measured is not None and measured.upside_down
                reason = _refusal(grey, calibration.camera, upside_down=upside_down)
                judged = not reason
                unjudgeable.append(reason)
        except Exception as error:
            bad.append(': '.join(filter(None, (files, failure_text(error)))))
    return Sample(
        usable,
        tuple(bad),
        tuple(images),
        tuple(geometry),
        () if judged else tuple(unjudgeable),
    )


def _refusal(pair: GreyPair, camera: StereoCamera, *, upside_down: bool) -> str:
    """Why the detector cannot judge a pair; empty if it can."""
    try:
        Detector(camera, DetectorConfig(upside_down=upside_down)).detect(*pair)
    except ObstacleDetectionError as error:
        return failure_text(error)
    return ''
