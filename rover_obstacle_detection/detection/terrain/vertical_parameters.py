"""Parameters of the vertical: bends and steps of the ground in view."""

from __future__ import annotations

from dataclasses import dataclass


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
        Directions in which a second step is searched: those in which one step fits best. Chosen on
        stairs drawn by hand and ray-cast.
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
