from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.study.limits import exceeds_terrain_limits
from rover_obstacle_detection.detection.study.parameters import StudyParameters


def exceeds(roughness, step, disparity=1e6, elevation=-1.0, **limits):
    def pixel(value):
        return np.full((1, 1), value, np.float32)

    return bool(
        exceeds_terrain_limits(
            pixel(roughness),
            pixel(step),
            pixel(disparity),
            pixel(elevation),
            StudyParameters(**limits),
        )[0, 0]
    )


@pytest.mark.parametrize(
    ('roughness', 'step', 'obstacle'),
    [
        (0.0004, 0.004, False),
        (0.0006, 0.004, True),
        (0.0004, 0.006, True),
        (np.nan, 0.006, True),
        (np.nan, 0.004, False),
        (np.nan, np.nan, False),
    ],
)
def test_either_limit_makes_an_obstacle(roughness, step, obstacle):
    assert exceeds(roughness, step) == obstacle


def test_limits_are_parameters():
    assert not exceeds(0.0, 0.09, max_step_m=0.1)
    assert exceeds(0.0, 0.11, max_step_m=0.1)
    assert exceeds(0.03, 0.0, max_roughness_m=0.02, max_step_m=0.1)


def test_terrain_at_the_limit_is_free():
    assert not exceeds(0.0, 0.0, elevation=0.0, max_roughness_m=0.0, max_step_m=0.0)


def test_noise_widens_the_limits_with_the_range():
    assert exceeds(0.0, 0.02, disparity=40.0)
    assert not exceeds(0.0, 0.02, disparity=5.0)
    assert exceeds(0.0, 0.2, disparity=5.0)
    assert exceeds(0.0, 0.02, disparity=5.0, elevation=-0.1)


def test_no_limit_is_exceeded_without_a_match():
    assert not exceeds(0.1, 0.1, disparity=0.0)
