from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hand_made import small_detection

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.result.cue import Cue

CAMERA = StereoCamera(64, 48, 60.0, 60.0, 31.5, 23.5, 0.1)
UP = Gravity.from_angles(30.0).up
GROUND = GroundPlane(UP, 1.0, UP)
ROCK = np.s_[30:40, 20:30]


def scene(cue=Cue.HEIGHT, depth_m=1.5, **changes):
    """Flat ground seen from 1 m, and a rock."""
    expected = DisparityPlane.from_ground(GROUND, CAMERA).disparity(CAMERA)
    disparity = np.maximum(expected, 0).astype(np.float32)
    height = np.where(disparity > 0, 0, np.nan).astype(np.float32)
    cues, mask = np.zeros(CAMERA.shape, np.uint8), np.zeros(CAMERA.shape, np.uint8)
    disparity[ROCK] = CAMERA.disparity_at(depth_m)
    height[ROCK] = 0.2
    cues[ROCK], mask[ROCK] = cue, 255
    fields = {
        'ground': GROUND,
        'grey': np.full(CAMERA.shape, 100, np.uint8),
        'disparity': disparity,
        'height': height,
        'height_noise': np.full(CAMERA.shape, 0.01, np.float32),
        'cues': cues,
        'known': disparity > 0,
        'mask': mask,
    }
    return fields | changes


def without_3d(fields, where):
    fields['disparity'][where], fields['height'][where] = 0, np.nan
    return small_detection(CAMERA, **fields)


def rows_of(where):
    """Rows of the cloud that belong to some pixels, if all of the rock's pixels have one."""
    chosen = np.zeros(CAMERA.shape, bool)
    chosen[where] = True
    return chosen[ROCK].ravel()


def test_pixels_without_3d_have_the_range_of_the_nearest_pixel_of_their_obstacle():
    hole = np.s_[33:36, 24:27]
    whole, found = small_detection(CAMERA, **scene()), without_3d(scene(), hole)
    assert len(found.obstacle_points) == len(whole.obstacle_points) == 100
    carried, measured = found.obstacle_points[rows_of(hole)], whole.obstacle_points[rows_of(hole)]
    np.testing.assert_allclose(carried[:, :3], measured[:, :3], atol=0.01)
    np.testing.assert_allclose(carried[:, :2] / carried[:, 2:3], measured[:, :2] / 1.5, atol=1e-5)
    others = ~rows_of(hole)
    np.testing.assert_array_equal(
        found.obstacle_points[others, :4], whole.obstacle_points[others, :4]
    )
    assert np.isnan(found.points[hole]).all(), 'positions of pixels stay what was measured'
    # Up to 2 pixels from their source at 1.5 m: 0.05 m.
    assert (np.abs(carried[:, 3] - 0.2) < 0.06).all()
    assert np.ptp(carried[:, 3]) > 0.02, 'higher pixels are higher'


def test_pixels_do_not_carry_the_range_of_what_is_low_on_a_rock():
    fields = scene()
    low = np.s_[30:40, 25:30]
    fields['disparity'][low], fields['height'][low] = CAMERA.disparity_at(1.55), 0.0
    hole = np.s_[33:36, 23:25]
    fields['disparity'][hole], fields['height'][hole] = 0, np.nan
    carried = small_detection(CAMERA, **fields).obstacle_points[rows_of(hole)]
    np.testing.assert_allclose(carried[:, 2], 1.5, atol=0.01)
    # A slope is a slope at any height.
    fields['cues'] = np.where(fields['mask'] > 0, np.uint8(Cue.SLOPE), np.uint8(0))
    carried = small_detection(CAMERA, **fields).obstacle_points[rows_of(hole)]
    assert carried[:, 2].max() == pytest.approx(1.55, abs=0.01), 'beside the low part'


def test_pixels_carry_the_range_of_their_own_obstacle_only():
    fields = scene(depth_m=1.5)
    other = np.s_[30:40, 31:36]
    fields['disparity'][other] = CAMERA.disparity_at(0.8)
    fields['height'][other] = 0.3
    fields['cues'][other], fields['mask'][other] = Cue.HEIGHT, 255
    edge = np.s_[30:40, 29]
    found = without_3d(fields, edge)
    numbers = found.obstacle_numbers
    assert numbers[35, 29] != numbers[35, 31]
    points = found.obstacle_points[:, :3]
    carried = points[np.argsort(np.abs(points[:, 0] / points[:, 2] * 60 + 31.5 - 29))[:10]]
    np.testing.assert_allclose(carried[:, 2], 1.5, atol=0.01)


@pytest.mark.parametrize('cue', [Cue.GREY_LEVEL, Cue.HEIGHT])
def test_an_obstacle_without_3d_stands_upright_where_its_foot_meets_the_ground(cue):
    found = without_3d(scene(cue), ROCK)
    points = found.obstacle_points
    assert len(points) == 100
    assert np.isfinite(points).all()
    up = np.asarray(UP)
    # The lowest row of the rock is row 39, column 25 in its middle.
    ray = np.array(((25 - 31.5) / 60, (39 - 23.5) / 60, 1.0))
    foot = ray * (-1.0 / (ray @ up))
    (lowest,) = points[rows_of(np.s_[39, 25])]
    np.testing.assert_allclose(lowest[:3], foot, atol=1e-4)
    assert lowest[3] == pytest.approx(0, abs=1e-4)
    ahead = foot - (foot @ up) * up
    along = points[:, :3] @ ahead / np.linalg.norm(ahead)
    np.testing.assert_allclose(along, np.linalg.norm(ahead), rtol=1e-4)
    top = points[rows_of(np.s_[30, 25]), 3]
    assert 0.15 < top[0] < 0.4
    np.testing.assert_allclose(points[:, 3], points[:, :3] @ up + 1.0, atol=1e-4)
    assert np.isnan(found.obstacles[0].range_m), 'measures are of what was measured'


def test_the_foot_stands_on_the_local_ground():
    fields = scene(Cue.GREY_LEVEL)
    # All ground is measured 0.1 m above the plane; heights are above that local ground.
    fields['disparity'] = (fields['disparity'] / 0.9).astype(np.float32)
    found = without_3d(fields, ROCK)
    (lowest,) = found.obstacle_points[rows_of(np.s_[39, 25])]
    assert lowest[:3] @ np.asarray(UP) == pytest.approx(-0.9, abs=1e-3)
    assert lowest[3] == pytest.approx(0, abs=1e-3)


@pytest.mark.parametrize(
    'changes',
    [
        {'ground': GroundPlane(UP, 1.0, UP, measured=False)},
        {'parameters': DetectorParameters.from_config(DetectorConfig(max_range=1.0))},
        {'parameters': DetectorParameters.from_config(DetectorConfig(min_range=2.0))},
    ],
    ids=['no ground', 'too far', 'too near'],
)
def test_an_obstacle_without_3d_and_without_a_place_has_no_points(changes):
    found = without_3d(scene(Cue.GREY_LEVEL, **changes), ROCK)
    assert found.obstacle_points.shape == (0, 5)
    assert len(found.obstacles) == 1


@pytest.mark.parametrize('horizon_px', [23.5, 3.0], ids=['above', 'at the horizon'])
def test_an_obstacle_before_the_sky_has_no_foot(horizon_px):
    fields = scene()
    sky = np.s_[0:4, 20:30]
    fields['mask'][sky], fields['cues'][sky], fields['known'][sky] = 255, Cue.GREY_LEVEL, True
    fields['disparity'][sky], fields['height'][sky] = 0, np.nan
    level = GroundPlane((0.0, -1.0, 0.0), 1.0, (0.0, -1.0, 0.0))
    camera = replace(CAMERA, cy=horizon_px)
    found = small_detection(camera, **{**fields, 'ground': level})
    assert len(found.obstacles) == 2
    assert len(found.obstacle_points) == 100


def test_unknown_pixels_get_no_position():
    hole = np.s_[33:36, 24:27]
    fields = scene()
    fields['known'][hole] = False
    assert len(without_3d(fields, hole).obstacle_points) == 91


def test_a_pixel_below_its_source_is_lower():
    below = np.s_[36:40, 20:30]
    found = without_3d(scene(), below)
    placed = found.obstacle_points.reshape(10, 10, 5)
    source, carried = placed[5], placed[6:]
    rise_m = (carried[..., :3] - source[:, :3]) @ np.asarray(UP)
    np.testing.assert_allclose(carried[..., 3], 0.2 + rise_m, atol=1e-5)
    assert (np.diff(placed[5:, :, 3], axis=0) < -0.01).all()


def test_points_of_obstacles_beside_each_other_are_row_by_row():
    fields = scene(depth_m=1.5)
    near = np.s_[30:40, 34:44]
    fields['disparity'][near], fields['height'][near] = CAMERA.disparity_at(0.8), 0.2
    fields['cues'][near], fields['mask'][near] = Cue.HEIGHT, 255
    found = without_3d(fields, np.s_[33:36])
    x, _, z = found.obstacle_points[:, :3].reshape(10, 20, 3).transpose(2, 0, 1)
    columns = np.r_[20:30, 34:44]
    np.testing.assert_allclose(60 * x / z + 31.5, np.tile(columns, (10, 1)), atol=1e-3)
    np.testing.assert_allclose(z, np.tile(np.where(columns < 30, 1.5, 0.8), (10, 1)), atol=0.1)


LEFT, BELOW, RIGHT = np.s_[2:46, 3:20], np.s_[30:46, 3:61], np.s_[2:46, 40:61]
NOTHING, BETWEEN = np.s_[:0], np.s_[10:30, 3:61]


@pytest.mark.parametrize(
    ('hole', 'unknown', 'source'),
    [
        (LEFT, NOTHING, np.s_[2:46, 20:21]),
        (RIGHT, NOTHING, np.s_[2:46, 39:40]),
        (BELOW, NOTHING, np.s_[29:30, 3:61]),
        (BELOW, BETWEEN, np.s_[9:10, 3:61]),
    ],
    ids=['left', 'right', 'below', 'far'],
)
def test_pixels_of_a_large_obstacle_have_the_range_of_its_nearest_measured_pixel(
    hole, unknown, source
):
    large = np.s_[2:46, 3:61]
    fields = scene()
    rows, columns = np.indices(CAMERA.shape)
    fields['disparity'] = (3 + 0.05 * rows + 0.02 * columns).astype(np.float32)
    fields['mask'][large], fields['cues'][large] = 255, Cue.SLOPE
    fields['height'][:], fields['known'][large] = 0, True
    fields['known'][unknown] = False
    found = without_3d(fields, hole)
    ranges_m = np.full(CAMERA.shape, np.nan)
    placed = found.known & (found.mask > 0)
    ranges_m[placed] = np.linalg.norm(found.obstacle_points[:, :3], axis=1)
    expected_m = np.linalg.norm(found.points[source], axis=-1)
    np.testing.assert_allclose(
        ranges_m[hole], np.broadcast_to(expected_m, ranges_m[hole].shape), rtol=1e-5
    )


def test_the_foot_is_the_lowest_pixel_on_the_ground_beside_it():
    fields = scene(Cue.GREY_LEVEL)
    foot, beside = np.s_[40:41, 27:28], np.s_[38:44, 24:34]
    fields['mask'][foot], fields['cues'][foot] = 255, Cue.GREY_LEVEL
    # The ground beside it is higher than elsewhere, and has a bump of 0.05 m there.
    fields['disparity'][beside] /= 0.75
    fields['height'][beside] = 0.05
    rock = fields['mask'] > 0
    lowest = without_3d(fields, rock).obstacle_points[-1]
    np.testing.assert_allclose(lowest[:2] / lowest[2], [-4.5 / 60, 16.5 / 60], atol=1e-5)
    assert lowest[:3] @ np.asarray(UP) == pytest.approx(-0.8, abs=1e-3)
    assert lowest[3] == pytest.approx(0, abs=1e-3)
