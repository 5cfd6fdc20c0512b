"""Evidence for each obstacle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.images.edges import edge_strength
from rover_obstacle_detection.detection.images.parameters import ImageParameters
from rover_obstacle_detection.detection.result.cue import Cue
from rover_obstacle_detection.detection.result.parameters import ResultParameters

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ObstacleEvidence:
    """Evidence for each of n obstacles, measured over its pixels.

    Parameters
    ----------
    excess : ndarray of float64, shape (n,)
        Mean height above the rover's step of the pixels that exceed it, in standard deviations of
        that mean; 0 without such pixels.
    pixels : ndarray of float64, shape (n,)
        Number of pixels.
    measured_share : ndarray of float64, shape (n,)
        Share of pixels with 3D.
    agreement : ndarray of float64, shape (n,)
        Share of pixels with two or more cues.
    contrast : ndarray of float64, shape (n,)
        Edge strength along the outline over that of most of the image.
    raggedness : ndarray of float64, shape (n,)
        Pixels of the outline over the square root of all pixels: larger is less compact.
    rock_log_odds : ndarray of float64, shape (n,)
        Mean log odds of the outline network; 0 for pixels without a cue that it decides.
    ground_share : ndarray of float64, shape (n,)
        Share of pixels that are ground too steep or too low.
    noise_share : ndarray of float64, shape (n,)
        Mean height noise over the rover's step; 0 without 3D.
    cue_shares : ndarray of float64, shape (n, cues)
        Share of pixels with each cue, in the order of `Cue`.
    disparity_noise_px : float
        Disparity noise of the whole pair.
    min_noise_share : float
        See `ResultParameters`.
    """

    excess: Floats
    pixels: Floats
    measured_share: Floats
    agreement: Floats
    contrast: Floats
    raggedness: Floats
    rock_log_odds: Floats
    ground_share: Floats
    noise_share: Floats
    cue_shares: Floats
    disparity_noise_px: float
    min_noise_share: float

    def features(self) -> Floats:
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
                self.ground_share * np.log(self.noise_share + self.min_noise_share),
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
    parameters: ResultParameters,
    images: ImageParameters,
) -> ObstacleEvidence:
    """Measure the evidence for each numbered obstacle.

    Parameters
    ----------
    numbers : ndarray of int32, shape (height, width)
        Number of each pixel's obstacle, 1 to n; 0 where there is none.
    grey, disparity, height_m, noise_m, rock_probability, cues : ndarray, shape (height, width)
        As in `Detection`.
    parameters : ResultParameters
    images : ImageParameters

    Notes
    -----
    Pixels within a matching block share their noise, so n pixels are worth about
    ``n / block_size_px**2`` independent ones, and at least one. The noise is scaled by what the
    disparities of the pair show.
    """
    where = np.flatnonzero(numbers > 0)
    owner = numbers.ravel()[where].astype(np.intp) - 1
    count = int(numbers.max(initial=0))
    own_cues = cues.ravel()[where]
    # Pixels of each obstacle with each sum of cues.
    table = np.bincount(owner * 256 + own_cues, minlength=count * 256).reshape(count, 256)
    sums = np.arange(256, dtype=np.uint8)
    pixels = table.sum(axis=1).astype(np.float64)

    def share(which: NDArray[np.bool_]) -> Floats:
        return np.asarray(np.bincount(owner[which], minlength=count) / pixels)

    def cue_share(which: NDArray[np.uint8]) -> Floats:
        return np.asarray(table @ (which > 0) / pixels)

    own_height, own_noise = height_m.ravel()[where], noise_m.ravel()[where]
    measured = np.isfinite(own_height) & np.isfinite(own_noise) & (disparity.ravel()[where] > 0)
    by_network = (own_cues & np.uint8(Cue.HEIGHT | Cue.GREY_LEVEL)) > 0
    odds = _log_odds(rock_probability.ravel()[where[by_network]], parameters.max_rock_probability)
    noise_px = seen_disparity_noise_px(disparity, parameters)
    outline = _is_outline(numbers).ravel()[where]
    return ObstacleEvidence(
        excess=_excess(
            owner[measured],
            own_height[measured] - np.float32(parameters.max_step_m),
            own_noise[measured] * np.float32(noise_px / parameters.typical_noise_px),
            count,
            parameters.block_size_px**2,
        ),
        pixels=pixels,
        measured_share=share(measured),
        agreement=cue_share(sums & (sums - np.uint8(1))),
        contrast=_contrast(owner[outline], where[outline], grey, count, parameters, images),
        raggedness=np.maximum(share(outline) * np.sqrt(pixels), 1.0),
        rock_log_odds=np.bincount(owner[by_network], weights=odds, minlength=count) / pixels,
        ground_share=cue_share(sums & np.uint8(Cue.SLOPE | Cue.DROP)),
        noise_share=_mean_of(owner[measured], own_noise[measured], count) / parameters.max_step_m,
        cue_shares=np.column_stack([cue_share(sums & np.uint8(cue)) for cue in Cue]),
        disparity_noise_px=noise_px,
        min_noise_share=parameters.min_noise_share,
    )


def seen_disparity_noise_px(disparity: NDArray[np.float32], parameters: ResultParameters) -> float:
    """Estimate the disparity noise of a pair from neighbouring disparities, pixels.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        0 where there is no match.
    parameters : ResultParameters

    Returns
    -------
    float
        Mean deviation of a disparity from the mean of those a few pixels to the left and right,
        as the standard deviation of independent noise of that size. Structure of the scene adds to
        it. Typical noise where nothing is matched.
    """
    spacing = parameters.noise_spacing_px
    # A third of the rows is enough for a mean.
    width = max(disparity.shape[1] - 2 * spacing, 0)
    left, middle, right = (
        disparity[::3, start : start + width] for start in (0, spacing, 2 * spacing)
    )
    matched = (left > 0) & (middle > 0) & (right > 0)
    difference = np.abs(left + right - 2 * middle)[matched]
    if not difference.size:
        return parameters.typical_noise_px
    # The second difference of normal noise has six times its variance, and a mean size of 0.8
    # standard deviations.
    mean = float(np.minimum(difference, parameters.max_difference_px).mean()) / (0.8 * 6**0.5)
    return max(mean, parameters.typical_noise_px / 10)


def _log_odds(probability: NDArray[np.float32], largest: float) -> Floats:
    """Log odds of limited size; 0 where the probability is not known."""
    even = np.nan_to_num(probability.astype(np.float64), nan=0.5)
    limited = np.clip(even, 1 - largest, largest)
    return np.asarray(np.log(limited / (1 - limited)))


def _excess(
    owner: NDArray[np.intp],
    excess_m: NDArray[np.float32],
    noise_m: NDArray[np.float32],
    count: int,
    block_pixels: int,
) -> Floats:
    over = excess_m > 0
    owner = owner[over]
    pixels = np.bincount(owner, minlength=count)
    samples = np.maximum(pixels / block_pixels, 1)
    excess_sum = np.bincount(owner, excess_m[over], minlength=count)
    noise_sum = np.bincount(owner, noise_m[over], minlength=count)
    ratio = np.zeros(count)
    np.divide(excess_sum, noise_sum, out=ratio, where=noise_sum > 0)
    return np.asarray(ratio * np.sqrt(samples))


def _mean_of(owner: NDArray[np.intp], values: NDArray[np.float32], count: int) -> Floats:
    pixels = np.bincount(owner, minlength=count)
    return np.asarray(np.bincount(owner, values, minlength=count) / np.maximum(pixels, 1))


def _is_outline(numbers: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Pixels of obstacles with ground beside them; the border of the image is no outline."""
    free = np.pad(numbers == 0, 1)
    beside = free[:-2, 1:-1] | free[2:, 1:-1] | free[1:-1, :-2] | free[1:-1, 2:]
    return np.asarray(beside & (numbers > 0))


def _contrast(
    owner: NDArray[np.intp],
    where: NDArray[np.intp],
    grey: NDArray[np.uint8],
    count: int,
    parameters: ResultParameters,
    images: ImageParameters,
) -> Floats:
    """Compare the edges along outlines with those of the image; 1 without an outline."""
    edges = edge_strength(grey, images)
    row, column = np.divmod(where, grey.shape[1])
    along = edges[row // images.edge_reduction, column // images.edge_reduction]
    pixels = np.bincount(owner, minlength=count)
    sums = np.bincount(owner, along, minlength=count)
    usual = float(np.median(edges[::2, ::2]))
    mean = np.full(count, usual)
    np.divide(sums, pixels, out=mean, where=pixels > 0)
    return np.asarray((mean + parameters.faint_contrast) / (usual + parameters.faint_contrast))
