"""Parameters of the rectification correction."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RectificationParameters:
    """How residual rectification errors are estimated, and when they are corrected.

    Pixels are those of the reduced pair unless noted. A lens's *gain* is an F statistic: how much
    of the row shifts the lenses explain, over what as many random unknowns would.

    Parameters
    ----------
    min_matched_pixels : int
        Fewer matches give no estimate. Tuned on the tuning scenes.
    max_row_shift_px : float
        A larger row shift is a false estimate and is not corrected, pixels of the full image.
        Tuned on the tuning scenes.
    max_bend_share : float
        Distortion that moves a pixel by a larger share of the image's width is a false estimate.
        Tuned on the tuning scenes.
    min_first_lens_gain : float
        Gain that starts lens correction. It is low because a strongly bent image has no matches
        in its corners. Measured: straight lenses reach 27 in 400 rendered pairs.
    min_lens_gain : float
        Gain required of each later estimate. Correction raises the gain of true distortion.
        Measured: straight lenses that pass the first threshold reach 21 in the same pairs.
    max_lens_passes : int
        Most rounds of straightening and matching. Tuned on rendered pairs.
    settled_lens_px : float
        Mean change of the lenses that ends the rounds, pixels of the full image. Tuned on
        rendered pairs.
    min_mean_bend_px : float
        Less distortion is not corrected, since resampling costs more than it gains: mean over the
        image, pixels of the full image. Measured on rendered pairs.
    match_reach_px : int
        Distance within which matching looks around a pixel, pixels of either image. Derived: a
        block of 3 pixels and SGBM's prefilter.
    inversion_passes : int
        Fixed-point iterations that invert the distortion polynomial. Derived: enough for any
        lens within `max_bend_share`.
    inversion_tolerance : float
        Largest last change of a radius, as a share of it, that counts as converged. Derived: half
        a pixel in a radius of 1000 px.
    min_stretch : float
        Smallest factor by which a radius may shrink in that inversion. Derived: less lies beyond
        the point where the polynomial turns back.
    max_iterations : int
        Gauss-Newton iterations of the row shifts. Tuned on rendered pairs.
    settled_shift_px : float
        Largest step that ends them. Tuned on rendered pairs.
    smoothing_px : float
        Standard deviation of the blur before comparing grey levels. Derived: it removes texture
        that the reduced pair cannot show, which would look like a shift.
    brightness_window_px : int
        Side of the window whose mean grey difference is ignored. Tuned on rendered pairs.
    window_px : int
        Side of the window over which grey gradients are summed. Tuned on rendered pairs.
    max_grey_sigmas : float
        Grey differences beyond this many standard deviations are false matches. Derived: the usual
        three.
    block_px : int
        Side of the blocks that the model is fitted to. Tuned on rendered pairs.
    min_block_weight : float
        Squared row gradient, summed over a block, below which it shows no shift. Tuned on rendered
        pairs.
    max_block_sigmas : float
        Standard deviations of a block's residual at which its weight falls to a quarter. Tuned on
        rendered pairs.
    reweightings : int
        Passes of that reweighting. Tuned on rendered pairs.
    ridge : float
        Weight that holds unknowns at zero in an image without texture. Derived: a few pixels'
        worth of texture.
    min_blocks_per_unknown : int
        Fewer blocks give no lenses. Tuned on rendered pairs.
    """

    min_matched_pixels: int = 500
    max_row_shift_px: float = 3.0
    max_bend_share: float = 0.15
    min_first_lens_gain: float = 12.0
    min_lens_gain: float = 30.0
    max_lens_passes: int = 8
    settled_lens_px: float = 0.25
    min_mean_bend_px: float = 0.2
    match_reach_px: int = 4
    inversion_passes: int = 12
    inversion_tolerance: float = 5e-4
    min_stretch: float = 0.5
    max_iterations: int = 10
    settled_shift_px: float = 0.1
    smoothing_px: float = 0.8
    brightness_window_px: int = 9
    window_px: int = 7
    max_grey_sigmas: float = 3.0
    block_px: int = 12
    min_block_weight: float = 1.0
    max_block_sigmas: float = 3.0
    reweightings: int = 5
    ridge: float = 1.0
    min_blocks_per_unknown: int = 5
