"""Run methods on the frames of one scene."""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.errors import UnjudgeablePairError
from rover_obstacle_detection.evaluation.causes import FrameCauses
from rover_obstacle_detection.evaluation.distributions import Distribution, TerrainDistributions
from rover_obstacle_detection.evaluation.faults import find_faults
from rover_obstacle_detection.evaluation.figures import Figures, score
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.losses import measure_losses
from rover_obstacle_detection.evaluation.methods.detector_method import DetectorMethod
from rover_obstacle_detection.evaluation.methods.method import Mask, Method, as_mask
from rover_obstacle_detection.evaluation.methods.registry import USE_CLEARANCE, make_method
from rover_obstacle_detection.evaluation.overlay import judgement_picture
from rover_obstacle_detection.evaluation.plain_stereo import plain_stereo_seconds
from rover_obstacle_detection.evaluation.ranges import score_by_range
from rover_obstacle_detection.evaluation.results import (
    Evaluation,
    FrameResult,
    Picture,
    SceneResult,
    worst,
)

# Clearances of the curve, relative to the configured one.
CURVE_FACTORS = (0.4, 0.6, 0.8, 0.9, 1.0, 1.1, 1.25, 1.5, 2.0)
# Wider pictures are scaled down to this many pixels, to keep a report small.
PICTURE_WIDTH = 720
JPEG_QUALITY = 85
# No more repeats once a method has run for this long on a frame.
ENOUGH_SECONDS = 2.0


@dataclass(frozen=True)
class RunOptions:
    """What to run and what to keep.

    Parameters
    ----------
    methods : sequence of str
    config : DetectorConfig
    repeat : int
        Calls per method and frame, for a median time; fewer for methods that take seconds.
    curve : bool
        Also run the methods that depend on ``max_step`` at other values of it.
    worst_pictures : int
        Pictures to keep of each method. Not 0: also analyse losses and faults.
    """

    methods: Sequence[str]
    config: DetectorConfig
    repeat: int = 3
    curve: bool = False
    worst_pictures: int = 0


class SceneRun:
    """Runs methods on the frames of a scene, one frame at a time.

    Parameters
    ----------
    scene : str
    conditions : tuple of str
    options : RunOptions

    Raises
    ------
    ConfigurationError
        If a method does not exist.
    MissingExtraError
        If a method's library is not installed.
    """

    def __init__(self, scene: str, conditions: tuple[str, ...], options: RunOptions) -> None:
        self._scene = scene
        self._conditions = conditions
        self._options = options
        self._methods = {name: make_method(name, options.config) for name in options.methods}
        self._curve_methods = _curve_methods(options) if options.curve else {}
        self._frames: dict[str, list[FrameResult]] = {name: [] for name in options.methods}
        self._by_range: dict[str, tuple[Figures, ...]] = {}
        self._curves: dict[str, dict[float, Figures]] = {}
        self._distributions: dict[str, TerrainDistributions] = {}
        self._pictures: tuple[Picture, ...] = ()

    def take(self, frame: LabelledFrame) -> None:
        """Run and score every method on a frame."""
        for name, method in self._methods.items():
            self._judge(name, method, frame)
        for name, by_clearance in self._curve_methods.items():
            sums = self._curves.setdefault(name, {})
            for max_step_m, method in by_clearance.items():
                mask, known, _ = _run(method, frame)
                figures = score(mask, frame.labels, frame.instances, known)
                sums[max_step_m] = sums.get(max_step_m, Figures()) + figures

    def evaluation(self, problems: Iterable[str] = ()) -> Evaluation:
        """Summarise the frames taken so far."""
        return Evaluation(
            scenes=tuple(
                SceneResult(
                    name,
                    self._scene,
                    self._conditions,
                    tuple(frames),
                    self._by_range.get(name, ()),
                )
                for name, frames in self._frames.items()
                if frames
            ),
            curves=self._curves,
            distributions=self._distributions,
            pictures=self._pictures,
            problems=tuple(problems),
        )

    def _judge(self, name: str, method: Method, frame: LabelledFrame) -> None:
        seconds, plain_seconds = [], []
        for _ in range(self._options.repeat):
            plain_seconds.append(plain_stereo_seconds(frame.camera, frame.left, frame.right))
            started = time.perf_counter()
            mask, known, detection = _run(method, frame)
            seconds.append(time.perf_counter() - started)
            if sum(seconds) > ENOUGH_SECONDS:
                break
        truth = frame.labels, frame.instances
        result = FrameResult(
            frame.stamp_ns,
            score(mask, *truth, known),
            statistics.median(seconds),
            statistics.median(plain_seconds),
        )
        if frame.depth_m is not None:
            spans = score_by_range(mask, *truth, frame.depth_m, known)
            before = self._by_range.get(name, (Figures(),) * len(spans))
            self._by_range[name] = tuple(map(Figures.__add__, before, spans))
        if detection is not None:
            self._add_distributions(name, detection, frame)
        if self._options.worst_pictures:
            result = self._explain(name, result, mask, detection, frame)
        self._frames[name].append(result)

    def _explain(
        self,
        name: str,
        result: FrameResult,
        mask: Mask,
        detection: Detection | None,
        frame: LabelledFrame,
    ) -> FrameResult:
        """Add losses and faults to a result; keep its picture if it is among the worst."""
        causes = None
        if detection is not None and frame.depth_m is not None:
            causes = FrameCauses(detection, frame)
        vertical = None if causes is None else causes.vertical()
        explained = replace(
            result,
            losses=measure_losses(mask, frame.labels, frame.instances),
            faults=find_faults(mask, frame.labels, frame.instances, frame.depth_m, causes),
            remarks=() if vertical is None else (vertical,),
        )
        picture = Picture(name, self._scene, explained, _jpeg(frame, mask))
        self._pictures = worst((*self._pictures, picture), self._options.worst_pictures)
        return explained

    def _add_distributions(self, name: str, detection: Detection, frame: LabelledFrame) -> None:
        both = TerrainDistributions(
            Distribution.of(detection.roughness, frame.labels),
            Distribution.of(detection.step, frame.labels),
        )
        known = self._distributions.get(name)
        self._distributions[name] = both if known is None else known + both


def _curve_methods(options: RunOptions) -> dict[str, dict[float, Method]]:
    clearances = [round(factor * options.config.max_step, 4) for factor in CURVE_FACTORS]
    return {
        name: {
            max_step_m: make_method(name, replace(options.config, max_step=max_step_m))
            for max_step_m in clearances
        }
        for name in options.methods
        if name in USE_CLEARANCE
    }


def _run(
    method: Method, frame: LabelledFrame
) -> tuple[Mask, NDArray[np.bool_] | None, Detection | None]:
    """Return the mask, the judged pixels and the detection; None where the method has none."""
    if not isinstance(method, DetectorMethod):
        return method(frame.camera, frame.left, frame.right), None, None
    try:
        detection = method.detect(frame.camera, frame.left, frame.right)
    except UnjudgeablePairError:
        # All is unknown: no obstacle is found, and nothing is called free.
        nothing = np.zeros(frame.camera.shape, np.bool_)
        return as_mask(nothing), nothing, None
    return detection.mask, detection.known, detection


def _jpeg(frame: LabelledFrame, mask: Mask) -> bytes:
    picture = judgement_picture(frame.left, mask, frame.labels)
    height, width = mask.shape
    if width > PICTURE_WIDTH:
        size = (PICTURE_WIDTH, round(height * PICTURE_WIDTH / width))
        picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)
    _, data = cv2.imencode('.jpg', picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return bytes(data)
