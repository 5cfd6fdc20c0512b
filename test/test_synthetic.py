"""The renderer that the tests of the detector rely on."""

from __future__ import annotations

import math

import pytest
from synthetic import Box, mast, render


def test_depth_and_height_are_those_of_the_geometry():
    view = render(mast(solids=(Box(0.0, 1.2, 0.3, 0.3, 0.3),)))
    camera = view.scene.camera
    # On flat ground, depth in the middle column follows from the pitch.
    row = 200
    angle = math.radians(46) + math.atan((row - camera.cy) / camera.fy)
    expected = 1.0 / math.sin(angle) * math.cos(angle - math.radians(46))
    assert view.depth_m[row, 160] == pytest.approx(expected, rel=1e-6)
    assert view.height_m[view.surface == 1].max() == pytest.approx(0.3)
