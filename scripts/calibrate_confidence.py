"""Calibrate the confidence of obstacles on labelled bags, and print its reliability.

    python scripts/calibrate_confidence.py BAG...            # fit and print
    python scripts/calibrate_confidence.py BAG... --write    # also update the package

Bags named ``report_*`` or ``drawn_*`` only test the fit; all others are fitted. An obstacle is
real if at least half of its counted pixels are labelled rock, slope or drop. One with less than
half of its pixels counted is ignored. A good detector has few false obstacles to learn from, so
every fitted pair is also fitted with degraded images: `VARIATIONS`. Test bags are not degraded.
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
from studies.reliability import JudgedObstacles, judge, reliability_table

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

# Best cross-validated Brier score of 0.1, 1, 3, 10, 30 and 100; from 0.1 to 30 it hardly matters.
RIDGE = 10.0
# Newton's method: limits on steps, and the change of weights that counts as converged.
MAX_STEPS = 100
CONVERGED = 1e-9
COEFFICIENTS_FILE = Path(str(confidence_coefficients.__file__))

Image = NDArray[Any]
Random = np.random.Generator
Floats = NDArray[np.float64]


def noisy(image: Image, gain: float, noise: float, random: Random) -> Image:
    """Scale an image and add Gaussian noise, its sigma a share of full scale."""
    full = np.iinfo(image.dtype).max
    degraded = image.astype(np.float32) * gain + random.normal(0, noise * full, image.shape)
    return np.clip(np.rint(degraded), 0, full).astype(image.dtype)


def shifted(image: Image, rows: float) -> Image:
    """Shift an image down, like a rectification error."""
    motion = np.array([[1, 0, 0], [0, 1, rows]], np.float32)
    size = image.shape[1], image.shape[0]
    return np.asarray(cv2.warpAffine(image, motion, size, borderMode=cv2.BORDER_REPLICATE))


def blurred(image: Image, sigma_px: float) -> Image:
    """Defocus an image."""
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
    'right image blurred': lambda left, right, random: (left, blurred(right, 2)),
}
TEST_PREFIXES = ('report_', 'drawn_')
AS_RECORDED = ('as recorded',)


@dataclass(frozen=True, eq=False)
class Sample:
    """Features of the obstacles in one pair that the labels can judge.

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
    """Collect samples, fit, print the tables; write the coefficients on request."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('bags', nargs='+', type=Path, metavar='BAG', help='labelled bag')
    parser.add_argument('--method', choices=METHODS, default='hybrid')
    parser.add_argument(
        '--write', action='store_true', help=f'write the coefficients to {COEFFICIENTS_FILE.name}'
    )
    options = parser.parse_args(arguments)
    test = [path for path in options.bags if path.resolve().name.startswith(TEST_PREFIXES)]
    tuning = [path for path in options.bags if path not in test]
    if not tuning:
        parser.error(f'nothing to fit: all bag names start with {" or ".join(TEST_PREFIXES)}')
    # Obstacles of low confidence must be detected to be calibrated.
    config = DetectorConfig(method=options.method, min_confidence=0.0)
    samples = collect(tuning, config, tuple(VARIATIONS))
    real = np.concatenate([np.zeros(0, bool), *(each.real for each in samples)])
    if real.all() or not real.any():
        sys.exit(
            f'{real.sum()} of {len(real)} obstacles are real: the fit needs real and false ones'
        )
    weights = fit(samples)
    for name, weight in zip(FEATURES, weights, strict=True):
        print(f'{name:24}{weight:9.4f}')
    scenes = len({each.scene for each in samples})
    fitted = f'{options.method}, {scenes} fitted scenes'
    show(f'{fitted}, with all variations', judged(samples, weights))
    recorded = [each for each in samples if each.variation in AS_RECORDED]
    show(f'{fitted}, as recorded', judged(recorded, weights))
    show(f'{fitted}, as recorded, cross-validated', cross_validated(samples))
    if test:
        tested = collect(test, config, AS_RECORDED)
        title = f'{options.method}, {len({each.scene for each in tested})} test scenes'
        show(title, judged(tested, weights))
    if options.write:
        known = confidence_coefficients.COEFFICIENTS
        COEFFICIENTS_FILE.write_text(file_text({**known, options.method: by_name(weights)}))
        print(f'\ncoefficients written to {COEFFICIENTS_FILE}')


def collect(
    paths: Sequence[Path], config: DetectorConfig, variations: Sequence[str]
) -> list[Sample]:
    """Detect and judge the obstacles of bags; report and skip unreadable bags."""
    samples = []
    for path in paths:
        try:
            for frame in frames_of(path):
                samples += [sample(path.name, frame, config, name) for name in variations]
        except ObstacleDetectionError as error:
            print(f'skipped: {error}', file=sys.stderr)
    return samples


def frames_of(path: Path) -> Iterator[LabelledFrame]:
    """Read the labelled frames of a bag."""
    with open_bag(path) as bag:
        truth = find_truth_topics(bag)
        frames, _ = labelled_frames(bag, truth, BagOptions())
        for frame in frames:
            if isinstance(frame, BadFrame):
                print(f'skipped: {path}: {frame.reason}', file=sys.stderr)
            else:
                yield frame


def sample(scene: str, frame: LabelledFrame, config: DetectorConfig, variation: str) -> Sample:
    """Detect and judge the obstacles of a frame, degraded by a variation."""
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
        L2 penalty on the weights of the standardised features.

    Returns
    -------
    ndarray of float64, shape (features,)

    Notes
    -----
    Some features can only strengthen or only weaken an obstacle. If their weights have the wrong
    sign, the feature with the worst one is dropped and the fit repeated.
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
    """Maximise the penalised likelihood with Newton's method; the first feature is constant."""
    penalty = np.full(features.shape[1], ridge)
    penalty[0] = 0
    weights = np.zeros(features.shape[1])
    for _ in range(MAX_STEPS):
        probability = logistic(features @ weights)
        curvature = (features.T * (probability * (1 - probability))) @ features
        gradient = features.T @ (real - probability) - penalty * weights
        step = np.linalg.solve(curvature + np.diag(penalty + 1e-9), gradient)
        weights = weights + step
        if np.abs(step).max() < CONVERGED:
            break
    return np.asarray(weights)


def judged(samples: Sequence[Sample], weights: Floats) -> JudgedObstacles:
    """Compute the confidence of the obstacles in samples."""
    nothing = JudgedObstacles(np.zeros(0), np.zeros(0, bool))
    parts = (JudgedObstacles(logistic(each.features @ weights), each.real) for each in samples)
    return sum(parts, nothing)


def cross_validated(samples: Sequence[Sample]) -> JudgedObstacles:
    """Compute the confidence of each scene as recorded with a fit to all other scenes."""
    found = JudgedObstacles(np.zeros(0), np.zeros(0, bool))
    for scene in sorted({each.scene for each in samples}):
        others = [each for each in samples if each.scene != scene]
        own = [each for each in samples if each.scene == scene and each.variation in AS_RECORDED]
        if others:
            found += judged(own, fit(others))
    return found


def show(title: str, obstacles: JudgedObstacles) -> None:
    """Print the reliability table and its summary figures."""
    table = reliability_table(title, obstacles)
    figures = {
        'calibration error': obstacles.calibration_error(),
        'Brier score': obstacles.brier_score(),
        'separation': obstacles.separation(),
    }
    known = [f'{name} {value:.3f}' for name, value in figures.items() if value is not None]
    print(f'\n{table.title}\n\n{table.as_markdown()}\n{", ".join(known)}')


def by_name(weights: Floats) -> dict[str, float]:
    """Map feature names to rounded weights."""
    # Adding 0.0 turns -0.0 into 0.0.
    return {
        name: round(float(each), 4) + 0.0 for name, each in zip(FEATURES, weights, strict=True)
    }


def file_text(coefficients: Mapping[str, Mapping[str, float]]) -> str:
    """Format the module that holds the coefficients."""
    lines = []
    for method in METHODS:
        lines.append(f'    {method!r}: {{')
        lines += [f'        {name!r}: {coefficients[method][name]},' for name in FEATURES]
        lines.append('    },')
    begin, _, _ = COEFFICIENTS_FILE.read_text(encoding='utf-8').partition('= {\n')
    return '\n'.join((f'{begin}= {{', *lines, '}', ''))


if __name__ == '__main__':
    main()
