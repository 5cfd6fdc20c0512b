from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
import synthetic
import waves

from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT, RowAlignment
from rover_obstacle_detection.detection.stereo.parameters import StereoParameters
from rover_obstacle_detection.detection.stereo.semi_global import Penalties
from rover_obstacle_detection.detection.stereo.warped_matching import (
    residual_range,
    warped_disparity,
)

PENALTIES = Penalties(300, 1200)
PARAMETERS = StereoParameters()
ROCK = (synthetic.Box(0.0, 1.2, 0.3, 0.3, 0.3),)


def small_rig(offset=0.0, **changes):
    return synthetic.mast(camera=synthetic.pinhole(200, 150, 60.0, 0.06, offset=offset), **changes)


def expected_disparity(scene):
    up = scene.gravity.up
    plane = DisparityPlane.from_ground(GroundPlane(up, scene.height_m, up), scene.camera)
    return np.maximum(plane.disparity(scene.camera), 0)


def matched(pair, camera, expected, search=(-8, 16), rows=STRAIGHT):
    return warped_disparity(pair, camera, expected, search, PENALTIES, PARAMETERS, rows)


def matched_view(scene, expected=None, search=(-8, 16)):
    """Disparity, its error where it is known, and where that is."""
    view = synthetic.render(scene)
    expected = expected_disparity(scene) if expected is None else expected
    found = matched((view.left, view.right), scene.camera, expected, search)
    assert found.dtype == np.float32
    valid = (found > 0) & (view.disparity > 0)
    return found, np.abs(found - view.disparity)[valid], valid


@pytest.mark.parametrize('offset', [0.0, 7.5, -5.0])
@pytest.mark.parametrize('solids', [(), ROCK], ids=['ground', 'rock'])
def test_disparity_is_true(offset, solids):
    _, error, valid = matched_view(small_rig(offset, solids=solids))
    assert valid.mean() > 0.85
    assert np.median(error) < 0.1
    assert np.quantile(error, 0.95) < 0.35


def test_disparity_of_less_than_a_pixel_is_a_match():
    rng = np.random.default_rng(2)
    texture = cv2.GaussianBlur(rng.uniform(0, 255, (150, 240)).astype(np.float32), (0, 0), 1.5)
    texture = cv2.normalize(texture, None, 20, 235, cv2.NORM_MINMAX)
    rows, columns = np.mgrid[:150, :200].astype(np.float32)
    pair = [
        np.rint(cv2.remap(texture, columns + 20 + shift, rows, cv2.INTER_CUBIC)).astype(np.uint8)
        for shift in np.float32([0, 0.6])
    ]
    found = matched(pair, small_rig().camera, np.zeros((150, 200), np.float32))[:, 20:-20]
    assert (found > 0).mean() > 0.9
    # Plain matching is drawn towards whole pixels.
    assert 0.3 < np.median(found) < 1


def test_search_corrects_a_wrong_expectation():
    scene = small_rig()
    wrong = expected_disparity(scene) + np.float32(3.0)
    _, error, valid = matched_view(scene, wrong)
    assert valid.mean() > 0.85
    assert np.median(error) < 0.15


@pytest.mark.parametrize('offset', [0.0, 7.5, -4.0])
def test_no_match_lies_outside_the_right_image(offset):
    scene = small_rig(offset)
    found, _, _ = matched_view(scene)
    right_column = np.arange(scene.camera.width) - synthetic.render(scene).disparity - offset
    outside = right_column < -1
    assert outside.sum() > 200
    assert not found[outside].any()
    assert (found[(right_column > 8) & (right_column < 190)] > 0).mean() > 0.95


@pytest.mark.parametrize('roll', [20.0, -20.0])
def test_rock_on_a_plane_that_tilts_sideways(roll):
    # Between a pixel and its match the plane's disparity changes by up to 2.7 px.
    scene = synthetic.Scene(
        synthetic.pinhole(320, 240, 60.0, 0.3),
        46.0,
        0.6,
        roll_deg=roll,
        solids=(synthetic.Box(0.0, 0.65, 0.3, 0.3, 0.15),),
    )
    view, expected = synthetic.render(scene), expected_disparity(scene)
    assert np.abs(np.diff(expected, axis=1)).max() == pytest.approx(0.119, abs=0.001)
    assert np.median((view.disparity - expected)[view.obstacle]) > 15
    _, error, valid = matched_view(scene, search=(-8, 64))
    on_rock = view.obstacle[valid]
    assert np.count_nonzero(on_rock) > 0.9 * np.count_nonzero(view.obstacle)
    assert np.median(error[on_rock]) < 0.3
    assert np.median(error[~on_rock]) < 0.1


@pytest.mark.parametrize('residual', [-3.0, 0.0, 4.0])
def test_row_shift_is_followed(residual):
    camera = synthetic.pinhole(200, 150, 60.0, 0.06)
    plane, rows = DisparityPlane(0.02, 0.05, 12.0), RowAlignment(2.0, 0.02)
    pair, truth = waves.stereo_pair(camera, plane, rows), plane.disparity(camera)

    def median_error(rows):
        found = matched(pair, camera, truth - np.float32(residual), rows=rows)
        inner = np.s_[8:-8, 32:-8]
        assert (found[inner] > 0).mean() > 0.9
        return np.median(np.abs(found - truth)[inner])

    assert median_error(rows) < 0.08
    assert median_error(STRAIGHT) > 0.15


@pytest.mark.parametrize('offset', [0.0, -5.0])
def test_matches_reach_to_the_edges_of_the_right_image(offset):
    camera = small_rig(offset).camera
    plane = DisparityPlane(0.0, 0.0, 1.0)
    found = matched(waves.stereo_pair(camera, plane), camera, plane.disparity(camera))
    right_column = np.arange(camera.width) - 1 - offset
    inside = (right_column >= 5) & (right_column <= 197) & (np.arange(200) < 197)
    assert (found[8:-8, inside] > 0).mean() > 0.99
    assert not found[:, (right_column < 0) | (right_column > 199)].any()


COARSE_CAMERA = synthetic.pinhole(40, 30, 60.0, 0.06)
REDUCTION = 4.0
MARGIN_PX = PARAMETERS.search_margin_px


def search_for(residuals, slope=0.0, matched=True):
    """First and last full-size residual searched where these are seen coarsely on the ground."""
    plane = DisparityPlane(slope, 0.0, 5.0)
    coarse = plane.disparity(COARSE_CAMERA)
    unseen = coarse <= 0
    coarse.ravel()[: len(residuals)] += np.asarray(residuals, np.float32)
    coarse[unseen] = 0
    lowest, count = residual_range(coarse * matched, COARSE_CAMERA, REDUCTION, plane, PARAMETERS)
    assert count % 16 == 0
    return lowest, lowest + count - 1


def test_search_covers_the_residuals_seen_coarsely_with_a_margin():
    lowest, highest = search_for([3.0] * 100 + [-2.0] * 100)
    assert lowest == -2 * REDUCTION - MARGIN_PX
    assert 3 * REDUCTION + MARGIN_PX - 1 <= highest < 3 * REDUCTION + MARGIN_PX + 16


@pytest.mark.parametrize('slope', [0.2, -0.2])
def test_search_covers_the_larger_residuals_of_a_tilted_plane(slope):
    # The plane's disparity is subtracted where the match is, not where the pixel is.
    highest = search_for([15.0] * 100, slope)[1]
    assert highest >= 15 * REDUCTION / min(1 - slope, 1) + MARGIN_PX - 1


def test_search_covers_the_ground_plane_itself():
    pixels = COARSE_CAMERA.width * COARSE_CAMERA.height
    assert search_for([2.0] * pixels)[0] == -MARGIN_PX
    assert search_for([-1.5] * pixels) == (-1.5 * REDUCTION - MARGIN_PX, MARGIN_PX - 1)


def test_search_covers_what_is_far():
    # A disparity of half a pixel, below the ground plane.
    assert search_for([-4.5] * 100)[0] == -4.5 * REDUCTION - MARGIN_PX
    plane = DisparityPlane(0.0, 0.0, 0.5)
    coarse = plane.disparity(COARSE_CAMERA) + np.float32(6.0)
    lowest, count = residual_range(coarse, COARSE_CAMERA, REDUCTION, plane, PARAMETERS)
    assert lowest + count - 1 >= 6 * REDUCTION + MARGIN_PX - 1


def test_few_outliers_do_not_widen_the_search():
    assert search_for([500.0, -4.9]) == search_for([])


def test_search_is_no_wider_than_the_image():
    half = COARSE_CAMERA.width * REDUCTION / 2
    _, highest = search_for([500.0] * 100)
    assert half < highest < half + MARGIN_PX + 16


def test_search_on_flat_ground_and_without_a_match_is_narrow():
    for lowest, highest in (search_for([]), search_for([], matched=False)):
        assert lowest < -4
        assert highest > 4
        assert highest - lowest == 15


def test_matches_above_the_horizon_do_not_count():
    plane = DisparityPlane(0.0, 0.5, 0.0)
    coarse = np.maximum(plane.disparity(COARSE_CAMERA), 0)
    coarse[coarse == 0] = 9
    lowest, count = residual_range(coarse, COARSE_CAMERA, REDUCTION, plane, PARAMETERS)
    assert (lowest, count) == (math.floor(-MARGIN_PX), 16)
