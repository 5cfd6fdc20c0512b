"""Parameters of stereo matching."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class SupportParameters:
    """When images support what was matched in them.

    The limits lie between 50 good pairs (rendered, ray-cast and real, also dark, noisy and hazy)
    and pairs that do not belong together.

    Parameters
    ----------
    window_px, wide_window_px : int
        Sides of the windows in which the images are compared. Derived: the narrowest window of the
        refinement, and the reach of semi-global matching into plain surfaces.
    plain_window_px : int
        Side of a window without texture that makes an area plain.
    min_noise : float
        Least noise of an image, grey levels. Derived: rounding.
    min_signal : float
        Standard deviations of the noise that texture must exceed in one of the windows. Measured:
        good pairs have hardly a pixel below it.
    clear_signal : float
        The same, for texture that counts in the shares of an image.
    min_correlation : float
        Texture that correlates less is a false match. Derived: texture as strong as the noise
        correlates by 0.5 where it matches, with a deviation of 0.1 in the window.
    min_dense_share : float
        Share of the visible pixels within the wide window that must be supported too. Measured on
        the tuning scenes of the suite ``hazards``: below it, up to a half of the supported
        matches are wrong by more than a pixel; above 0.95, one in a hundred. Chosen with all
        suites in view.
    agreeing_correlation : float
        Correlation from which texture counts as alike.
    min_repetition_px : float
        Distance from the ground plane from which a match is compared with one on the plane.
        Derived: texture repeats within more pixels than matching needs.
    repetition_tolerance : float
        Correlation by which the match on the plane may be worse and still as good.
    min_textured_share, min_matched_share : float
        Least share of the pixels with clear texture; with less, least share of supported matches.
        Measured: good pairs with hardly any contrast reach 0.5, the noise of covered lenses 0.2.
    min_texture_ratio : float
        Least textured share of one image relative to the other.
    min_agreeing_share, doubtful_agreeing_share : float
        Share of the textured pixels that look alike, below which a pair is rejected or doubtful.
        Measured: good pairs reach 0.61 to 1, wrong ones at most 0.43.
    max_same_share : float
        Share of the textured pixels that hardly differ from those at the same place in the other
        image, beyond which both images are the same.
    min_sharpness_ratio : float
        Sharpness relative to the other image, below which an image is out of focus.
    max_row_offset_px : int
        Row offsets that are searched.
    offset_strips, offset_window_px : int
        Vertical strips whose mean rows are compared, and the window of their background.
    min_offset_gain : float
        Correlation that an offset must gain over none.
    min_offset_correlation : float
        Least correlation at that offset. Measured: 0.6 to 0.9 on ray-cast pairs whose rows are
        off, at most 0.2 on unrelated ones.
    """

    window_px: int = 9
    wide_window_px: int = 25
    plain_window_px: int = 15
    min_noise: float = 0.3
    min_signal: float = 1.0
    clear_signal: float = 2.0
    min_correlation: float = 0.3
    min_dense_share: float = 0.9
    agreeing_correlation: float = 0.6
    min_repetition_px: float = 3.0
    repetition_tolerance: float = 0.05
    min_textured_share: float = 0.02
    min_matched_share: float = 0.3
    min_texture_ratio: float = 0.05
    min_agreeing_share: float = 0.45
    doubtful_agreeing_share: float = 0.6
    max_same_share: float = 0.9
    min_sharpness_ratio: float = 0.7
    max_row_offset_px: int = 40
    offset_strips: int = 8
    offset_window_px: int = 31
    min_offset_gain: float = 0.1
    min_offset_correlation: float = 0.4


@dataclass(frozen=True)
class SweepParameters:
    """Which planes are tried where matching finds no ground, or an unlikely one.

    Parameters
    ----------
    max_residual : float
        Residual of a plane beyond which it is doubtful. Derived: a quarter of the lowest points
        lies elsewhere.
    max_surprise : float
        The same for its height, standard deviations.
    pitches_deg : tuple of float
        Pitches of the camera that are tried, where the vertical is not known.
    pitch_step_deg : float
        Difference of two neighbours.
    max_pitch_deg : float
        If the best pitch is greater, or greater than the plane fit admits, the view is filled by a
        wall.
    min_height_m, max_height_m : float
        Least and greatest height of the camera. Derived: those of rovers' cameras.
    heights : int
        Heights in between. Derived: two neighbours differ by about a pixel in the reduced pair.
    surprise_weight : float
        Correlation that one squared standard deviation costs. Tuned on ray-cast slabs.
    min_agreement : float
        Mean correlation from which a plane can be the ground. Tuned on ray-cast slabs and walls.
    min_gain : float
        Correlation, height included, by which the best plane must exceed the one that matching
        found.
    lower_share : float
        Lower share of the image that is compared. Derived: ground is lowest.
    window_px : int
        Side of the window of the correlation, pixels of the reduced pair.
    """

    max_residual: float = 2.5
    max_surprise: float = 1.4
    pitches_deg: tuple[float, ...] = tuple(range(0, 80, 4))
    pitch_step_deg: float = 4.0
    max_pitch_deg: float = 58.0
    min_height_m: float = 0.25
    max_height_m: float = 3.0
    heights: int = 36
    surprise_weight: float = 0.02
    min_agreement: float = 0.5
    min_gain: float = 0.05
    lower_share: float = 0.6
    window_px: int = 9


@dataclass(frozen=True)
class StereoParameters:
    """What matching searches, and how its noise is modelled.

    Grey levels are those of 8-bit images. *Set by the user* means a field of `DetectorConfig`.

    Parameters
    ----------
    min_range_m : float
        Nearest distance along the optical axis. Set by the user.
    min_disparity_px, disparity_range_px : int
        First disparity of the search and their number, a multiple of 16; a number of 0 follows
        from the camera and `min_range_m`. Set by the user.
    block_size_px : int
        Side of the matching block. Set by the user; 3 keeps the outlines of small rocks.
    p1, p2 : int
        SGBM penalties on a disparity change of one pixel and of more; 0 lets them follow from the
        image. Set by the user.
    smoothness : float
        Factor on the penalties that follow from the image. Set by the user.
    uniqueness_percent, speckle_size_px, speckle_range_px, disp12_max_diff_px, prefilter_cap
        As in `cv2.StereoSGBM`. Set by the user.
    sgbm_mode : int
        0 SGBM, 1 HH, 2 SGBM_3WAY, 3 HH4. Set by the user.
    max_penalty : int
        Derived: SGBM sums costs in 16 bits and overflows beyond it.
    step_penalty, jump_penalty : float
        Penalties per pixel of the block and grey level of gradient. Tuned on the tuning scenes.
    noise_penalty : float
        Relative growth of the penalties in an image of pure noise. Tuned on the tuning scenes.
    coarse_reduction : int
        Full-size pixels in the side of a pixel of the coarse match. Tuned for speed.
    min_coarse_width_px : int
        Smaller images are reduced less. SGBM is biased to whole pixels, and their disparity is
        only two or three pixels. Tuned on the tuning scenes.
    coarse_p1, coarse_p2 : int
        Penalties of the coarse match. Tuned on the tuning scenes.
    tail_share : float
        Share of the coarse residuals at either end that the search need not reach. Tuned on the
        tuning scenes.
    search_margin_px : float
        Margin around the residuals seen coarsely. Tuned on the tuning scenes.
    sky_window_px : int
        Side of the window that is checked for texture above the horizon. Tuned on the tuning
        scenes.
    sky_texture : float
        Mean difference of neighbours below which that window shows bare sky, grey levels. Derived:
        noise of one grey level has 1.1.
    empty_block_px : int
        Side of the black blocks that an empty border is made of, odd. Derived: wider than posts
        that stand out against black.
    match_reach_px : int
        Distance within which matching looks around a pixel. Derived: a block of 3 pixels and
        SGBM's prefilter.
    empty_rim_px : int
        Pixels at an empty border that mix with its black. Derived: linear interpolation.
    refinement_windows_px : tuple of int
        Sides of the windows of sub-pixel refinement, widest first. Tuned on the tuning scenes.
    refinement_priors_px : tuple of float
        Standard deviation of the step expected in each. The last is about the error of most
        matches. Measured on rendered ground.
    pixels_per_sample : float
        Neighbouring pixels that count as one independent sample. Measured on rendered ground.
    min_grey_noise : float
        Least noise of the grey-level difference. Derived: rounding of both images.
    max_refinement_px : float
        Largest refinement. Derived: SGBM is at most one pixel off where it matches.
    untextured_noise_px, min_noise_px : float
        Standard deviation of the disparity without texture and with plenty. Measured on rendered
        ground.
    distant_texture_window_px : int
        Side of the window in which texture counts as near.
    distant_texture_signal : float
        Signal over noise in that window below which matches come from distant texture.
    distant_texture_noise : float
        Relative growth of the noise there. All three measured on rendered ground.
    support : SupportParameters
    sweep : SweepParameters
    """

    min_range_m: float = 0.3
    min_disparity_px: int = 0
    disparity_range_px: int = 0
    block_size_px: int = 3
    p1: int = 0
    p2: int = 0
    smoothness: float = 1.0
    uniqueness_percent: int = 8
    speckle_size_px: int = 50
    speckle_range_px: int = 2
    disp12_max_diff_px: int = 1
    prefilter_cap: int = 63
    sgbm_mode: int = 2
    max_penalty: int = 16_000
    step_penalty: float = 5.0
    jump_penalty: float = 20.0
    noise_penalty: float = 3.0
    coarse_reduction: int = 4
    min_coarse_width_px: int = 160
    coarse_p1: int = 300
    coarse_p2: int = 1200
    tail_share: float = 0.002
    search_margin_px: float = 5.0
    sky_window_px: int = 9
    sky_texture: float = 2.0
    empty_block_px: int = 15
    match_reach_px: int = 4
    empty_rim_px: int = 1
    refinement_windows_px: tuple[int, ...] = (33, 9)
    refinement_priors_px: tuple[float, ...] = (0.5, 0.13)
    pixels_per_sample: float = 2.0
    min_grey_noise: float = 0.5
    max_refinement_px: float = 1.0
    untextured_noise_px: float = 0.35
    min_noise_px: float = 0.12
    distant_texture_window_px: int = 25
    distant_texture_signal: float = 1.5
    distant_texture_noise: float = 1.5
    support: SupportParameters = field(default_factory=SupportParameters)
    sweep: SweepParameters = field(default_factory=SweepParameters)
