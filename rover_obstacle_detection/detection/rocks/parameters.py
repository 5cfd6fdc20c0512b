"""Parameters of the rocks: what stands up, what the network outlines, what is too high."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RockParameters:
    """How rocks are found, outlined and judged.

    Except where another origin is given, the values were tuned on the tuning scenes. *Set by the
    user* means a field of `DetectorConfig`.

    Parameters
    ----------
    max_step_m, max_range_m : float
        The rover's step, and the farthest distance that is judged. Set by the user.
    core_share, core_noises : float
        A rock has to rise above this share of the step and this many standard deviations of its
        height noise. Set by the user.
    outline_probability : float
        Network output from which a pixel is inside an outline. Set by the user.
    foot_m, foot_share, foot_noises : float
        A pixel stands up above this height or share of the step, whichever is less, and this many
        standard deviations.
    candidate_share, candidate_noises : float
        The same for the core of a part that the network is asked about.
    free_probability : float
        Network output from which a pixel is not free, whether or not it is an obstacle. Chosen on
        the tuning scenes of the suite `hazards` and all of `standard`.
    min_core_pixels : int
        Pixels of a core.
    top_share : float
        Share of a part's pixels that its height is averaged over.
    unmeasured_px : int
        Side of the smallest area without 3D beside what stands up that the network is asked about.
    dark_side_px : int
        Distance from what stands up within which it is asked about them.
    outline_reach_px : int
        Distance from what stands up within which it is asked about outlines. Measured on rendered
        rocks: farther away, asking changes nothing.
    hole_share : float
        Share of the step above which a hole in an outline is filled.
    min_measured_share : float
        Least share of an outlined rock's pixels with 3D. Derived: a rock's shadowed side may have
        none.
    standing_share : float
        Share of an outlined rock's measured pixels that have to stand up.
    full_step_px : float
        Size of the step in the image below which matching flattens rocks.
    min_seen_share : float
        Share of the step that the smallest of those have to reach.
    small_step_px : float
        Size of the step in the image below which a rock's size counts as well as its height.
        Derived: height noise grows with the square of the distance, size noise with the distance.
    accepted_probability : float
        Mean network output from which a rock is accepted by its looks.
    possible_noises : float
        Stereo allows for such a rock if it could be high enough within this many standard
        deviations.
    possible_share : float
        Share of the rock's measured pixels at which stereo has to allow for it.
    apparent_share : float
        Share of the rock's apparent height that counts as high enough.
    certain_share : float
        Height over the step above which something upright is an obstacle whatever the network
        says.
    certain_noise_share : float
        Height noise over the step up to which such a height is certain.
    certain_pixels : int
        Pixels with a certain height that this takes.
    drawn_share : float
        Share of these pixels inside an outline from which the network agrees.
    upright_ratio : float
        Height over width in the image of what is upright. Derived: wider parts are mostly ground
        whose local ground came out too low; a lander's legs are upright.
    half_height_reach_px : int
        Pixels below a pixel in which something twice as high makes it a blurred rim. Derived:
        disparity blurs rims by the size of the matching block.
    """

    max_step_m: float = 0.10
    max_range_m: float = 40.0
    core_share: float = 1.0
    core_noises: float = 0.7
    outline_probability: float = 0.5
    foot_m: float = 0.02
    foot_share: float = 0.2
    foot_noises: float = 1.0
    candidate_share: float = 0.6
    candidate_noises: float = 2.5
    free_probability: float = 0.1
    min_core_pixels: int = 3
    top_share: float = 0.1
    unmeasured_px: int = 9
    dark_side_px: int = 48
    outline_reach_px: int = 4
    hole_share: float = 0.5
    min_measured_share: float = 0.12
    standing_share: float = 0.3
    full_step_px: float = 20.0
    min_seen_share: float = 0.7
    small_step_px: float = 10.0
    accepted_probability: float = 0.7
    possible_noises: float = 3.0
    possible_share: float = 0.1
    apparent_share: float = 0.2
    certain_share: float = 1.5
    certain_noise_share: float = 0.15
    certain_pixels: int = 40
    drawn_share: float = 0.9
    upright_ratio: float = 1.5
    half_height_reach_px: int = 5

    @property
    def min_standing_m(self) -> float:
        """Height above which a pixel stands up, noise apart."""
        return min(self.foot_m, self.foot_share * self.max_step_m)
