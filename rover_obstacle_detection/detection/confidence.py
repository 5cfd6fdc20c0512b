"""How sure it is that an obstacle is one: a logistic model over what speaks for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.confidence_coefficients import COEFFICIENTS
from rover_obstacle_detection.detection.cue import Cue

FEATURES = (
    'intercept',
    'log_excess',
    'log_pixels',
    'log_range',
    'measured_share',
    'agreement',
    'region_fit',
    *(f'{cue.name.lower()}_share' for cue in Cue if cue.name),
)
"""Names of the columns of `ObstacleEvidence.features`."""

MOSTLY = 0.5


@dataclass(frozen=True, eq=False)
class ObstacleEvidence:
    """What speaks for each of n obstacles, measured over its pixels.

    Parameters
    ----------
    excess : ndarray of float64, shape (n,)
        How far its pixels above the rover's step exceed it on average, in standard deviations of
        that average; 0 without such pixels.
    pixels : ndarray of float64, shape (n,)
    range_m : ndarray of float64, shape (n,)
        Mean distance of its points from the left eye, metres; NaN without 3D.
    measured_share : ndarray of float64, shape (n,)
        Share of its pixels with 3D.
    agreement : ndarray of float64, shape (n,)
        Share of its pixels with two or more cues.
    region_fit : ndarray of float64, shape (n,)
        Share of its pixels in regions more than half of which is obstacle.
    cue_shares : ndarray of float64, shape (n, cues)
        Share of its pixels with each of the cues, in the order of `Cue`.
    """

    excess: NDArray[np.float64]
    pixels: NDArray[np.float64]
    range_m: NDArray[np.float64]
    measured_share: NDArray[np.float64]
    agreement: NDArray[np.float64]
    region_fit: NDArray[np.float64]
    cue_shares: NDArray[np.float64]

    def features(self) -> NDArray[np.float64]:
        """Return what the model is linear in, shape (n, features): see `FEATURES`."""
        # Without 3D the missing share stands for the missing range.
        log_range = np.nan_to_num(np.log(self.range_m))
        return np.column_stack(
            (
                np.ones_like(self.pixels),
                np.log1p(self.excess),
                np.log(self.pixels),
                log_range,
                self.measured_share,
                self.agreement,
                self.region_fit,
                self.cue_shares,
            )
        )


def measure_evidence(
    numbers: NDArray[np.int32],
    *,
    points: NDArray[np.float32],
    height_m: NDArray[np.float32],
    noise_m: NDArray[np.float32],
    cues: NDArray[np.uint8],
    regions: NDArray[np.int32],
    max_step_m: float,
    window_px: int,
) -> ObstacleEvidence:
    """Measure what speaks for each numbered obstacle.

    Parameters
    ----------
    numbers : ndarray of int32, shape (height, width)
        Number of each pixel's obstacle, 1 to n; 0 where there is none.
    points : ndarray of float32, shape (height, width, 3)
        Metres; NaN where none.
    height_m : ndarray of float32, shape (height, width)
        Above the local ground; NaN where none.
    noise_m : ndarray of float32, shape (height, width)
        Standard deviation of the height of a single pixel.
    cues : ndarray of uint8, shape (height, width)
        Flags of `Cue`.
    regions : ndarray of int32, shape (height, width)
        Number of each pixel's mean-shift region.
    max_step_m : float
        What the rover can take.
    window_px : int
        Side of the matching block, pixels.

    Notes
    -----
    Pixels within a matching block share their noise, so that n pixels are worth about
    ``n / window_px**2`` independent ones, and at least one.
    """
    where = np.flatnonzero(numbers)
    owner = numbers.ravel()[where] - 1
    count = int(numbers.max(initial=0))
    pixels = np.bincount(owner, minlength=count).astype(np.float64)

    def share(which: NDArray[np.bool_]) -> NDArray[np.float64]:
        return np.bincount(owner[which], minlength=count) / pixels

    own_height, own_noise = height_m.ravel()[where], noise_m.ravel()[where]
    own_cues, own_region = cues.ravel()[where], regions.ravel()[where]
    distance_m = np.linalg.norm(points.reshape(-1, 3)[where], axis=1)
    measured = np.isfinite(own_height) & np.isfinite(own_noise) & np.isfinite(distance_m)
    flags = np.array(list(Cue), np.uint8)
    has_cue = (own_cues[:, np.newaxis] & flags) > 0
    filled = _filled_regions(regions, own_region)
    return ObstacleEvidence(
        excess=_excess(
            owner[measured],
            own_height[measured] - np.float32(max_step_m),
            own_noise[measured],
            count,
            window_px**2,
        ),
        pixels=pixels,
        range_m=_means(owner[measured], distance_m[measured], count),
        measured_share=share(measured),
        agreement=share(has_cue.sum(axis=1) >= 2),
        region_fit=share(filled[own_region]),
        cue_shares=np.column_stack([share(column) for column in has_cue.T]),
    )


def confidence(evidence: ObstacleEvidence, method: str) -> NDArray[np.float32]:
    """Turn what speaks for obstacles into how sure it is that they are some.

    Parameters
    ----------
    evidence : ObstacleEvidence
        Of n obstacles.
    method : str
        The detection method that found them.

    Returns
    -------
    ndarray of float32, shape (n,)
        0 to 1: the share of such obstacles that were real in labelled scenes.
    """
    weights = np.array([COEFFICIENTS[method][name] for name in FEATURES])
    return np.asarray(logistic(evidence.features() @ weights), np.float32)


def logistic(log_odds: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn log odds into probabilities."""
    return np.asarray(0.5 * (1 + np.tanh(0.5 * log_odds)))


def _excess(
    owner: NDArray[np.int32],
    excess_m: NDArray[np.float32],
    noise_m: NDArray[np.float32],
    count: int,
    window_pixels: int,
) -> NDArray[np.float64]:
    over = excess_m > 0
    owner = owner[over]
    pixels = np.bincount(owner, minlength=count)
    samples = np.maximum(pixels / window_pixels, 1)
    excess_sum = np.bincount(owner, excess_m[over], minlength=count)
    noise_sum = np.bincount(owner, noise_m[over], minlength=count)
    ratio = np.zeros(count)
    np.divide(excess_sum, noise_sum, out=ratio, where=noise_sum > 0)
    return np.asarray(ratio * np.sqrt(samples))


def _means(
    owner: NDArray[np.int32], values: NDArray[np.float32], count: int
) -> NDArray[np.float64]:
    number = np.bincount(owner, minlength=count)
    sums = np.bincount(owner, values, minlength=count)
    means = np.full(count, np.nan)
    np.divide(sums, number, out=means, where=number > 0)
    return means


def _filled_regions(
    regions: NDArray[np.int32], on_obstacles: NDArray[np.int32]
) -> NDArray[np.bool_]:
    """Tell of each region number whether obstacles take up most of the region."""
    pixels = np.bincount(regions.ravel())
    return np.asarray(np.bincount(on_obstacles, minlength=len(pixels)) > MOSTLY * pixels)
