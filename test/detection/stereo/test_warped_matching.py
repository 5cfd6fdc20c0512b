from __future__ import annotations

import numpy as np
import pytest
import synthetic
import waves

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.rectification.lens_distortion import (
    STRAIGHT_LENSES,
    LensDistortion,
    Lenses,
)
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT, RowAlignment
from rover_obstacle_detection.detection.stereo.semi_global import Penalties
from rover_obstacle_detection.detection.stereo.warped_matching import (
    CoarseDisparity,
    coarse_disparity,
    residual_range,
    warped_disparity,
)

OWN = Penalties(300, 1200)
CONFIG = DetectorConfig()
ROCK = (synthetic.Box(0.0, 1.2, 0.3, 0.3, 0.3),)


def true_ground(scene):
    up = scene.gravity.up
    return GroundPlane(up, scene.height_m, up)


def expected_disparity(scene):
    plane = DisparityPlane.from_ground(true_ground(scene), scene.camera)
    return np.maximum(plane.disparity(scene.camera), 0)


def errors(found, view):
    valid = (found > 0) & (view.disparity > 0)
    return np.abs(found - view.disparity)[valid], valid


def small_rig(offset=0.0, **changes):
    return synthetic.mast(camera=synthetic.pinhole(200, 150, 60.0, 0.06, offset=offset), **changes)


@pytest.mark.parametrize('offset', [0.0, 7.5, -5.0])
@pytest.mark.parametrize('solids', [(), ROCK])
def test_disparity_is_the_true_one(offset, solids):
    scene = small_rig(offset, solids=solids)
    view = synthetic.render(scene)
    found = warped_disparity(
        view.left, view.right, scene.camera, expected_disparity(scene), (-8, 16), CONFIG, OWN
    )
    assert found.dtype == np.float32
    error, valid = errors(found, view)
    assert valid.mean() > 0.85
    assert np.median(error) < 0.1
    assert np.quantile(error, 0.95) < 0.35


def test_wrong_expectation_is_made_good_by_the_search():
    scene = small_rig()
    view = synthetic.render(scene)
    wrong = expected_disparity(scene) + np.float32(3.0)
    found = warped_disparity(view.left, view.right, scene.camera, wrong, (-8, 16), CONFIG, OWN)
    error, valid = errors(found, view)
    assert valid.mean() > 0.85
    assert np.median(error) < 0.15


def test_nothing_is_matched_outside_the_right_image():
    scene = small_rig()
    view = synthetic.render(scene)
    found = warped_disparity(
        view.left, view.right, scene.camera, expected_disparity(scene), (-8, 16), CONFIG, OWN
    )
    in_right = np.arange(scene.camera.width)[np.newaxis] - view.disparity
    assert not found[in_right < -1].any()
    assert (found[(in_right > 8) & (in_right < 190)] > 0).mean() > 0.95


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
    view = synthetic.render(scene)
    expected = expected_disparity(scene)
    assert np.abs(np.diff(expected, axis=1)).max() == pytest.approx(0.119, abs=0.001)
    assert np.median((view.disparity - expected)[view.obstacle]) > 15
    found = warped_disparity(view.left, view.right, scene.camera, expected, (-8, 64), CONFIG, OWN)
    error, valid = errors(found, view)
    on_rock = view.obstacle[valid]
    assert np.count_nonzero(on_rock) > 0.9 * np.count_nonzero(view.obstacle)
    assert np.median(error[on_rock]) < 0.3
    assert np.median(error[~on_rock]) < 0.1


@pytest.mark.parametrize('residual', [-3.0, 0.0, 4.0])
def test_rows_that_are_off_are_read_where_they_are(residual):
    camera = synthetic.pinhole(200, 150, 60.0, 0.06)
    truth = DisparityPlane(0.02, 0.05, 12.0)
    alignment = RowAlignment(2.0, 0.02)
    pair = waves.stereo_pair(camera, truth, alignment)
    expected = truth.disparity(camera) - np.float32(residual)

    def median_error(*given):
        found = warped_disparity(*pair, camera, expected, (-8, 16), CONFIG, OWN, *given)
        inner = np.s_[8:-8, 32:-8]
        assert (found[inner] > 0).mean() > 0.9
        return np.median(np.abs(found - truth.disparity(camera))[inner])

    assert median_error(alignment) < 0.08
    assert median_error() > 0.15


@pytest.mark.parametrize(
    ('width', 'height', 'coarse'),
    [(1024, 768, (192, 256)), (640, 480, (120, 160)), (320, 240, (120, 160)), (64, 48, (48, 64))],
)
def test_small_images_are_reduced_less(width, height, coarse):
    camera = synthetic.pinhole(width, height, 60.0, 0.06)
    black = np.zeros((height, width), np.uint8)
    found = coarse_disparity(black, black, camera, CONFIG, OWN, 4)
    assert found.disparity.shape == coarse == found.camera.shape
    assert found.reduction == pytest.approx(width / coarse[1])


@pytest.mark.parametrize('offset', [0.0, 7.5])
def test_coarse_disparity_is_in_pixels_of_its_camera(offset):
    scene = synthetic.mast(camera=synthetic.pinhole(320, 240, 60.0, 0.06, offset=offset))
    view = synthetic.render(scene)
    found = coarse_disparity(view.left, view.right, scene.camera, CONFIG, OWN, 2)
    truth = view.disparity.reshape(120, 2, 160, 2).mean(axis=(1, 3)) / 2
    valid = found.disparity > 0
    assert valid.mean() > 0.7
    assert np.abs(found.disparity - truth)[valid].mean() < 0.2


@pytest.mark.parametrize(('offset', 'turn'), [(1.0, 0.0), (-1.0, 0.004)])
def test_rows_that_are_off_are_told_in_pixels_of_the_full_image(offset, turn):
    camera = synthetic.pinhole(640, 480, 60.0, 0.06)
    truth = DisparityPlane(0.0, 0.06, 24.0)
    pair = waves.stereo_pair(camera, truth, RowAlignment(offset, turn), shortest_px=16)
    found = coarse_disparity(*pair, camera, CONFIG, OWN, 4)
    assert found.reduction == 4
    assert found.alignment.offset_px == pytest.approx(offset, abs=0.12)
    assert found.alignment.turn == pytest.approx(turn, abs=5e-4)


LENSES = [
    Lenses(LensDistortion(0.01, -0.015)),
    Lenses(right=LensDistortion(0.01, -0.015)),
    Lenses(LensDistortion(0.01, -0.015), LensDistortion(-0.01)),
]


@pytest.mark.parametrize('lenses', LENSES, ids=str)
@pytest.mark.parametrize('straighten', [True, False])
def test_lenses_that_still_bend_are_straightened(lenses, straighten):
    camera = synthetic.pinhole(640, 480, 80.0, 0.06)
    truth = DisparityPlane(0.0, 0.06, 24.0)
    true = truth.disparity(camera).reshape(120, 4, 160, 4).mean(axis=(1, 3)) / 4

    def matched(lenses):
        pair = waves.stereo_pair(
            camera, truth, RowAlignment(0.5), lenses=lenses, shortest_px=16, noise=2.0
        )
        found = coarse_disparity(*pair, camera, CONFIG, OWN, 4, lenses=straighten)
        assert found.alignment.offset_px == pytest.approx(0.5, abs=0.12)
        assert (found.disparity > 0).mean() > 0.8
        error = np.abs(found.disparity - true)[found.disparity > 0]
        return found, np.quantile(error, 0.9)

    found, error = matched(lenses)
    assert bool(found.lenses) == straighten
    assert (error < 1.1 * matched(STRAIGHT_LENSES)[1]) == straighten


@pytest.mark.parametrize('alignment', [STRAIGHT, RowAlignment(1.0, 0.004)])
def test_straight_lenses_stay_straight(alignment):
    camera = synthetic.pinhole(640, 480, 80.0, 0.06)
    truth = DisparityPlane(0.0, 0.06, 24.0)
    pair = waves.stereo_pair(camera, truth, alignment, shortest_px=16, noise=2.0)
    assert not coarse_disparity(*pair, camera, CONFIG, OWN, 4).lenses


def test_smallest_disparity_is_in_pixels_of_the_full_image():
    camera = synthetic.pinhole(640, 480, 60.0, 0.06)
    truth = DisparityPlane(0.0, 0.05, 26.0)
    pair = waves.stereo_pair(camera, truth, shortest_px=16)
    found = coarse_disparity(*pair, camera, DetectorConfig(min_disparity=12), OWN, 4)
    true = truth.disparity(camera)
    assert true.min() > 13
    assert (found.disparity > 0).mean() > 0.9
    assert found.disparity[found.disparity > 0].min() > 3


def coarse_of(residuals):
    """Flat ground expected at 5 px, found at 5 px and the residuals."""
    camera = synthetic.pinhole(40, 30, 60.0, 0.06)
    disparity = np.full(camera.shape, 5.0, np.float32)
    disparity.ravel()[: len(residuals)] += np.asarray(residuals, np.float32)
    return CoarseDisparity(disparity, camera, 4.0, STRAIGHT), DisparityPlane(0.0, 0.0, 5.0)


def test_search_covers_what_the_coarse_disparity_shows():
    lowest, count = residual_range(*coarse_of([3.0] * 100 + [-2.0] * 100))
    assert lowest <= -2 * 4 - 1
    assert lowest + count > 3 * 4 + 1
    assert count % 16 == 0


@pytest.mark.parametrize('slope', [0.2, -0.2])
def test_search_covers_the_residual_that_a_plane_which_tilts_makes(slope):
    # The plane's disparity is subtracted where the match is, not where the pixel is.
    coarse, plane = coarse_of([12.0] * 100)
    tilted = DisparityPlane(slope, 0.0, plane.level)
    coarse.disparity[:] += tilted.disparity(coarse.camera) - np.float32(plane.level)
    coarse.disparity[tilted.disparity(coarse.camera) <= 0] = 0
    lowest, count = residual_range(coarse, tilted)
    assert lowest + count > 12 * 4 / (1 - slope)


def test_search_on_flat_ground_is_narrow():
    lowest, count = residual_range(*coarse_of([]))
    assert lowest < 0 < lowest + count
    assert count == 16


def test_search_without_any_match_is_around_the_plane():
    coarse, plane = coarse_of([])
    coarse.disparity[:] = 0
    lowest, count = residual_range(coarse, plane)
    assert lowest < 0 < lowest + count
    assert count % 16 == 0
