"""Parameters of brims, of what lies behind them, and of reflections."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ReflectionParameters:
    """When a point can only be seen through the ground.

    Parameters
    ----------
    noises : float
        Standard deviations by which a sight line passes below the ground, besides a step. Derived:
        the usual three.
    cell_m : float
        Side of a cell of the map of the ground. Derived: a sight line drops by less than a step
        within a cell.
    cells : int
        Cells along each side of that map, which reaches ahead and to either side of the camera.
    min_points : int
        Points from which a cell is seen.
    parts : tuple of float
        Where a sight line is checked, from the ground plane (0) to its point (1).
    margin_m : float
        Length before its point that is not checked. Derived: more than the diagonal of a cell.
    """

    noises: float = 3.0
    cell_m: float = 0.15
    cells: int = 100
    min_points: int = 3
    parts: tuple[float, ...] = (0.1, 0.25, 0.4, 0.55, 0.7, 0.85)
    margin_m: float = 0.25


@dataclass(frozen=True)
class BackdropParameters:
    """What is sky although ground could be seen there.

    Grey levels are those of 8-bit images. Set on ray-cast cliffs, plain ground and haze.

    Parameters
    ----------
    window_px : int
        Side of the window without texture, as above the horizon.
    min_difference : float
        Mean difference of neighbours from which that window shows texture, grey levels.
    noises : float
        The same, in standard deviations of the noise. Derived: noise alone has 1.1.
    min_grey : float
        Darker sky may be shadow.
    max_difference : float
        Grey levels by which the sky may differ from that just above the horizon, or at the top
        of the image.
    max_matched_share : float
        Share of matched pixels from which a part is no sky. Measured: 0.06 of the sky of ray-cast
        cliffs, 0.96 of plain ground.
    min_edge : float
        Least difference of the window that follows, grey levels. Derived: where haze hides its
        texture, ground differs from the sky by little more.
    """

    window_px: int = 9
    min_difference: float = 2.0
    noises: float = 1.5
    min_grey: float = 30.0
    max_difference: float = 12.0
    max_matched_share: float = 0.3
    min_edge: float = 20.0


@dataclass(frozen=True)
class BrimParameters:
    """When a jump of the sight lines is the brim of a drop.

    Parameters
    ----------
    reach_px : int
        Rows above and below a brim at which the heights are compared. Derived: matching blurs a
        jump over its block and the window of the refinement.
    max_unseen_px : int
        Rows without a match that a brim may have above it. Derived: matching leaves gaps at jumps.
    blur_px : int
        Rows above the last match before a brim that are marked. Derived: matching may place a brim
        a few pixels too high.
    edge_m : tuple of float
        Least and most ground before a brim that is marked. Chosen with all suites in view: at a
        `max_slope` of 20 degrees, the lengths for falls of 0.25 m, as more may be hidden, and of
        0.7 m, as a planner keeps its own distance from deeper ones.
    edge_px : int
        Least rows of that ground. Derived: a planner needs some points to see it.
    possible_share : float
        Visible fall from which a brim is possible, as a share of the step: what is hidden behind
        it may lie deeper. Chosen with all suites in view.
    support_px, max_sparse_share : int, float
        Rows before a brim at which the ground is checked for sparse matches, and share of the brim
        from which it is not sure. Derived: half of the window in which support is counted, so that
        the gap behind the brim does not count; most of the brim.
    max_gap_m : float
        Distance over which brims in neighbouring columns are one. Derived: a wheel base.
    noises, pixel_noises : float
        Standard deviations by which the mean fall of a brim, and the fall at each of its pixels,
        exceed the least fall. Derived: the usual three; the second only keeps out most of the
        noise.
    shared_px : float
        Columns of a brim that share their noise. Derived: the widest window of the refinement.
    min_hidden_share : float
        Slope between both points, relative to the sight line's, from which the ground in between
        is hidden. Tuned on ray-cast edges and crests.
    min_sight_deg : float
        Flatter sight lines jump over gaps everywhere. Tuned on ray-cast edges and crests.
    min_sure_sight_deg : float
        Sight line from which a brim is an obstacle. Behind a flatter one, lower ground is unknown.
        Set on ray-cast edges and on one reporting scene with dunes.
    before_m, just_before_m : float
        Lengths of the ground before a brim whose slope is measured. Derived: a wheel; what is seen
        of a stair's tread.
    max_rise_deg : float
        What rises more just before it ends is an object, not the ground. Derived: half a step of
        0.10 m over that length.
    max_grazing_share, max_pixel_grazing_share : float
        Downward slope before a whole brim, and before each of its pixels, relative to the sight
        line's, from which it is a crest: ground that bends down gradually. Chosen with all suites
        in view, where `max_grazing_share` makes no difference from 0.1 to 0.4.
    min_tilt_deg : float
        Angle between the ground plane's normal and the vertical from which brims are looked for
        over a level plane as well. Derived: less lowers a step by a few centimetres at most.
    min_width_m : float
        Narrower brims are noise, or holes that no wheel enters.
    min_width_share : float
        Brims that are narrower than this share of their distance can wait until they are nearer.
        Set on the same dunes.
    """

    reach_px: int = 4
    max_unseen_px: int = 12
    blur_px: int = 1
    edge_m: tuple[float, float] = (0.14, 0.2)
    edge_px: int = 2
    possible_share: float = 0.5
    support_px: int = 12
    max_sparse_share: float = 0.5
    max_gap_m: float = 0.7
    noises: float = 3.0
    pixel_noises: float = 1.0
    shared_px: float = 33.0
    min_hidden_share: float = 0.6
    min_sight_deg: float = 8.0
    min_sure_sight_deg: float = 10.0
    before_m: float = 0.3
    just_before_m: float = 0.1
    max_rise_deg: float = 10.0
    max_grazing_share: float = 0.3
    max_pixel_grazing_share: float = 0.8
    min_tilt_deg: float = 4.0
    min_width_m: float = 0.15
    min_width_share: float = 0.1
