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
    lowest_share : float
        Share of the points that may lie below the lowest row, so that a few cannot set it.
    nearness_rows : float
        Share of the image's height over which a point's weight falls to 1 / e, from the lowest row
        upwards, while a plane is chosen. Tuned on the tuning scenes and on walls and edges.
    refined_nearness_rows : float
        The same while the chosen plane is refined: more points make it more precise.
    candidates : int
        Random planes that are scored, half of them through the lowest points. Derived: where 40 %
        of the points are obstacles, about 120 of these planes go through three ground points.
    sample_points : int
        Points that the plane is refined on, for speed.
    scored_points : int
        Points that the candidates are scored on, for speed.
    min_points : int
        With fewer points no plane is fitted. Tuned on the tuning scenes.
    min_sample_area_px2 : float
        Candidates through three points that span a smaller triangle in the image are skipped, as
        these are nearly collinear. Derived: half a pixel of area.
    max_cost : float
        Mean squared residual above which no plane is ground. Derived: three quarters of the lowest
        points would lie elsewhere.
    refinements : int
        Steps of reweighted least squares. Tuned on the tuning scenes.
    max_deviation : float
        Residuals beyond it count no more than it does (MSAC), standard deviations. Derived: the
        usual three.
    below_weight : float
        Cost of a point below the plane relative to one above it. Derived: ground has obstacles on
        it but nothing below it. Tuned on the tuning scenes.
    min_height_m, max_height_m : float
        Least and greatest distance of the camera from the plane. Derived: lower and higher than
        any rover's camera.
    max_pitch_deg, max_roll_deg : float
        Greatest downward pitch and greatest roll of the camera relative to the plane, without
        known gravity. Set by the user.
    max_looking_up_deg : float
        Greatest upward pitch relative to the plane, without known gravity. Tuned on the tuning
        scenes.
    usual_pitch_deg, pitch_spread_deg, roll_spread_deg : float
        What is expected of pitch and roll without known gravity: mean and standard deviation.
        Assumed: rovers' cameras look down by 10 to 45 degrees and are mounted upright.
    known_height_m : float
        Height of the camera; 0 if it is not known. Set by the user.
    known_height_spread : float
        Standard deviation of its logarithm. Derived: the tilt of a rover and relief change it
        by some percent.
    default_height_m : float
        Height of the camera that is expected where it is not known, and assumed where no plane is
        found. A guess, so that heights have a scale.
    height_spread : float
        Standard deviation of the logarithm of unknown heights. Assumed: half of all rovers carry
        their cameras at 0.6 to 1.6 m.
    surprise_weight : float
        Weight of the squared deviations from what is expected, relative to the squared residuals.
        Tuned like `nearness_rows`.
    max_slope_deg : float
        Greatest slope of the plane, with known gravity. Derived: steeper than any rover stands on.
    """

    tolerance_m: float = 0.05
    max_range_m: float = 40.0
    disparity_noise_px: float = 0.25
    near_share: float = 0.7
    lowest_share: float = 0.02
    nearness_rows: float = 0.12
    refined_nearness_rows: float = 0.2
    candidates: int = 600
    sample_points: int = 3000
    scored_points: int = 600
    min_points: int = 50
    min_sample_area_px2: float = 0.5
    max_cost: float = 7.0
    refinements: int = 8
    max_deviation: float = 3.0
    below_weight: float = 2.0
    min_height_m: float = 0.05
    max_height_m: float = 20.0
    max_pitch_deg: float = 70.0
    max_roll_deg: float = 25.0
    max_looking_up_deg: float = 20.0
    usual_pitch_deg: float = 25.0
    pitch_spread_deg: float = 25.0
    roll_spread_deg: float = 5.0
    known_height_m: float = 0.0
    known_height_spread: float = 0.06
    default_height_m: float = 1.0
    height_spread: float = 0.7
    surprise_weight: float = 0.3
    max_slope_deg: float = 30.0


@dataclass(frozen=True)
class GroundCheckParameters:
    """When the ground that was found contradicts what is known.

    Parameters
    ----------
    max_tilt_deg : float
        Tilt of the ground against a given vertical that is worth a warning. Set by the user: the
        steepest slope that the rover can climb.
    max_height_ratio : float
        Ratio between the measured and the known height of the camera, in either direction.
        Derived: slopes ahead and relief change the height by a tenth or two.
    min_usual_height_m, max_usual_height_m : float
        Heights at which rovers carry their cameras.
    """

    max_tilt_deg: float = 20.0
    max_height_ratio: float = 1.3
    min_usual_height_m: float = 0.12
    max_usual_height_m: float = 3.5


@dataclass(frozen=True)
class ResolutionParameters:
    """How many pixels a pair is measured and outlined with.

    Parameters
    ----------
    max_step_m, max_range_m : float
        Set by the user.
    scale : float
        Fixed scale of the images; 0 lets it follow from the step. Set by the user.
    step_px : float
        Size of the step in the reduced image, at the distance that `far_share` gives. A trade, see
        `RESOLUTIONS`.
    far_share : float
        Share of the ground's pixels that lie farther away than that distance.
    min_pixels : int
        Fewest pixels of the reduced image, since the filters have sizes in pixels. A trade, see
        `RESOLUTIONS`.
    outline_step_px : float
    outline_min_pixels : int
        The same for the images in which outlines are drawn.
    min_side_px : int
        Shortest side of the reduced image at a fixed scale. Derived: the filters' widest windows
        are 33 pixels wide.
    max_scale : float
        Images that would hardly become smaller keep their size.
    """

    max_step_m: float = 0.10
    max_range_m: float = 40.0
    scale: float = 0.0
    step_px: float = 8.0
    far_share: float = 0.25
    min_pixels: int = 533 * 400
    outline_step_px: float = 10.0
    outline_min_pixels: int = 640 * 480
    min_side_px: int = 48
    max_scale: float = 0.95


RESOLUTIONS = {
    'accurate': ResolutionParameters(),
    'fast': ResolutionParameters(
        step_px=7.0, min_pixels=480 * 320, outline_step_px=7.0, outline_min_pixels=480 * 320
    ),
}
"""Of each `speed`.

Chosen with all suites in view. Measuring at 10 pixels finds no more than at 8; outlines at 8 lose
a hundredth of the IoU.
"""
