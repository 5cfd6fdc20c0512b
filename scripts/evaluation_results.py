"""What the blocks of docs/evaluation.md are made of, worked out when it is first asked for."""

from __future__ import annotations

import functools
import multiprocessing
import sys
import time
from collections.abc import Callable, Iterable, Sequence
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
from rover_obstacle_detection.evaluation.methods.registry import USE_CLEARANCE
from rover_obstacle_detection.evaluation.results import Evaluation, merged
from rover_obstacle_detection.evaluation.runner import RunOptions

SAMPLE = Path(__file__).resolve().parent.parent / 'bags' / 'mars_yard'
OWN = 'hybrid'
WORST = 10
# The sparse pipeline would take longer at nine clearances than all the rest together.
CURVED = tuple(method for method in USE_CLEARANCE if method != 'wang')
REPORT, TUNE, DRAWN = 'report', 'tune', 'drawn'
# The others take as long as all the rest together, and are told by the reporting scenes.
DRAWN_METHODS = ('hybrid', 'study', 'image_only', 'depth_only', 'patchwork')
CONFIG = DetectorConfig()

T = TypeVar('T')


class Results:
    """Evaluations and studies of the reporting and the tuning scenes.

    Parameters
    ----------
    reporting, tuning : sequence of Path
        Labelled bags.
    methods : sequence of str
        To compare.
    workers : int
        Processes for what is not timed.
    drawn : sequence of Path
        Labelled bags of scenes drawn by chance, which are reported as well.
    """

    def __init__(
        self,
        reporting: Sequence[Path],
        tuning: Sequence[Path],
        methods: Sequence[str],
        workers: int,
        drawn: Sequence[Path] = (),
    ) -> None:
        self._bags = {REPORT: reporting, TUNE: tuning, DRAWN: drawn}
        self.methods = methods
        # OpenCV's threads do not survive a fork; of two processes each has one core.
        self._pool = ProcessPoolExecutor(
            workers, multiprocessing.get_context('spawn'), cv2.setNumThreads, (1,)
        )

    def __enter__(self) -> Results:
        return self

    def __exit__(self, *error: object) -> None:
        self._pool.shutdown(cancel_futures=True)

    def installed(self, *names: str) -> list[str]:
        """Those of some methods that are compared."""
        return [name for name in names if name in self.methods]

    def timed(self, *methods: str) -> Evaluation:
        """Run methods over the reporting scenes, one after another with nothing beside them."""
        return side_by_side([self._timed(method) for method in methods])

    def sample(self, *methods: str) -> Evaluation:
        """Run methods over the bag that comes with the project, in the same way."""
        return side_by_side([self._sample(method) for method in methods])

    def tuned(self, *methods: str) -> Evaluation:
        """Run methods over the tuning scenes; their times mean nothing."""
        return side_by_side([self._untimed(TUNE, method) for method in methods])

    def drawn(self, *methods: str) -> Evaluation:
        """Run methods over the scenes drawn by chance; their times mean nothing."""
        return side_by_side([self._untimed(DRAWN, method) for method in methods])

    def ablation(self, kind: str) -> Evaluation:
        """Run the hybrid with and without each of its stages; the times mean nothing."""
        return side_by_side([self._untimed(kind, method) for method in ablated_methods()])

    @cached_property
    def curves(self) -> Evaluation:
        """Methods with a clearance over the reporting scenes at others, as its ``curves``."""
        methods = self.installed(*CURVED)
        parts = [
            self._shared(
                f'{method} at other clearances',
                evaluate_scene,
                self._bags[REPORT],
                RunOptions([method], CONFIG, repeat=1, curve=True),
            )
            for method in methods
        ]
        return side_by_side([merged(part, 0) for part in parts])

    @functools.cache  # noqa: B019
    def gravity(self, kind: str) -> list[SceneGravity]:
        """Run the hybrid with the vertical told and with the vertical estimated."""
        return self._shared('vertical told', study_gravity, self._bags[kind], CONFIG)

    @functools.cache  # noqa: B019
    def disparity(self, kind: str) -> list[SceneDisparity]:
        """Measure the errors of the disparity."""
        return self._shared('disparity', study_disparity, self._bags[kind], CONFIG)

    @functools.cache  # noqa: B019
    def lenses(self, kind: str) -> list[SceneLenses]:
        """Look through lenses that bend."""
        frames = self._shared('bent lenses', study_lenses, self._bags[kind], CONFIG)
        return [frame for scene in frames for frame in scene]

    @functools.cache  # noqa: B019
    def reliability(self, kind: str) -> list[JudgedObstacles]:
        """Judge which obstacles are real."""
        return self._shared('reliability', study_reliability, self._bags[kind], CONFIG)

    @cached_property
    def motorcycle(self) -> Errors:
        """Errors of the disparity of the Middlebury pair."""
        return pair_errors(load_motorcycle(), CONFIG)

    @functools.cache  # noqa: B019
    def _timed(self, method: str) -> Evaluation:
        pictures = WORST if method == OWN else 0
        options = RunOptions([method], CONFIG, worst_pictures=pictures)
        return merged(list(alone(f'{method}, timed', self._bags[REPORT], options)), pictures)

    @functools.cache  # noqa: B019
    def _sample(self, method: str) -> Evaluation:
        return merged(list(alone(method, [SAMPLE], RunOptions([method], CONFIG))), 0)

    @functools.cache  # noqa: B019
    def _untimed(self, kind: str, method: str) -> Evaluation:
        # Faults come with pictures.
        pictures = 1 if method == OWN else 0
        options = RunOptions([method], CONFIG, repeat=1, worst_pictures=pictures)
        return merged(self._shared(method, evaluate_scene, self._bags[kind], options), 0)

    def _shared(
        self, what: str, study: Callable[[Path, Any], T], bags: Sequence[Path], options: Any
    ) -> list[T]:
        """Study scenes, each in one of the processes, in order."""
        started = time.monotonic()
        futures = [self._pool.submit(study, bag, options) for bag in bags]
        done = [future.result() for future in futures]
        tell(what, len(bags), started)
        return done


def alone(what: str, bags: Sequence[Path], options: RunOptions) -> Iterable[Evaluation]:
    """Run methods over scenes in this process."""
    started = time.monotonic()
    for bag in bags:
        yield evaluate_scene(bag, options)
    tell(what, len(bags), started)


def side_by_side(evaluations: Sequence[Evaluation]) -> Evaluation:
    """Put evaluations of different methods together, in this order."""
    return merged(evaluations, WORST)


def tell(what: str, scenes: int, started: float) -> None:
    """Say what took how long."""
    print(f'{what}: {scenes} scenes in {time.monotonic() - started:.0f} s', file=sys.stderr)
