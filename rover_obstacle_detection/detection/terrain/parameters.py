"""Parameters of the terrain: maps, local ground, slope and drop."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from rover_obstacle_detection.detection.terrain.brim_parameters import (
    BackdropParameters,
    BrimParameters,
    ReflectionParameters,
)
from rover_obstacle_detection.detection.terrain.vertical_parameters import VerticalParameters

# A Gaussian of standard deviation s turns a ledge of height h into a slope whose steepest rise is
# h / (LEDGE_RUN s).
LEDGE_RUN = math.sqrt(2 * math.pi)


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
        Side of the finest cell over `resolved_m`. Derived: two cells across a rock of that height.
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
        Narrower objects are removed by opening before the ground is followed, and are left out of
        slopes; the larger counts.
    disc_cells : int
        Diameter of the largest disc that an opening takes at once. Derived: the opening's, in the
        finest cells of a rover with a step of 0.10 m or more; its time grows with the square.
    regrown_cells : int
        Cells by which the outline of a ledge grows back into the corners and bumps that the
        opening cut. Chosen with all suites in view.
    trend_m, trend_cells : float
        Standard deviation of the regression that the ground follows; the larger counts.
    smoothing_m, smoothing_cells : float
        Standard deviation of the final mean; the larger counts.
    ground_share : float
        Height over the trend, relative to `resolved_m`, up to which a cell is ground; over what is
        as wide as the opening, up to which nothing stands on it.
    second_ground_share : float
        Factor on that in the second pass, which starts from better ground.
    wall_share : float
        Height over the ground, relative to `resolved_m`, from which a cell is part of a wall.
        Chosen with all suites and some real pairs in view.
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
    certain_slope_noises, certain_slope_share : float
        Standard deviations by which the mean of a slope, or more than a share of its cells, must
        exceed the limit, or else it is only possible. Derived: the usual two, and twice what
        chance has beyond them.
    steep_share : float
        Least share of a slope's cells that are too steep.
    slope_margin_m : float
        Ground beside a slope that may belong to it, besides the narrowest scale. Tuned between
        free ground and the share of slopes called free, also on the tuning scenes of the suite
        `hazards`.
    hazard_probability : float
        Network output from which ground is too steep or drops away. Chosen with all suites in
        view: fewer false alarms than with a half.
    free_hazard_probability : float
        Network output up to which ground is ruled out as a hazard.
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
    relief_window_px : int
        Side of the window in which heights must agree to be free: a multiple of four, plus one.
        Derived: the narrowest window of the refinement, within which pixels share their noise.
    max_relief_share : float
        Standard deviation of these heights up to which they agree, as a share of `max_step_m`.
        About half of what a step half as high makes across the middle. Chosen with all suites in
        view.
    relief_noises : float
        What is added to that limit, in standard deviations of the height noise. Derived: pixels in
        the window share most of it.
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
    min_large_slope_share : float
        Share of the image from which a slope is large: it has no gaps, and continues into the left
        border.
    max_slope_gap_px : int
        Width of the gaps that are filled in large slopes. Chosen with all suites in view.
    vertical : VerticalParameters
    backdrop : BackdropParameters
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
    disc_cells: int = 17
    regrown_cells: int = 2
    trend_m: float = 0.4
    trend_cells: float = 2.5
    smoothing_m: float = 0.08
    smoothing_cells: float = 1.2
    ground_share: float = 0.5
    second_ground_share: float = 0.6
    wall_share: float = 2.0
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
    certain_slope_noises: float = 2.0
    certain_slope_share: float = 0.05
    steep_share: float = 0.4
    slope_margin_m: float = 0.06
    hazard_probability: float = 0.7
    free_hazard_probability: float = 0.1
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
    relief_window_px: int = 9
    max_relief_share: float = 0.13
    relief_noises: float = 0.5
    border_reach_m: float = 0.35
    min_wall_m: float = 0.5
    min_wall_share: float = 0.5
    certain_noises: float = 3.0
    border_px: float = 5
    min_large_slope_share: float = 0.0025
    max_slope_gap_px: int = 10
    vertical: VerticalParameters = field(default_factory=VerticalParameters)
    backdrop: BackdropParameters = field(default_factory=BackdropParameters)
    brims: BrimParameters = field(default_factory=BrimParameters)
    reflections: ReflectionParameters = field(default_factory=ReflectionParameters)

    @property
    def resolved_m(self) -> float:
        """Size of what the maps resolve, metres: the step, or a higher rover's finest slopes."""
        return min(self.max_step_m, self.rise_scales_m[0])

    @property
    def scales_of_rise_m(self) -> tuple[float, ...]:
        """Standard deviations at which the rise is measured, metres.

        `rise_scales_m`, unless a ledge as high as a small step, or for a rover that climbs steep
        slopes, would not be too steep at the narrowest one. No map has a finer scale than a cell.
        """
        limit = math.tan(math.radians(self.max_slope_deg))
        narrowest_m, *wider_m = self.rise_scales_m
        return min(narrowest_m, self.max_step_m / (LEDGE_RUN * max(limit, 1e-6))), *wider_m
