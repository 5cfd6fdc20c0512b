"""Parameters of the study's method."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class StudyParameters:
    """Matching, terrain limits and morphology of the study's method.

    Parameters
    ----------
    disparities : int
        Number of disparities searched, a multiple of 16. Set by the user; 48 is the study's.
    step_penalty, jump_penalty : int
        SGBM penalties on a disparity change of one pixel and of more. Derived: ``8 c b^2`` and
        ``32 c b^2`` of OpenCV's documentation, as in the study, with c = 3 channels and a block
        of b = 5 pixels.
    median_window_px : int
        Side of the median filter of the disparity, odd. As in the study.
    disparity_noise_px : float
        Standard deviation of the disparity of a pixel. Tuned on the tuning scenes.
    window_noise_px : float
        Standard deviation of the disparity of a pixel relative to others of its window. Tuned on
        the tuning scenes.
    window_size_px : int
        Side of the window for roughness and elevation step, odd. Set by the user.
    max_roughness_m : float
        Greatest roughness of free ground without noise (T2). Set by the user.
    max_step_m : float
        Greatest elevation step of free ground without noise (T3). Set by the user.
    dark_grey_level : float
        Regions without enough 3D points are dark below this mean grey level (T4). Set by the user.
    max_range_m : float
        Farther matches are removed. Set by the user.
    noise_roughness_factor : float
        Roughness that noise alone stays below, over its standard deviation. Derived: the mean
        deviation of 25 normal samples is 0.8 with a spread of 0.12; three spreads more is 1.2.
    noise_step_factor : float
        Step that noise alone stays below, over its standard deviation. Derived: the range of 25
        normal samples is 3.9 with a spread of 0.7 (Tippett 1925); three spreads more is 6.
    morphology_size_px : int
        Diameter of the elliptical kernel. Set by the user.
    morphology_iterations : int
        Dilations and erosions of the closing and of the opening. Set by the user.
    """

    disparities: int = 48
    step_penalty: int = 600
    jump_penalty: int = 2400
    median_window_px: int = 5
    disparity_noise_px: float = 0.25
    window_noise_px: float = 0.05
    window_size_px: int = 5
    max_roughness_m: float = 0.0005
    max_step_m: float = 0.005
    dark_grey_level: float = 50
    max_range_m: float = 40.0
    noise_roughness_factor: float = 1.2
    noise_step_factor: float = 6.0
    morphology_size_px: int = 7
    morphology_iterations: int = 2
