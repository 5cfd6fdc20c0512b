from __future__ import annotations

import numpy as np
import pytest
import waves

from rover_obstacle_detection.detection.camera import StereoCamera
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.gravity import Gravity, GroundPlane
from rover_obstacle_detection.detection.ground_matching import Stereo
from rover_obstacle_detection.detection.ground_plane import DisparityPlane
from rover_obstacle_detection.detection.outline_planes import EVERYWHERE
from rover_obstacle_detection.detection.parallax import parallax_evidence
from rover_obstacle_detection.detection.row_alignment import RowAlignment
from rover_obstacle_detection.detection.survey import survey

CAMERA = StereoCamera(240, 180, 150.0, 150.0, 119.5, 89.5, 0.1)
UP = Gravity.from_angles(35.0).up
GROUND = GroundPlane(UP, 1.0, UP)
NOISE = 2.0
INNER = np.s_[60:-30, 60:-20]
RAISED = np.s_[100:130, 100:150]


def evidence_of(true_rise_px=0.0, matched_rise_px=0.0, window=EVERYWHERE, contrast=20.0):
    """Ground, in the middle raised by one disparity and matched by another."""
    plane = DisparityPlane.from_ground(GROUND, CAMERA)
    expected = np.maximum(plane.disparity(CAMERA), 0).astype(np.float32)
    rise = np.zeros_like(expected)
    rise[RAISED] = true_rise_px
    columns, rows = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
    left = waves.texture(columns - expected - rise, rows, contrast=contrast)
    right = waves.texture(columns, rows, contrast=contrast)
    pair = waves.as_image(left, NOISE, 1), waves.as_image(right, NOISE, 2)
    disparity = expected.copy()
    disparity[RAISED] += matched_rise_px
    noise_px = np.full_like(expected, 0.1)
    terrain = survey(disparity, noise_px, expected, CAMERA, GROUND, DetectorConfig())
    stereo = Stereo(
        pair, GROUND, expected, disparity, noise_px, RowAlignment(), NOISE * 2**0.5, 8.0
    )
    found = parallax_evidence(stereo, terrain, CAMERA, window)
    assert found.dtype == np.float32
    assert np.isfinite(found).all()
    return found


def test_what_stands_up_fits_better_where_it_was_matched():
    found = evidence_of(true_rise_px=4.0, matched_rise_px=4.0)
    assert found[RAISED][4:-4, 4:-4].mean() > 5


def test_ground_that_was_matched_too_high_fits_better_on_the_ground():
    found = evidence_of(true_rise_px=0.0, matched_rise_px=4.0)
    assert found[RAISED][4:-4, 4:-4].mean() < -5


def test_level_ground_tells_nothing():
    found = evidence_of()
    assert abs(found[INNER]).max() < 1


def test_without_texture_nothing_is_told():
    found = evidence_of(true_rise_px=4.0, matched_rise_px=4.0, contrast=0.0)
    assert abs(found[RAISED].mean()) < 0.3


def test_window_is_a_part_of_the_whole():
    window = np.s_[80:160, 70:200]
    whole = evidence_of(4.0, 4.0)
    part = evidence_of(4.0, 4.0, window)
    assert part.shape == (80, 130)
    inner = np.s_[24:-24, 24:-24]
    np.testing.assert_allclose(part[inner], whole[window][inner], rtol=0.05, atol=0.2)


@pytest.mark.parametrize('rows', [slice(0, 20), slice(0, 0)])
def test_above_the_horizon_there_is_no_ground_to_compare_with(rows):
    assert not evidence_of(window=(rows, slice(None)))[:5].any()
