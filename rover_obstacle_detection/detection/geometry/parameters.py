"""Parameters of the ground plane fit."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PlaneFitParameters:
    """How the ground plane is fitted, and which planes can be ground.

    Parameters
    ----------
    tolerance_m : float
        Relief that still counts as ground. Derived: half of the user's ``max_step``.
    max_range_m : float
        Farther points are excluded. Set by the user.
    disparity_noise_px : float
        Standard deviation of the disparity of semi-global matching. Tuned on the tuning scenes.
    near_share : float
        Share of the matched pixels, nearest first, that `estimate_ground` uses. Tuned on the
        tuning scenes.
    candidates : int
        Random planes that are scored. Derived: where 40 % of the points are obstacles, about 40
        of these planes go through three ground points.
    sample_points : int
        Points that the plane is refined on, for speed.
    scored_points : int
        Points that the candidates are scored on, for speed.
    min_points : int
        With fewer points no plane is fitted. Tuned on the tuning scenes.
    min_sample_area_px2 : float
        Candidates through three points that span a smaller triangle in the image are skipped, as
        these are nearly collinear. Derived: half a pixel of area.
    refinements : int
        Steps of reweighted least squares. Tuned on the tuning scenes.
    max_deviation : float
        Residuals beyond it count no more than it does (MSAC), standard deviations. Derived: the
        usual three.
    below_weight : float
        Cost of a point below the plane relative to one above it. Derived: ground has obstacles on
        it but nothing below it. Tuned on the tuning scenes.
    min_height_m : float
        Least distance of the camera from the plane. Derived: lower than any rover's camera.
    max_pitch_deg : float
        Greatest downward pitch of the camera relative to the plane, without known gravity. Tuned
        on the tuning scenes.
    max_roll_deg, max_looking_up_deg : float
        Greatest roll and upward pitch relative to the plane, without known gravity. Tuned on the
        tuning scenes.
    max_slope_deg : float
        Greatest slope of the plane, with known gravity. Derived: steeper than any rover stands on.
    default_height_m : float
        Height of the camera where neither matches nor the mounting give it. A guess, so that
        heights have a scale.
    """

    tolerance_m: float = 0.05
    max_range_m: float = 40.0
    disparity_noise_px: float = 0.25
    near_share: float = 0.7
    candidates: int = 200
    sample_points: int = 2000
    scored_points: int = 400
    min_points: int = 50
    min_sample_area_px2: float = 0.5
    refinements: int = 6
    max_deviation: float = 3.0
    below_weight: float = 2.0
    min_height_m: float = 0.05
    max_pitch_deg: float = 80.0
    max_roll_deg: float = 30.0
    max_looking_up_deg: float = 30.0
    max_slope_deg: float = 30.0
    default_height_m: float = 1.0
