"""What can make a pixel an obstacle."""

from __future__ import annotations

from enum import IntFlag


class Cue(IntFlag):
    """What made a pixel an obstacle; a pixel may have several, and outlines add pixels of none."""

    HEIGHT = 1
    SLOPE = 2
    DROP = 4
    REGION = 8
    GREY_LEVEL = 16
    ROUGHNESS_STEP = 32
