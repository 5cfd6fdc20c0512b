"""Parameters of the terrain: maps, local ground, slope, drop and the vertical."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class VerticalParameters:
    """How the vertical is estimated from the ground in view.

    Except where another origin is given, the values were tuned on the tuning scenes.

    Parameters
    ----------
    range_m : float
        Ground farther ahead is ignored.
    max_cells : int
        Cells that are fitted; more are thinned.
    min_cells : int
        With fewer, the plane's own normal is kept.
    iterations : int
        Reweightings of each fit.
    relief_m : float
        Deviation from a plane at which a cell counts half. Derived: relief of driveable ground.
    nearness : float
        Power of the distance with which a cell's weight falls.
    nearest_m : float
        Ground nearer than this is ignored.
    min_distance_m : float
        Distance below which the weight grows no further.
    known_m : float
        Height noise with which a cell counts half.
    tail_share : float
        Share of the cells at either end that the search for a bend leaves out.
    turns_deg : tuple of float
        Directions across which the ground may bend, to the right of straight ahead.
    hinges : int
        Distances at which a bend is tried first.
    first_hinge, last_hinge : float
        Their ends, relative to the nearest and the farthest ground.
    refinement_steps : int
        Further distances on either side of the best one, for each step of the first search.
    bend_width_m : float
        Half-length over which the slope changes, in the first search.
    bend_widths_m : tuple of float
        The same in the second search.
    search_cells : int
        With more cells than this, the search for a bend uses every `search_thinning`-th.
    search_thinning : int
    even_cost : float
        Cost of a fit below which no steps are searched. Derived: that of ground which deviates by
        half a centimetre.
    step_distances : int
        Distances at which a step is tried, first everywhere and then around the best.
    step_width_m : float
        Half-length over which the height changes at a step. Derived: a cell of the map.
    max_steps : int
        Most steps that are fitted.
    first_turns : int
        Directions in which a second step is searched: those in which one step fits best.
    cost_tolerance : float
        Relative excess cost at which a bend's weight in the mean falls to 1 / e.
    min_bend_deg : float
        Smaller bends are undulation.
    max_cost_share : float
        Cost of a bent fit, relative to a flat one, above which there is no bend; of steps,
        relative to the better of both, above which there are none.
    max_more_share : float
        Cost of one more step, relative to those without it, above which no more are searched.
        Chosen on ray-cast ledges and terraces and all scenes of `standard` and `hazards`.
    max_turn_deg : float
        Greatest angle between the vertical and the normal of the ground plane; beyond it, the
        normal counts. Set between 8 degrees, the most on slopes and dunes, and 18 beside a canyon.
    level_share : float
        Nearer share of the ground before the bend that is fitted once more by itself.
    """

    range_m: float = 12.0
    max_cells: int = 2000
    min_cells: int = 20
    iterations: int = 5
    relief_m: float = 0.03
    nearness: float = 2.0
    nearest_m: float = 0.05
    min_distance_m: float = 0.3
    known_m: float = 0.2
    tail_share: float = 0.02
    turns_deg: tuple[float, ...] = (-30, -15, 0, 15, 30)
    hinges: int = 7
    first_hinge: float = 1.3
    last_hinge: float = 0.75
    refinement_steps: int = 3
    bend_width_m: float = 0.15
    bend_widths_m: tuple[float, ...] = (0.05, 0.15, 0.3, 0.5)
    search_cells: int = 500
    search_thinning: int = 4
    even_cost: float = 0.03
    step_distances: int = 14
    step_width_m: float = 0.05
    max_steps: int = 4
    first_turns: int = 3
    cost_tolerance: float = 0.1
    min_bend_deg: float = 6.0
    max_cost_share: float = 0.6
    max_more_share: float = 0.9
    max_turn_deg: float = 15.0
    level_share: float = 0.5


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
    edge_m, edge_px : float, int
        Ground before a brim that is marked, and least rows of it. Derived: the finest scale at
        which slopes are measured, where the ground falls with the brim; a planner needs some
        points to see it.
    noises : float
        Standard deviations by which a drop exceeds the step. Derived: the usual three.
    min_hidden_share : float
        Slope between both points, relative to the sight line's, from which the ground in between
        is hidden. Tuned on ray-cast edges and crests.
    min_sight_deg : float
        Flatter sight lines jump over gaps everywhere. Tuned on ray-cast edges and crests.
    min_sure_sight_deg : float
        Sight line from which a brim is an obstacle. Behind a flatter one, lower ground is unknown.
        Set on ray-cast edges and on one reporting scene with dunes.
    before_m : float
        Length of the ground before a brim whose slope is measured. Derived: a wheel.
    max_rise_deg : float
        What rises more just before it ends is an object, not the ground. Derived: half a step of
        0.10 m over that length.
    max_grazing_share : float
        Downward slope before the brim, relative to the sight line's, from which it is a crest:
        ground that bends down gradually. Tuned on ray-cast edges and crests.
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
    edge_m: float = 0.14
    edge_px: int = 2
    noises: float = 3.0
    min_hidden_share: float = 0.6
    min_sight_deg: float = 8.0
    min_sure_sight_deg: float = 10.0
    before_m: float = 0.3
    max_rise_deg: float = 10.0
    max_grazing_share: float = 0.5
    min_tilt_deg: float = 4.0
    min_width_m: float = 0.15
    min_width_share: float = 0.1


@dataclass(frozen=True)
class TerrainParameters:
    """How the ground is mapped and judged.

    Except where another origin is given, the values were tuned on the tuning scenes. *Set by the
    user* means a field of `DetectorConfig`.

    Parameters
    ----------
    max_step_m, max_slope_deg, max_roughness_m, max_range_m : float
        The rover's limits; a roughness of 0 is not judged. Set by the user.
    cell_per_step : float
        Side of the finest cell over `max_step_m`. Derived: two cells across a rock of that height.
    max_layers, max_cells : int
        Maps, each twice as coarse as the one before, and most cells along one.
    rows_per_cell : float
        Image rows to a cell at the far end of its layer. Derived: fewer leave empty cells.
    overlap_factor, overlap_m : float
        A layer also maps this much, as a factor and in metres, beyond its span.
    repose_deg : float
        Loose ground slides where it is steeper: what stands above such a slope is not mapped as
        ground. Derived: angle of repose of dry sand.
    cell_relief_m : float
        Relief within a cell: pixels that are noisier count less.
    min_noise_m : float
        Height noise below which a pixel's weight grows no further.
    opening_m, opening_cells : float
        Narrower objects are removed by opening before the ground is followed; the larger counts.
    trend_m, trend_cells : float
        Standard deviation of the regression that the ground follows; the larger counts.
    smoothing_m, smoothing_cells : float
        Standard deviation of the final mean; the larger counts.
    ground_share : float
        Height over the trend, relative to `max_step_m`, up to which a cell is ground.
    second_ground_share : float
        Factor on that in the second pass, which starts from better ground.
    trend_ridge, rise_ridge : float
        Regularisation of the regression for the trend and the rise, as a share of the Gaussian's
        variance.
    cells_per_sigma : int
        Cells in a standard deviation of the coarser grid that a wide regression runs on.
    reach_sigmas : float
        Radius of the regression's kernel, standard deviations.
    min_lever_share : float
        Lever of distance noise on height is at least this share of the camera's height. Derived:
        ground seen along itself still has relief.
    shared_pixels : float
        Pixels that share their noise: a mean over n has that of n / `shared_pixels` independent
        ones. About the 81 pixels of the narrowest refinement window.
    rise_scales_m : tuple of float
        Standard deviations at which the rise is measured: half a wheel, so that a ledge little
        higher than a step is still steeper than most rovers climb, up to a wheel base. Chosen on
        ray-cast ledges and the suites `hazards` and `standard`.
    tolerated_rise_noise_deg : float
        Noise of the rise at which the next wider scale takes over.
    narrowest_rise_noise_deg : float
        The same at the narrowest scale. Less, since errors of matching are as wide. Chosen on
        noisy tuning scenes.
    max_rise_noise_deg : float
        Rises with more noise are ignored.
    lost_slope_deg : float
        Slope that smoothing removes where a slope begins and ends.
    max_lost_share : float
        The same relative to a small `max_slope_deg`, where free ground is concerned.
    free_noises : float
        Standard deviations, of the rise or of the height, by which a slope or a hollow must stay
        within the limit to be free. Derived: the usual two.
    steep_share : float
        Least share of a slope's cells that are too steep.
    slope_margin_m : float
        Ground beside a slope that belongs to it. Tuned between the outlines of slopes and the
        share of their pixels called free, also on the tuning scenes of the suite `hazards`.
    min_scale_cells : float
        Least standard deviation of the windows of drop and roughness, cells.
    drop_scale_m : float
        Standard deviation at which drops are measured. Derived: scale of the rover's wheels.
    common_noise_share : float
        Share of a pixel's noise that is common to all pixels around it.
    max_hollow_m : float
        Hollows that are wider are terrain, not drops.
    min_hollow_m : float
        Hollows that are shallower, or shallower than half of a small `max_step_m`, are free,
        however great the noise. Derived: relief of driveable ground.
    hollow_cells : int
        Cells across that width in which drops are searched.
    drop_noises : float
        Standard deviations of height by which a drop exceeds the step.
    roughness_scale_m : float
        Standard deviation of the window of roughness. Derived: half a wheel base.
    max_noise_share : float
        Height noise, relative to `max_step_m`, above which a pixel is unknown. Derived: two
        standard deviations are a step.
    max_ground_noise_share : float
        The same for slope and drop, which average over many pixels.
    border_reach_m : float
        Distance to which a slope continues into the left border.
    min_wall_m : float
        Height from which something is an obstacle whatever the network says, and continues into
        the left border as far as it is high. Derived: higher than most rocks, and than errors of
        the local ground.
    min_wall_share : float
        Share of that height that must be seen, as false matches are small.
    certain_noises : float
        Standard deviations by which a height exceeds that, or the step. Derived: the usual three.
    border_px : float
        Matches are unreliable within this distance of the right image's left border.
    min_border_slope_share : float
        Share of the image below which a slope does not continue.
    vertical : VerticalParameters
    brims : BrimParameters
    reflections : ReflectionParameters
    """

    max_step_m: float = 0.10
    max_slope_deg: float = 20.0
    max_roughness_m: float = 0.0
    max_range_m: float = 40.0
    cell_per_step: float = 0.4
    max_layers: int = 5
    max_cells: int = 1000
    rows_per_cell: float = 2.0
    overlap_factor: float = 1.25
    overlap_m: float = 1.0
    repose_deg: float = 35.0
    cell_relief_m: float = 0.03
    min_noise_m: float = 0.005
    opening_m: float = 0.7
    opening_cells: float = 3.0
    trend_m: float = 0.4
    trend_cells: float = 2.5
    smoothing_m: float = 0.08
    smoothing_cells: float = 1.2
    ground_share: float = 0.5
    second_ground_share: float = 0.6
    trend_ridge: float = 0.02
    rise_ridge: float = 1e-3
    cells_per_sigma: int = 3
    reach_sigmas: float = 3.5
    min_lever_share: float = 0.3
    shared_pixels: float = 100.0
    rise_scales_m: tuple[float, ...] = (0.1, 0.14, 0.25, 0.5)
    tolerated_rise_noise_deg: float = 3.0
    narrowest_rise_noise_deg: float = 2.0
    max_rise_noise_deg: float = 20.0
    lost_slope_deg: float = 2.5
    max_lost_share: float = 0.125
    free_noises: float = 2.0
    steep_share: float = 0.4
    slope_margin_m: float = 0.06
    min_scale_cells: float = 0.6
    drop_scale_m: float = 0.10
    common_noise_share: float = 0.5
    max_hollow_m: float = 1.8
    min_hollow_m: float = 0.03
    hollow_cells: int = 20
    drop_noises: float = 3.0
    roughness_scale_m: float = 0.25
    max_noise_share: float = 0.5
    max_ground_noise_share: float = 1.5
    border_reach_m: float = 0.35
    min_wall_m: float = 0.5
    min_wall_share: float = 0.5
    certain_noises: float = 3.0
    border_px: float = 5
    min_border_slope_share: float = 0.0025
    vertical: VerticalParameters = field(default_factory=VerticalParameters)
    backdrop: BackdropParameters = field(default_factory=BackdropParameters)
    brims: BrimParameters = field(default_factory=BrimParameters)
    reflections: ReflectionParameters = field(default_factory=ReflectionParameters)
