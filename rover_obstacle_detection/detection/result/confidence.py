"""How sure it is that an obstacle is one: a logistic model over what speaks for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.images.edges import REDUCTION, edge_strength
from rover_obstacle_detection.detection.result.confidence_coefficients import COEFFICIENTS
from rover_obstacle_detection.detection.result.cue import Cue

FEATURES = (
    'intercept',
    'log_excess',
    'log_pixels',
    'measured_share',
    'agreement',
    'log_contrast',
    'log_raggedness',
    'log_disparity_noise',
    'rock_log_odds',
    'ground_log_pixels',
    'ground_log_noise',
    *(f'{cue.name.lower()}_share' for cue in Cue if cue.name),
)
"""Names of the columns of `ObstacleEvidence.features`."""

STRENGTHEN = (
    'log_excess',
    'log_pixels',
    'measured_share',
    'agreement',
    'log_contrast',
    'rock_log_odds',
    'ground_log_pixels',
)
WEAKEN = ('log_raggedness', 'log_disparity_noise', 'ground_log_noise')
"""Features that the confidence never falls with, and those that it never rises with."""

# What clean pairs show, so that noise as modelled is taken as it is there.
TYPICAL_NOISE_PX = 0.1
SPACING_PX = 2
MAX_DIFFERENCE_PX = 4.0
# A change of grey level that no outline shows up in.
FAINT_LEVELS = 0.2
# Noise, over the step, below which less makes no slope surer.
LEAST_NOISE_SHARE = 0.05
# The outline filter is never quite sure.
SUREST = 0.99


@dataclass(frozen=True, eq=False)
class ObstacleEvidence:
    """What speaks for and against each of n obstacles, measured over its pixels.

    Parameters
    ----------
    excess : ndarray of float64, shape (n,)
        How far its pixels above the rover's step exceed it on average, in standard deviations of
        that average; 0 without such pixels.
    pixels : ndarray of float64, shape (n,)
    measured_share : ndarray of float64, shape (n,)
        Share of its pixels with 3D.
    agreement : ndarray of float64, shape (n,)
        Share of its pixels with two or more cues.
    contrast : ndarray of float64, shape (n,)
        How much faster the grey level changes along its outline than in most of the image.
    raggedness : ndarray of float64, shape (n,)
        Pixels of its outline over the square root of all: the larger, the less compact.
    rock_log_odds : ndarray of float64, shape (n,)
        Mean of the outline filter's log odds, counted over what is an obstacle for its height or
        looks.
    ground_share : ndarray of float64, shape (n,)
        Share of its pixels that are ground too steep or too low.
    noise_share : ndarray of float64, shape (n,)
        Mean noise of its pixels' heights over the rover's step; 0 without 3D.
    cue_shares : ndarray of float64, shape (n, cues)
        Share of its pixels with each of the cues, in the order of `Cue`.
    disparity_noise_px : float
        As the whole pair shows it.
    """

    excess: NDArray[np.float64]
    pixels: NDArray[np.float64]
    measured_share: NDArray[np.float64]
    agreement: NDArray[np.float64]
    contrast: NDArray[np.float64]
    raggedness: NDArray[np.float64]
    rock_log_odds: NDArray[np.float64]
    ground_share: NDArray[np.float64]
    noise_share: NDArray[np.float64]
    cue_shares: NDArray[np.float64]
    disparity_noise_px: float

    def features(self) -> NDArray[np.float64]:
        """Return what the model is linear in, shape (n, features): see `FEATURES`."""
        return np.column_stack(
            (
                np.ones_like(self.pixels),
                np.log1p(self.excess),
                np.log(self.pixels),
                self.measured_share,
                self.agreement,
                np.log(self.contrast),
                np.log(self.raggedness),
                np.full_like(self.pixels, np.log(self.disparity_noise_px)),
                self.rock_log_odds,
                self.ground_share * np.log(self.pixels),
                self.ground_share * np.log(self.noise_share + LEAST_NOISE_SHARE),
                self.cue_shares,
            )
        )


def measure_evidence(
    numbers: NDArray[np.int32],
    *,
    grey: NDArray[np.uint8],
    disparity: NDArray[np.float32],
    height_m: NDArray[np.float32],
    noise_m: NDArray[np.float32],
    rock_probability: NDArray[np.float32],
    cues: NDArray[np.uint8],
    max_step_m: float,
    window_px: int,
) -> ObstacleEvidence:
    """Measure what speaks for each numbered obstacle.

    Parameters
    ----------
    numbers : ndarray of int32, shape (height, width)
        Number of each pixel's obstacle, 1 to n; 0 where there is none.
    grey : ndarray of uint8, shape (height, width)
        Left image.
    disparity : ndarray of float32, shape (height, width)
        Pixels; 0 where there is no match.
    height_m : ndarray of float32, shape (height, width)
        Above the local ground; NaN where none.
    noise_m : ndarray of float32, shape (height, width)
        Standard deviation of the height of a single pixel.
    rock_probability : ndarray of float32, shape (height, width)
        Of the outline filter; NaN where it was not asked.
    cues : ndarray of uint8, shape (height, width)
        Flags of `Cue`.
    max_step_m : float
        What the rover can take.
    window_px : int
        Side of the matching block, pixels.

    Notes
    -----
    Pixels within a matching block share their noise, so that n pixels are worth about
    ``n / window_px**2`` independent ones, and at least one. The noise grows with what the
    disparities of the pair show.
    """
    where = np.flatnonzero(numbers)
    owner = numbers.ravel()[where] - 1
    count = int(numbers.max(initial=0))
    pixels = np.bincount(owner, minlength=count).astype(np.float64)

    def share(which: NDArray[np.bool_]) -> NDArray[np.float64]:
        return np.bincount(owner[which], minlength=count) / pixels

    own_height, own_noise = height_m.ravel()[where], noise_m.ravel()[where]
    measured = np.isfinite(own_height) & np.isfinite(own_noise) & (disparity.ravel()[where] > 0)
    own_cues = cues.ravel()[where]
    by_filter = (own_cues & np.uint8(Cue.HEIGHT | Cue.GREY_LEVEL)) > 0
    odds = _log_odds(rock_probability.ravel()[where[by_filter]])
    noise_px = seen_disparity_noise_px(disparity)
    outline = _is_outline(numbers).ravel()[where]
    return ObstacleEvidence(
        excess=_excess(
            owner[measured],
            own_height[measured] - np.float32(max_step_m),
            own_noise[measured] * np.float32(noise_px / TYPICAL_NOISE_PX),
            count,
            window_px**2,
        ),
        pixels=pixels,
        measured_share=share(measured),
        agreement=share((own_cues & (own_cues - 1)) > 0),
        contrast=_contrast(owner[outline], where[outline], grey, count),
        raggedness=np.maximum(share(outline) * np.sqrt(pixels), 1.0),
        rock_log_odds=np.bincount(owner[by_filter], weights=odds, minlength=count) / pixels,
        ground_share=share((own_cues & np.uint8(Cue.SLOPE | Cue.DROP)) > 0),
        noise_share=_mean_where(owner[measured], own_noise[measured], count) / max_step_m,
        cue_shares=np.column_stack([share((own_cues & np.uint8(cue)) > 0) for cue in Cue]),
        disparity_noise_px=noise_px,
    )


def seen_disparity_noise_px(disparity: NDArray[np.float32]) -> float:
    """Estimate the noise of disparity from how it differs from that beside it, pixels.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        0 where there is no match.

    Returns
    -------
    float
        Mean deviation from the mean of both neighbours, a few pixels to the left and right, as the
        standard deviation that independent noise of that size has; structure of the scene adds to
        it. Typical noise where nothing is matched.
    """
    # A third of the rows is enough for a mean.
    width = max(disparity.shape[1] - 2 * SPACING_PX, 0)
    left, middle, right = (
        disparity[::3, start : start + width] for start in (0, SPACING_PX, 2 * SPACING_PX)
    )
    matched = (left > 0) & (middle > 0) & (right > 0)
    difference = np.abs(left + right - 2 * middle)[matched]
    if not difference.size:
        return TYPICAL_NOISE_PX
    # Of normal noise, the second difference has six times the variance, and its mean size is 0.8
    # standard deviations.
    mean = float(np.minimum(difference, MAX_DIFFERENCE_PX).mean()) / (0.8 * 6**0.5)
    return max(mean, TYPICAL_NOISE_PX / 10)


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


def _log_odds(probability: NDArray[np.float32]) -> NDArray[np.float64]:
    """Log odds of limited size; 0 where the probability is not known."""
    even = np.nan_to_num(probability.astype(np.float64), nan=0.5)
    limited = np.clip(even, 1 - SUREST, SUREST)
    return np.asarray(np.log(limited / (1 - limited)))


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


def _mean_where(
    owner: NDArray[np.int32], values: NDArray[np.float32], count: int
) -> NDArray[np.float64]:
    pixels = np.bincount(owner, minlength=count)
    return np.asarray(np.bincount(owner, values, minlength=count) / np.maximum(pixels, 1))


def _is_outline(numbers: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Tell the pixels of obstacles with ground beside them; the image's border is none."""
    free = np.pad(numbers == 0, 1)
    beside = free[:-2, 1:-1] | free[2:, 1:-1] | free[1:-1, :-2] | free[1:-1, 2:]
    return np.asarray(beside & (numbers > 0))


def _contrast(
    owner: NDArray[np.int32], where: NDArray[np.intp], grey: NDArray[np.uint8], count: int
) -> NDArray[np.float64]:
    """Compare the edges along outlines with those of the image; 1 without an outline."""
    edges = edge_strength(grey)
    row, column = np.divmod(where, grey.shape[1])
    along = edges[row // REDUCTION, column // REDUCTION]
    pixels = np.bincount(owner, minlength=count)
    sums = np.bincount(owner, along, minlength=count)
    usual = float(np.median(edges[::2, ::2]))
    mean = np.full(count, usual)
    np.divide(sums, pixels, out=mean, where=pixels > 0)
    return np.asarray((mean + FAINT_LEVELS) / (usual + FAINT_LEVELS))
