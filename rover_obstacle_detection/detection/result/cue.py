"""What can make a pixel an obstacle."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntFlag
from types import MappingProxyType
from typing import Literal

Kind = Literal['rock', 'slope', 'drop', 'unmeasured', 'rough']
"""What an obstacle is, by the cue of most of its pixels."""


class Cue(IntFlag):
    """What made a pixel an obstacle; a pixel may have several.

    Attributes
    ----------
    HEIGHT
        It stands above the local ground.
    SLOPE
        The ground is too steep, or there is no ground in view.
    DROP
        The ground ends at the brim of a drop, or lies too far below the rim of a hollow.
    GREY_LEVEL
        It is dark and has hardly any 3D (method `study`).
    ROUGHNESS_STEP
        The ground is too rough.
    """

    HEIGHT = 1
    SLOPE = 2
    DROP = 4
    GREY_LEVEL = 16
    ROUGHNESS_STEP = 32


KINDS: Mapping[Cue, Kind] = MappingProxyType(
    {
        Cue.HEIGHT: 'rock',
        Cue.SLOPE: 'slope',
        Cue.DROP: 'drop',
        Cue.GREY_LEVEL: 'unmeasured',
        Cue.ROUGHNESS_STEP: 'rough',
    }
)
"""Kind of obstacle that each cue makes."""

# Users rely on them: a new kind gets a new number.
KIND_NUMBERS: Mapping[Kind, int] = MappingProxyType(
    {'rock': 1, 'slope': 2, 'drop': 3, 'rough': 4, 'unmeasured': 5}
)
"""Number of each kind in images and clouds; 0 is no obstacle."""
