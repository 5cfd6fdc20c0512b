from __future__ import annotations

from dataclasses import replace

import numpy as np
from relief import PosedCamera, block, flat

from rover_obstacle_detection.detection.rocks.parameters import RockParameters
from rover_obstacle_detection.detection.rocks.rocks import outlined_rocks
from rover_obstacle_detection.detection.rocks.standing import standing_parts
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.survey import survey

POSED = PosedCamera(pitch_deg=40.0, height_m=1.2)
ROCK = block(0.0, 1.4, 0.3, 0.25)
PARAMETERS = RockParameters(max_step_m=0.1)


class Drawing:
    """A network that gives every pixel the same probability, and records its windows."""

    def __init__(self, probability):
        self.probability = probability
        self.windows = []

    def __call__(self, stereo, terrain, standing, window, parameters):
        self.windows.append(window)
        drawn = standing.parts[window] > 0
        if not drawn.any():
            drawn = ~terrain.measured[window]
        return np.where(drawn, self.probability, 0).astype(np.float32)


def find(height, draw, *, unmatched=None, rover_mask=None, parameters=PARAMETERS):
    disparity, _, _ = POSED.look(height)
    if unmatched:
        disparity[unmatched] = 0
    stereo = POSED.stereo(disparity)
    stereo = replace(stereo, frame=replace(stereo.frame, rover_mask=rover_mask))
    terrain = survey(stereo, TerrainParameters(max_step_m=parameters.max_step_m))
    standing = standing_parts(terrain, parameters)
    return outlined_rocks(stereo, terrain, standing, parameters, draw), standing.parts > 0


def test_outlined_rock_is_too_high():
    draw = Drawing(0.9)
    found, stands = find(ROCK, draw)
    assert stands.sum() > 100
    np.testing.assert_array_equal(found.high, stands)
    assert not found.by_sight.any()
    assert (found.probability[stands] == np.float32(0.9)).all()


def test_rock_that_is_not_outlined_is_no_obstacle():
    found, stands = find(ROCK, Drawing(0.4))
    assert stands.any()
    assert not found.high.any()
    lower = replace(PARAMETERS, outline_probability=0.3)
    found, _ = find(ROCK, Drawing(0.4), parameters=lower)
    assert found.high.any()


def test_network_sees_only_the_surroundings_of_what_stands_up():
    draw = Drawing(0.9)
    found, stands = find(ROCK, draw)
    seen = np.zeros(stands.shape, bool)
    for window in draw.windows:
        seen[window] = True
    assert seen[stands].all()
    assert seen.mean() < 0.5
    np.testing.assert_array_equal(np.isfinite(found.probability), seen)


def test_network_sees_nothing_of_flat_ground():
    draw = Drawing(0.9)
    found, _ = find(flat, draw)
    assert draw.windows == []
    assert np.isnan(found.probability).all()
    assert not found.high.any()


def test_ground_without_3d_is_judged_by_sight():
    gap = np.s_[60:110, 80:130]
    found, _ = find(flat, Drawing(0.9), unmatched=gap)
    assert found.by_sight[gap].all()
    assert not found.high.any()


def test_rover_is_not_judged_by_sight():
    gap = np.s_[60:110, 80:130]
    rover_mask = np.zeros(POSED.camera.shape, bool)
    rover_mask[gap] = True
    draw = Drawing(0.9)
    found, _ = find(flat, draw, unmatched=gap, rover_mask=rover_mask)
    assert draw.windows == []
    assert not found.by_sight.any()


def test_small_gaps_are_not_shown_to_the_network():
    draw = Drawing(0.9)
    find(flat, draw, unmatched=np.s_[60:68, 80:130])
    assert draw.windows == []


def test_network_is_overruled_where_something_high_is_upright():
    found, stands = find(block(0.0, 1.4, 0.06, 0.5), Drawing(0.1))
    overruled = found.probability == 1
    assert overruled.sum() > 40
    assert found.high[overruled].all()
    assert not found.high[~stands].any()
