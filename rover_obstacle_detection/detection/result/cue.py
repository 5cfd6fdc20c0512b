"""What can make a pixel an obstacle."""

from __future__ import annotations

from enum import IntFlag


class Cue(IntFlag):
    """What made a pixel an obstacle; a pixel may have several.

    Attributes
    ----------
    HEIGHT
        It stands above the local ground.
    SLOPE
        The ground is too steep.
    DROP
        The ground lies too far below its rim.
    GREY_LEVEL
        It has no 3D, and looks like an obstacle in the image.
    ROUGHNESS_STEP
        The ground is too rough.
    """

    HEIGHT = 1
    SLOPE = 2
    DROP = 4
    GREY_LEVEL = 16
    ROUGHNESS_STEP = 32
