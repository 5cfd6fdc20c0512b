"""Rims of a rock of 0.3 m that stands at 2 m, before ground at up to 4 m."""

from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.result.cue import Cue
from rover_obstacle_detection.detection.result.parameters import ResultParameters
from rover_obstacle_detection.detection.result.rims import find_rims

CAMERA = StereoCamera(60, 40, 100.0, 100.0, 29.5, 19.5, 0.2)
ROCK = np.s_[10:30, 20:40]
PARAMETERS = ResultParameters(max_step_m=0.1)


class View:
    """Depth, height and cues of the rock, which the tests change."""

    def __init__(self):
        self.depth_m = np.repeat(np.linspace(4, 2, 40, dtype=np.float32)[:, None], 60, axis=1)
        self.height_m = np.zeros(CAMERA.shape, np.float32)
        self.noise_m = np.full(CAMERA.shape, 0.001, np.float32)
        self.cues = np.zeros(CAMERA.shape, np.uint8)
        self.depth_m[ROCK] = 2.0
        self.height_m[ROCK] = np.linspace(0.3, 0.01, 20)[:, None]
        self.cues[ROCK] = Cue.HEIGHT
        self.numbers = (self.cues > 0).astype(np.int32)

    def put(self, where, depth_m, height_m, cue=None):
        self.depth_m[where], self.height_m[where] = depth_m, height_m
        if cue is not None:
            self.cues[where] = cue
            self.numbers[where] = cue > 0

    def rims(self, **changes):
        disparity = np.float32(CAMERA.fx * CAMERA.baseline_m) / self.depth_m
        parameters = ResultParameters(max_step_m=0.1, **changes)
        return find_rims(
            np.nan_to_num(disparity, nan=0.0),
            self.height_m,
            self.noise_m,
            self.cues,
            self.numbers,
            CAMERA,
            1.0,
            parameters,
        )


def test_a_rock_that_was_matched_well_has_no_rim():
    rims = View().rims()
    assert not rims.behind.any(), 'its foot is low, but no farther than the rest'
    assert not rims.before.any()


@pytest.mark.parametrize('side', [np.s_[10:12, 20:40], np.s_[10:20, 20:22], np.s_[10:20, 38:40]])
def test_pixels_with_the_ground_behind_are_a_rim(side):
    view = View()
    view.put(side, 3.0, 0.0)
    expected = np.zeros(CAMERA.shape, bool)
    expected[side] = True
    np.testing.assert_array_equal(view.rims().behind, expected)


@pytest.mark.parametrize(
    ('depth_m', 'height_m', 'rim'),
    [(2.15, 0.0, True), (2.05, 0.0, False), (2.6, 0.15, True), (2.6, 0.25, False)],
)
def test_a_rim_is_clearly_behind_and_lower_than_the_body(depth_m, height_m, rim):
    view = View()
    view.put(np.s_[10:12, 20:40], depth_m, height_m)
    assert view.rims().behind.any() == rim


def test_noise_of_depth_hides_a_rim():
    view = View()
    view.put(np.s_[10:12, 20:40], 2.3, 0.0)
    assert view.rims().behind.any()
    # At 1 m above the ground, 0.05 m of height at 2.3 m are 0.115 m of depth.
    view.noise_m[:] = 0.05
    assert not view.rims().behind.any()


def test_the_foot_of_a_rock_behind_is_no_rim_of_the_rock_before_it():
    view = View()
    view.put(np.s_[2:10, 20:40], 3.0, np.linspace(0.3, 0.0, 8)[:, None], np.uint8(Cue.HEIGHT))
    assert not view.rims().behind.any()


def test_a_small_obstacle_beside_another_keeps_its_points():
    view = View()
    small = np.s_[10:14, 42:46]
    view.put(small, 3.0, 0.05, np.uint8(Cue.HEIGHT))
    view.numbers[small] = 2
    assert not view.rims().behind.any()
    view.numbers[small] = 1
    assert view.rims().behind[small].all(), 'as a part of the other it is a rim'


@pytest.mark.parametrize('cue', [Cue.SLOPE, Cue.DROP, Cue.HEIGHT | Cue.SLOPE, Cue.ROUGHNESS_STEP])
def test_ground_has_no_rim(cue):
    view = View()
    view.put(np.s_[10:12, 20:40], 3.0, 0.0, np.uint8(cue))
    assert not view.rims().behind.any()


def test_a_part_without_3d_but_seen_may_have_a_rim():
    view = View()
    view.put(np.s_[10:12, 20:40], 3.0, 0.0, np.uint8(Cue.GREY_LEVEL))
    assert view.rims().behind[10:12, 20:40].all()


def test_free_pixels_with_the_depth_of_the_rock_are_a_rim():
    view = View()
    view.put(np.s_[8:10, 20:40], 2.02, 0.32)
    expected = np.zeros(CAMERA.shape, bool)
    expected[8:10, 20:40] = True
    np.testing.assert_array_equal(view.rims().before, expected)


@pytest.mark.parametrize(
    ('where', 'depth_m', 'height_m'),
    [
        (np.s_[8:10, 20:40], 3.0, 0.32),
        (np.s_[8:10, 20:40], 2.0, 0.03),
        (np.s_[8:10, 52:56], 2.0, 0.32),
    ],
    ids=['behind', 'low', 'elsewhere'],
)
def test_other_free_pixels_are_no_rim(where, depth_m, height_m):
    view = View()
    view.put(where, depth_m, height_m)
    assert not view.rims().before.any()


def test_pixels_without_3d_are_no_rim():
    view = View()
    view.put(np.s_[6:12, 20:40], np.nan, np.nan)
    rims = view.rims()
    assert not rims.behind.any()
    assert not rims.before.any()


def test_a_pixel_is_at_a_rim_within_reach_of_the_body():
    view = View()
    view.put(np.s_[15, 10:20], 2.02, 0.32)
    view.put(np.s_[15, 40:50], 2.02, 0.32)
    expected = np.zeros(CAMERA.shape, bool)
    expected[15, 17:20] = expected[15, 40:43] = True
    np.testing.assert_array_equal(view.rims(rim_reach_px=3).before, expected)


def test_rocks_nearer_than_a_metre_have_rims():
    view = View()
    view.put(np.s_[10:12, 20:40], 3.0, 0.0)
    view.depth_m /= 4
    assert view.rims().behind[10:12, 20:40].all()


@pytest.mark.parametrize(('cue', 'number'), [(0, 1), (Cue.HEIGHT, 0)])
def test_pixels_without_a_cue_or_of_no_obstacle_have_no_rim(cue, number):
    view = View()
    side = np.s_[10:12, 20:40]
    view.put(side, 3.0, 0.0, np.uint8(cue))
    view.numbers[side] = number
    assert not view.rims().behind.any()
