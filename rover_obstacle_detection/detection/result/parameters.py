"""Parameters of the result: confidence and the measures of obstacles."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ResultParameters:
    """How obstacles are measured, and how the confidence in them is found.

    Parameters
    ----------
    method : str
        Detection method, which the confidence was fitted for. Set by the user.
    max_step_m : float
        The rover's step. Set by the user.
    block_size_px : int
        Side of the matching block, within which pixels share their noise. Set by the user.
    min_confidence : float
        Specks of steep or low ground with less confidence are removed. Set by the user.
    ground_cell_m : float
        Side of the cells of the ground that have one ground point each; 0: each pixel has one. Set
        by the user.
    grid_cell_m : float
        Side of the cells of the grid. Set by the user.
    grid_extent_m : float
        Length of the grid ahead of the camera. Set by the user.
    speck_share : float
        Share of the image below which an area of steep or low ground is a speck. Tuned on the
        tuning scenes.
    min_obstacle_px : int
        Pixels below which an obstacle is a speck. Tuned on the tuning scenes.
    outline_px : int
        Distance from an obstacle to the nearest free pixels. Derived: half of the narrowest window
        of the refinement, within which heights are mixed.
    tail_share : float
        Share of an obstacle's points at either end that its box leaves out. Derived: one false
        match would make a box as deep as the scene.
    rim_reach_px : int
        Distance in the image to which matching smears depth across the outline of an obstacle.
        Chosen on the sample and tuning scenes, as the three that follow.
    rim_share : float
        Share of the height around it, and of `max_step_m`, below which a pixel of an obstacle is
        as low as ground, and above which a free pixel is as high as an obstacle.
    rim_gap_m : float
        Least depth by which the ground lies clearly behind an obstacle, metres: two cells of a
        usual costmap.
    rim_noises : float
        The same in standard deviations of the depth.
    typical_noise_px : float
        Disparity noise of clean pairs; the evidence of noisier pairs counts less. Measured on the
        tuning scenes.
    noise_spacing_px : int
        Distance between the three pixels whose disparities measure that noise. Derived: neighbours
        share theirs.
    max_difference_px : float
        Limit of the differences between them: larger ones are rims of objects.
    faint_contrast : float
        Edge strength at which an outline is hardly visible, grey levels per pixel.
    min_noise_share : float
        Height noise over the step below which less noise hardly adds confidence.
    max_rock_probability : float
        Limit of the network's probability, so that its log odds stay finite. The last three were
        tuned on the tuning scenes.
    """

    method: str = 'hybrid'
    max_step_m: float = 0.10
    block_size_px: int = 3
    min_confidence: float = 0.9
    ground_cell_m: float = 0.05
    grid_cell_m: float = 0.10
    grid_extent_m: float = 10.0
    speck_share: float = 0.0025
    min_obstacle_px: int = 12
    outline_px: int = 4
    tail_share: float = 0.02
    rim_reach_px: int = 8
    rim_share: float = 0.7
    rim_gap_m: float = 0.10
    rim_noises: float = 3.0
    typical_noise_px: float = 0.1
    noise_spacing_px: int = 2
    max_difference_px: float = 4.0
    faint_contrast: float = 0.2
    min_noise_share: float = 0.05
    max_rock_probability: float = 0.99
