"""Parameters of the image measurements."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ImageParameters:
    """How noise, texture and edges of an image are measured.

    Parameters
    ----------
    quiet_noise_ratio : float
        Ratio of noise to texture below which an image is not smoothed. Tuned on the tuning scenes.
    noisy_noise_ratio : float
        Ratio of noise to texture from which an image is smoothed fully. Tuned on the tuning
        scenes.
    max_smoothing_px : float
        Standard deviation of the Gaussian at full smoothing. Tuned on the tuning scenes.
    noise_samples : int
        Pixels from which noise and gradient are estimated, for speed. Derived: the median of so
        many has an error under 1 %.
    exposure_window_px : int
        Side of the window in which exposure is checked, odd. Tuned on the tuning scenes.
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
    max_smoothing_px: float = 1.0
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
