"""Parameters of the image measurements."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ImageParameters:
    """How noise, texture and edges of an image are measured.

    Parameters
    ----------
    quiet_noise_ratio : float
        Ratio of noise to texture below which nothing is smoothed. Tuned on the tuning scenes.
    noisy_noise_ratio : float
        Ratio of noise to texture from which all is smoothed. Tuned on the tuning scenes.
    smoothing_px : float
        Standard deviation of the Gaussian. Tuned on the tuning scenes.
    brightness_bands : tuple of int
        Grey levels between the bands in which noise and texture are measured. Derived: from 16 on,
        half an octave each, within which noise changes little.
    min_band_share : float
        Bands with a smaller share of the image are not measured. Derived: a hundred pixels of the
        full sample, whose median has an error of a tenth.
    shadow_brightness : float
        What is darker than this, relative to the median of the image, may be shadow. Chosen with
        all suites and some real pairs in view.
    even_contrast_ratio : float
        Contrast within this factor of that of the whole image is left as it is. Chosen with all
        suites and some real pairs in view.
    min_texture_ratio : float
        Gradients must exceed those of the noise by this factor, or shadow holds nothing to raise.
        Chosen with all suites and ray-cast ground in black shadow in view.
    max_shadow_gain : float
        Most by which the contrast of shadows is raised for matching. Chosen with all suites in
        view.
    unclipped_share : float
        Share of the image that raised shadows must not push beyond white. Derived: all but
        highlights.
    noise_samples : int
        Pixels from which noise and gradient are estimated, for speed. Derived: the median of so
        many has an error under 1 %.
    exposure_window_px : int
        Side of the window whose mean is the local brightness, odd. Tuned on the tuning scenes.
    black_grey_level, white_grey_level : int
        Windows with a mean at or beyond these levels are clipped. Derived: the ends of the 8-bit
        range, less the noise of a dark or saturated pixel.
    min_exposed_share : float
        Share of the image that must not be clipped; otherwise all of it is used. Tuned on the
        tuning scenes.
    min_noise : float
        Smallest noise, grey levels. Derived: rounding to whole levels alone has 0.3.
    min_gradient : float
        Smallest gradient, grey levels per pixel. Avoids division by zero in plain images.
    texture_window_px : int
        Side of the window whose mean is the background of the texture, odd. Tuned on the tuning
        scenes.
    texture_samples : int
        Pixels from which texture is estimated, for speed. Derived: the median of so many has an
        error of about 1 %.
    min_texture : float
        Smallest texture, grey levels. Avoids division by zero in plain images.
    edge_reduction : int
        Factor by which the image is reduced before edges are measured. Tuned on the tuning scenes.
    edge_smoothing_px : float
        Standard deviation of the Gaussian before edges are measured, pixels of the reduced image.
        Tuned on the tuning scenes.
    """

    quiet_noise_ratio: float = 0.8
    noisy_noise_ratio: float = 1.2
    smoothing_px: float = 1.0
    brightness_bands: tuple[int, ...] = (8, 16, 24, 32, 48, 64, 96, 128, 192)
    min_band_share: float = 0.005
    shadow_brightness: float = 0.5
    even_contrast_ratio: float = 1.25
    min_texture_ratio: float = 1.2
    max_shadow_gain: float = 4.0
    unclipped_share: float = 0.999
    noise_samples: int = 20_000
    exposure_window_px: int = 9
    black_grey_level: int = 2
    white_grey_level: int = 253
    min_exposed_share: float = 0.1
    min_noise: float = 0.5
    min_gradient: float = 0.1
    texture_window_px: int = 9
    texture_samples: int = 10_000
    min_texture: float = 1.0
    edge_reduction: int = 2
    edge_smoothing_px: float = 1.0
