"""Results behind the blocks of the evaluation pages, computed when first needed."""

from __future__ import annotations

import functools
import multiprocessing
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import cv2
from studies.disparity_study import Errors, SceneDisparity, pair_errors
from studies.gravity_study import SceneGravity
from studies.lens_study import SceneLenses
from studies.motorcycle import load_motorcycle
from studies.reliability import JudgedObstacles
from studies.scene_studies import (
    evaluate_scene,
    study_disparity,
    study_gravity,
    study_lenses,
    study_reliability,
)

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.evaluation.methods.ablation import ablated_methods
from rover_obstacle_detection.evaluation.methods.names import METHOD_DESCRIPTIONS
from rover_obstacle_detection.evaluation.methods.registry import USE_CLEARANCE
from rover_obstacle_detection.evaluation.results import Evaluation, merged
from rover_obstacle_detection.evaluation.runner import RunOptions

SAMPLE_BAG = Path(__file__).resolve().parent.parent / 'bags' / 'mars_yard'
OWN = 'hybrid'
WORST_PICTURES = 10
REPORT, TUNE, DRAWN, SAMPLE = 'report', 'tune', 'drawn', 'sample'
HAZARD_REPORT, HAZARD_TUNE, UNSEEN = 'hazard_report', 'hazard_tune', 'unseen'
TIMED = (REPORT, SAMPLE)
# The clearance curve and the drawn scenes skip the methods that take seconds a frame.
CURVED = tuple(method for method in USE_CLEARANCE if method != 'wang')
DRAWN_METHODS = ('hybrid', 'study', 'image_only', 'depth_only', 'patchwork')
CONFIG = DetectorConfig()

T = TypeVar('T')


class Results:
    """Evaluations and studies of the labelled scenes.

    Parameters
    ----------
    reporting, tuning : sequence of Path
        Labelled bags.
    methods : sequence of str
        Methods to compare.
    workers : int
        Processes for everything that is not timed.
    drawn : sequence of Path
        Labelled bags of the randomly drawn scenes.
    hazard_reporting, hazard_tuning : sequence of Path
        Labelled bags of the suite ``hazards``.
    unseen : sequence of Path
        Labelled bags of the suite ``unseen``.
    """

    def __init__(
        self,
        reporting: Sequence[Path],
        tuning: Sequence[Path],
        methods: Sequence[str],
        workers: int,
        drawn: Sequence[Path] = (),
        hazard_reporting: Sequence[Path] = (),
        hazard_tuning: Sequence[Path] = (),
        unseen: Sequence[Path] = (),
    ) -> None:
        self._bags = {
            REPORT: reporting,
            TUNE: tuning,
            DRAWN: drawn,
            HAZARD_REPORT: hazard_reporting,
            HAZARD_TUNE: hazard_tuning,
            UNSEEN: unseen,
            SAMPLE: [SAMPLE_BAG],
        }
        self.methods = methods
        # OpenCV's threads do not survive a fork; with one thread each, workers do not compete.
        self._pool = ProcessPoolExecutor(
            workers, multiprocessing.get_context('spawn'), cv2.setNumThreads, (1,)
        )

    def __enter__(self) -> Results:
        return self

    def __exit__(self, *error: object) -> None:
        self._pool.shutdown(cancel_futures=True)

    def installed(self, *names: str) -> list[str]:
        """Select the methods that are compared."""
        return [name for name in names if name in self.methods]

    def of(self, suite: str, *methods: str) -> Evaluation:
        """Run methods on a suite; times only count for `TIMED` suites."""
        return side_by_side([self._of(suite, method) for method in methods])

    def ablation(self, suite: str) -> Evaluation:
        """Run the hybrid with and without each stage; ignore the times."""
        return self.of(suite, *ablated_methods())

    @cached_property
    def curves(self) -> Evaluation:
        """Reporting scenes at other clearances: ``curves`` of each method that depends on it."""
        parts = [
            self._shared(
                f'{method} at other clearances',
                evaluate_scene,
                self._bags[REPORT],
                RunOptions([method], CONFIG, repeat=1, curve=True),
            )
            for method in self.installed(*CURVED)
        ]
        return side_by_side([merged(part, 0) for part in parts])

    @functools.cache  # noqa: B019
    def gravity(self, suite: str) -> list[SceneGravity]:
        """Compare known with estimated gravity."""
        return self._shared('gravity', study_gravity, self._bags[suite], CONFIG)

    @functools.cache  # noqa: B019
    def disparity(self, suite: str) -> list[SceneDisparity]:
        """Measure the errors of the disparity."""
        return self._shared('disparity', study_disparity, self._bags[suite], CONFIG)

    @functools.cache  # noqa: B019
    def lenses(self, suite: str) -> list[SceneLenses]:
        """Add residual lens distortion to each frame."""
        frames = self._shared('lens distortion', study_lenses, self._bags[suite], CONFIG)
        return [frame for scene in frames for frame in scene]

    @functools.cache  # noqa: B019
    def reliability(self, suite: str) -> list[JudgedObstacles]:
        """Check which detected obstacles are real."""
        return self._shared('reliability', study_reliability, self._bags[suite], CONFIG)

    @cached_property
    def motorcycle(self) -> Errors:
        """Errors of the disparity of the Middlebury pair."""
        return pair_errors(load_motorcycle(), CONFIG)

    @functools.cache  # noqa: B019
    def _of(self, suite: str, method: str) -> Evaluation:
        # Faults are only analysed when pictures are kept.
        pictures = WORST_PICTURES if method == OWN else 0
        bags = self._bags[suite]
        if suite not in TIMED or method not in METHOD_DESCRIPTIONS:
            options = RunOptions([method], CONFIG, repeat=1, worst_pictures=pictures)
            return merged(self._shared(method, evaluate_scene, bags, options), pictures)
        started = time.monotonic()
        options = RunOptions([method], CONFIG, worst_pictures=pictures)
        parts = [evaluate_scene(bag, options) for bag in bags]
        report_progress(f'{method}, timed', len(bags), started)
        return merged(parts, pictures)

    def _shared(
        self, what: str, study: Callable[[Path, Any], T], bags: Sequence[Path], options: Any
    ) -> list[T]:
        """Study bags in the worker processes; results keep the order of the bags."""
        started = time.monotonic()
        futures = [self._pool.submit(study, bag, options) for bag in bags]
        done = [future.result() for future in futures]
        report_progress(what, len(bags), started)
        return done


def side_by_side(evaluations: Sequence[Evaluation]) -> Evaluation:
    """Combine evaluations of different methods, in this order."""
    return merged(evaluations, WORST_PICTURES)


def report_progress(what: str, scenes: int, started: float) -> None:
    """Print to stderr what was done and how long it took."""
    print(f'{what}: {scenes} scenes in {time.monotonic() - started:.0f} s', file=sys.stderr)
