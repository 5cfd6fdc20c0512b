"""Fit the confidence of obstacles to labelled recordings, and show how far it can be trusted.

    python scripts/calibrate_confidence.py BAG...            # fit, and print
    python scripts/calibrate_confidence.py BAG... --write    # and put it into the package

Recordings named ``report_*`` or ``drawn_*`` are only looked at, all others are fitted. An obstacle
is real where at least half of its counted pixels are labelled rock, slope or drop; one with less
than half of its pixels counted is left out. A good detector has few false obstacles to learn from,
so that each pair that is fitted is also fitted as a worse camera would have taken it:
`VARIATIONS`. The reported recordings are taken as they are.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from studies.reliability import (
    JudgedObstacles,
    judge,
    reliability_table,
)

from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.bags.stereo import BadFrame
from rover_obstacle_detection.detection.config import METHODS, DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.result import confidence_coefficients
from rover_obstacle_detection.detection.result.confidence import (
    FEATURES,
    STRENGTHEN,
    WEAKEN,
    logistic,
)
from rover_obstacle_detection.errors import ObstacleDetectionError
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.offline.evaluate import BagOptions, labelled_frames
from rover_obstacle_detection.offline.labelled_bag import find_truth_topics

# The best Brier score of the fitted scenes as recorded, each by a fit to the others, of 0.1, 1, 3,
# 10, 30 and 100; from 0.1 to 30 it hardly matters.
RIDGE = 10.0
COEFFICIENTS_FILE = Path(str(confidence_coefficients.__file__))

Image = NDArray[Any]
Random = np.random.Generator
Floats = NDArray[np.float64]


def noisy(image: Image, gain: float, noise: float, random: Random) -> Image:
    """Darken an image, and add noise; both as shares of the full scale."""
    full = np.iinfo(image.dtype).max
    spoilt = image.astype(np.float32) * gain + random.normal(0, noise * full, image.shape)
    return np.clip(np.rint(spoilt), 0, full).astype(image.dtype)


def shifted(image: Image, rows: float) -> Image:
    """Shift an image down, as an error of the rectification does."""
    motion = np.array([[1, 0, 0], [0, 1, rows]], np.float32)
    size = image.shape[1], image.shape[0]
    return np.asarray(cv2.warpAffine(image, motion, size, borderMode=cv2.BORDER_REPLICATE))


def blurred(image: Image, sigma_px: float) -> Image:
    """Put an image out of focus."""
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px))


VARIATIONS: dict[str, Callable[[Image, Image, Random], tuple[Image, Image]]] = {
    'as recorded': lambda left, right, random: (left, right),
    'noise of 3 %': lambda left, right, random: (
        noisy(left, 1, 0.03, random),
        noisy(right, 1, 0.03, random),
    ),
    'dark': lambda left, right, random: (
        noisy(left, 0.15, 0.01, random),
        noisy(right, 0.15, 0.01, random),
    ),
    'rows off by 0.7': lambda left, right, random: (left, shifted(right, 0.7)),
    'rows off by 1.5': lambda left, right, random: (left, shifted(right, 1.5)),
    'one eye blurred': lambda left, right, random: (left, blurred(right, 2)),
}
REPORTED = ('report_', 'drawn_')
AS_RECORDED = ('as recorded',)


@dataclass(frozen=True, eq=False)
class Sample:
    """The obstacles of one pair that labels can judge.

    Parameters
    ----------
    scene, variation : str
    features : ndarray of float64, shape (n, features)
    real : ndarray of bool, shape (n,)
    """

    scene: str
    variation: str
    features: Floats
    real: NDArray[np.bool_]


def main(arguments: Sequence[str] | None = None) -> None:
    """Collect, fit, print, and write if asked to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('bags', nargs='+', type=Path, metavar='BAG', help='labelled recording')
    parser.add_argument('--method', choices=METHODS, default='hybrid')
    parser.add_argument(
        '--write', action='store_true', help=f'put the coefficients into {COEFFICIENTS_FILE.name}'
    )
    options = parser.parse_args(arguments)
    reported = [path for path in options.bags if path.resolve().name.startswith(REPORTED)]
    tuning = [path for path in options.bags if path not in reported]
    if not tuning:
        parser.error(f'nothing to fit: every recording is named {" or ".join(REPORTED)}')
    # What the confidence would leave out has to be seen to know how sure it is.
    config = DetectorConfig(method=options.method, min_confidence=0.0)
    samples = collect(tuning, config, tuple(VARIATIONS))
    real = np.concatenate([np.zeros(0, bool), *(each.real for each in samples)])
    if real.all() or not real.any():
        sys.exit(f'{len(real)} obstacles judged, {real.sum()} of them real: some of both needed')
    weights = fit(samples)
    for name, weight in zip(FEATURES, weights, strict=True):
        print(f'{name:24}{weight:9.4f}')
    scenes = len({each.scene for each in samples})
    fitted = f'{options.method}, {scenes} fitted scenes'
    show(f'{fitted}, with all variations', judged(samples, weights))
    recorded = [each for each in samples if each.variation in AS_RECORDED]
    show(f'{fitted}, as recorded', judged(recorded, weights))
    show(f'{fitted}, as recorded, each by a fit to the others', judged_by_others(samples))
    if reported:
        others = collect(reported, config, AS_RECORDED)
        title = f'{options.method}, {len({each.scene for each in others})} reported scenes'
        show(title, judged(others, weights))
    if options.write:
        known = confidence_coefficients.COEFFICIENTS
        COEFFICIENTS_FILE.write_text(file_text({**known, options.method: by_name(weights)}))
        print(f'\nwritten: {COEFFICIENTS_FILE}')


def collect(
    paths: Sequence[Path], config: DetectorConfig, variations: Sequence[str]
) -> list[Sample]:
    """Detect and judge obstacles; a recording that cannot be read is named and left out."""
    samples = []
    for path in paths:
        try:
            for frame in frames_of(path):
                samples += [sample(path.name, frame, config, name) for name in variations]
        except ObstacleDetectionError as error:
            print(f'left out: {error}', file=sys.stderr)
    return samples


def frames_of(path: Path) -> Iterator[LabelledFrame]:
    """Read the labelled frames of a recording."""
    with open_bag(path) as bag:
        truth = find_truth_topics(bag)
        frames, _ = labelled_frames(bag, truth, BagOptions())
        for frame in frames:
            if isinstance(frame, BadFrame):
                print(f'left out: {path}: {frame.reason}', file=sys.stderr)
            else:
                yield frame


def sample(scene: str, frame: LabelledFrame, config: DetectorConfig, variation: str) -> Sample:
    """Detect the obstacles of a pair, and judge them."""
    random = np.random.default_rng(frame.stamp_ns)
    pair = VARIATIONS[variation](frame.left, frame.right, random)
    detection = Detector(frame.camera, config).detect(*pair)
    is_real, is_judged = judge(detection.obstacle_numbers, frame.labels)
    features = detection.evidence.features()
    return Sample(scene, variation, features[is_judged], is_real[is_judged])


def fit(samples: Sequence[Sample], ridge: float = RIDGE) -> Floats:
    """Fit the weights of the logistic model by maximum likelihood.

    Parameters
    ----------
    samples : sequence of Sample
    ridge : float
        Penalty on the squares of the weights of features of unit spread.

    Returns
    -------
    ndarray of float64, shape (features,)

    Notes
    -----
    A feature that can only speak for an obstacle, or only against it, and whose weight would have
    the other sign, is left out: the one with the largest such weight first, then the fit is
    repeated.
    """
    features = np.concatenate([each.features for each in samples])
    real = np.concatenate([each.real for each in samples])
    spread = features.std(axis=0)
    varies = spread > 1e-9
    spread[~varies] = 1
    centre = np.where(varies, features.mean(axis=0), 0)
    scaled = (features - centre) / spread
    used = varies.copy()
    used[0] = True
    sign = np.array([(name in STRENGTHEN) - (name in WEAKEN) for name in FEATURES])
    while True:
        weights = np.zeros(len(FEATURES))
        weights[used] = reweighted_least_squares(scaled[:, used], real, ridge)
        wrong = weights * sign
        if wrong.min() >= 0:
            break
        used[wrong.argmin()] = False
    weights /= spread
    weights[0] -= centre @ weights
    return weights


def reweighted_least_squares(features: Floats, real: NDArray[np.bool_], ridge: float) -> Floats:
    """Maximise the penalised likelihood by Newton's method; the first feature is the constant."""
    penalty = np.full(features.shape[1], ridge)
    penalty[0] = 0
    weights = np.zeros(features.shape[1])
    for _ in range(100):
        probability = logistic(features @ weights)
        curvature = (features.T * (probability * (1 - probability))) @ features
        gradient = features.T @ (real - probability) - penalty * weights
        step = np.linalg.solve(curvature + np.diag(penalty + 1e-9), gradient)
        weights = weights + step
        if np.abs(step).max() < 1e-9:
            break
    return np.asarray(weights)


def judged(samples: Sequence[Sample], weights: Floats) -> JudgedObstacles:
    """Give the obstacles of samples the confidence that the weights make."""
    nothing = JudgedObstacles(np.zeros(0), np.zeros(0, bool))
    parts = (JudgedObstacles(logistic(each.features @ weights), each.real) for each in samples)
    return sum(parts, nothing)


def judged_by_others(samples: Sequence[Sample]) -> JudgedObstacles:
    """Judge the obstacles of each scene, as recorded, by a fit to all other scenes."""
    found = JudgedObstacles(np.zeros(0), np.zeros(0, bool))
    for scene in sorted({each.scene for each in samples}):
        others = [each for each in samples if each.scene != scene]
        own = [each for each in samples if each.scene == scene and each.variation in AS_RECORDED]
        if others:
            found += judged(own, fit(others))
    return found


def show(title: str, obstacles: JudgedObstacles) -> None:
    """Print the table of reliability, and the figures that sum it up."""
    table = reliability_table(title, obstacles)
    figures = {
        'calibration error': obstacles.calibration_error(),
        'Brier score': obstacles.brier_score(),
        'separation': obstacles.separation(),
    }
    known = [f'{name} {value:.3f}' for name, value in figures.items() if value is not None]
    print(f'\n{table.title}\n\n{table.as_markdown()}\n{", ".join(known)}')


def by_name(weights: Floats) -> dict[str, float]:
    """Name the weights, rounded to what matters."""
    # Adding 0.0 turns a negative zero into a plain one.
    return {
        name: round(float(each), 4) + 0.0 for name, each in zip(FEATURES, weights, strict=True)
    }


def file_text(coefficients: Mapping[str, Mapping[str, float]]) -> str:
    """Write the module that holds the coefficients."""
    lines = []
    for method in METHODS:
        lines.append(f'    {method!r}: {{')
        lines += [f'        {name!r}: {coefficients[method][name]},' for name in FEATURES]
        lines.append('    },')
    begin, _, _ = COEFFICIENTS_FILE.read_text(encoding='utf-8').partition('= {\n')
    return '\n'.join((f'{begin}= {{', *lines, '}', ''))


if __name__ == '__main__':
    main()
