"""A camera that is mounted upside down: results in its own images and frame."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import synthetic
from hand_made import small_detection

from rover_obstacle_detection import Detector, DetectorConfig, Gravity, StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.rectification.correction import Correction, Remapping
from rover_obstacle_detection.detection.rectification.row_alignment import RowAlignment
from rover_obstacle_detection.detection.result.detection import OBSTACLE
from rover_obstacle_detection.detection.result.grid import (
    mirrored_grid,
    obstacle_grid,
    unknown_grid,
)
from rover_obstacle_detection.detection.result.upside_down import in_recorded_images
from rover_obstacle_detection.errors import UnjudgeablePairError

SCENE = synthetic.mast(
    solids=(synthetic.Box(0.15, 1.1, 0.25, 0.25, 0.2), synthetic.Box(-0.3, 1.5, 0.2, 0.2, 0.15)),
    camera=synthetic.pinhole(320, 240, 60.0, 0.06, offset=4.0, shift=(3.0, 8.0)),
)
UPRIGHT = synthetic.render(SCENE)
# Rendered by a camera that is really turned, not by turning pictures.
TURNED = synthetic.render(SCENE.with_(roll_deg=180.0))
TURNED_DOWN = DetectorConfig(upside_down=True)

SMALL = StereoCamera(4, 3, 10.0, 12.0, 1.0, 0.5, 0.1, cx_right=0.5)


def test_ground_plane_is_mirrored():
    plane = GroundPlane((0.1, -0.9, -0.4), 1.5, (0.0, -1.0, 0.0), measured=False, residual=0.2)
    assert plane.mirrored() == GroundPlane(
        (0.1, 0.9, -0.4), 1.5, (0.0, 1.0, 0.0), measured=False, residual=0.2
    )
    assert plane.mirrored().slope_deg == plane.slope_deg


def test_row_alignment_maps_the_same_pixels():
    rows = RowAlignment(0.4, 0.01)
    columns = np.arange(4, dtype=np.float32)
    in_right = rows.rows(SMALL, columns)
    mirrored = Correction(rows).mirrored().rows.rows(SMALL.mirrored(), columns)
    np.testing.assert_allclose(mirrored, 2 - in_right[::-1], atol=1e-6)


def test_remapping_maps_the_same_pixels():
    pixels = np.array([[0, 1, 6, 7], [4, 9, 10, 7], [8, 9, 2, 3]], np.int32)
    shown = np.array([[1, 1, 1, 1], [1, 0, 1, 1], [0, 1, 1, 1]], bool)
    array = np.arange(12).reshape(3, 4)
    remapping = Remapping(pixels, shown)
    mirrored = remapping.mirrored()(array[::-1], -1)
    np.testing.assert_array_equal(mirrored, remapping(array, -1)[::-1])


def test_grid_of_mirrored_points_is_the_mirrored_grid():
    random = np.random.default_rng(0)
    obstacles, free = random.uniform((-2, -1, 0.1), (1, 1, 3), (2, 40, 3)).astype(np.float32)
    up = Gravity.from_angles(40.0, 10.0).up
    ground = GroundPlane(up, 1.0, up)
    mirror = np.array([1, -1, 1], np.float32)
    expected = obstacle_grid(obstacles * mirror, free * mirror, ground.mirrored(), 0.25, 3.0)

    mirrored = mirrored_grid(obstacle_grid(obstacles, free, ground, 0.25, 3.0))

    np.testing.assert_array_equal(mirrored.cells, expected.cells)
    np.testing.assert_allclose(mirrored.origin_m, expected.origin_m, atol=1e-12)
    np.testing.assert_allclose(mirrored.axes, expected.axes, atol=1e-12)


def test_unknown_grid_of_an_upside_down_camera_has_its_top_below():
    grid = unknown_grid(0.5, 2.0, upside_down=True)
    # Forward, to the left of the rover, and up, in the frame of the camera.
    assert grid.axes.tolist() == [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    assert grid.origin_m.tolist() == [-1, 0, 0]


def reversed_rows(array):
    return np.ascontiguousarray(array[::-1])


@pytest.fixture(scope='module', params=['hybrid', 'study', 'enlarged'])
def both(request):
    """The same view upright, and with its rows reversed and the parameter set."""
    changes = {'working_scale': 0.5} if request.param == 'enlarged' else {}
    method = 'study' if request.param == 'study' else 'hybrid'
    config = DetectorConfig(method=method, **changes)
    upright = Detector(SCENE.camera, config).detect(UPRIGHT.left, UPRIGHT.right)
    detector = Detector(SCENE.camera.mirrored(), dataclasses.replace(config, upside_down=True))
    images = (reversed_rows(each) for each in (UPRIGHT.left, UPRIGHT.right))
    return upright, detector.detect(*images)


PER_PIXEL = (
    'grey', 'disparity', 'height', 'height_noise', 'rock_probability', 'cues', 'known', 'mask',
    'regions', 'seeds', 'roughness', 'step', 'obstacle_numbers', 'confidence', 'kinds',
)  # fmt: skip


def test_pixels_are_those_of_the_upright_view_in_reverse_rows(both):
    upright, own = both
    assert np.count_nonzero(own.mask) > 500
    for name in PER_PIXEL:
        expected = reversed_rows(getattr(upright, name))
        np.testing.assert_allclose(getattr(own, name), expected, atol=1e-6, err_msg=name)
        assert not getattr(own, name).flags.writeable
    np.testing.assert_array_equal(own.mask, upright.mask[::-1])
    for mine, theirs in zip(own.rims, upright.rims, strict=True):
        np.testing.assert_array_equal(mine, theirs[::-1])


def test_positions_are_in_the_frame_of_the_camera(both):
    upright, own = both
    mirror = np.array([1, -1, 1], np.float32)
    np.testing.assert_array_equal(own.points, upright.points[::-1] * mirror)
    # As the camera sees them, and not only as the mirrored detection says.
    y_over_z = own.camera.rays()[1]
    seen = np.isfinite(own.points[..., 2]) & np.isfinite(own.height)
    place = np.broadcast_to(y_over_z, seen.shape)[seen] * own.points[seen][:, 2]
    bent_m = 0.01 * own.points[seen][:, 2]
    assert (abs(own.points[seen][:, 1] - place) < bent_m).mean() > 0.99
    for name in ('obstacle_points', 'ground_points'):
        mine, theirs = getattr(own, name), getattr(upright, name)
        assert len(mine) == len(theirs) > 100
        np.testing.assert_array_equal(mine[:, 1], -theirs[::-1, 1])
        np.testing.assert_array_equal(mine[:, [0, 2, 3]], theirs[::-1][:, [0, 2, 3]])
    np.testing.assert_array_equal(own.obstacle_point_kinds, upright.obstacle_point_kinds[::-1])
    assert len(own.obstacles) == len(upright.obstacles)
    for mine, theirs in zip(own.obstacles, upright.obstacles, strict=True):
        assert (mine.left, mine.width, mine.range_m) == (theirs.left, theirs.width, theirs.range_m)
        assert mine.top == 240 - theirs.top - theirs.height
        box = np.s_[mine.top : mine.top + mine.height, mine.left : mine.left + mine.width]
        assert np.count_nonzero(own.mask[box]) >= mine.pixels
        assert mine.minimum_m[1] == -theirs.maximum_m[1]
        assert not mine.maximum_m[1] < mine.minimum_m[1]


def test_grid_has_the_obstacles_where_the_points_are(both):
    _, own = both
    grid = own.grid
    np.testing.assert_allclose(grid.axes @ grid.axes.T, np.identity(3), atol=1e-9)
    assert np.linalg.det(grid.axes) == pytest.approx(1.0)
    np.testing.assert_allclose(grid.axes[2], own.ground.up)
    place = (own.obstacle_points[:, :3] - grid.origin_m) @ grid.axes[:2].T / grid.cell_m
    column, row = np.floor(place).astype(int).T
    inside = (column >= 0) & (column < grid.cells.shape[1])
    inside &= (row >= 0) & (row < grid.cells.shape[0])
    assert inside.sum() > 50
    # Points on the border of two cells may count for the other one.
    assert (grid.cells[row[inside], column[inside]] == 100).mean() > 0.98


@pytest.mark.parametrize(
    'vertical',
    [{}, {'gravity_source': 'parameters', 'camera_pitch': 46.0, 'camera_height': 1.0}, 'given'],
)
def test_a_camera_that_is_really_turned(vertical):
    gravity = TURNED.scene.gravity if vertical == 'given' else None
    changes = {} if vertical == 'given' else vertical
    config = dataclasses.replace(TURNED_DOWN, **changes)
    own = Detector(SCENE.camera, config).detect(TURNED.left, TURNED.right, gravity=gravity)

    assert own.warnings == ()
    assert synthetic.iou(own.mask, TURNED.obstacle) > 0.75
    free = (own.mask == 0) & own.known
    assert free.mean() > 0.5
    assert (free & TURNED.obstacle).sum() < 0.05 * TURNED.obstacle.sum()
    np.testing.assert_allclose(own.ground.up, TURNED.scene.gravity.up, atol=0.02)
    assert own.ground.height_m == pytest.approx(1.0, abs=0.03)
    assert own.ground.pitch_deg == pytest.approx(46.0, abs=1.0)
    # Positions in the frame of the camera as it hangs: up in the image is down in the world.
    depth_m = np.where(own.mask == OBSTACLE, np.nan, TURNED.depth_m)
    error = abs(own.points[..., 2] - depth_m) / depth_m
    assert np.nanmedian(error) < 0.02
    heights = own.points @ own.ground.up_vector + own.ground.height_m
    assert abs(np.nanmedian(heights[free])) < 0.02
    assert np.nanmedian(own.height[TURNED.obstacle]) > 0.05


def test_roll_counts_from_the_upside_down_position():
    scene = SCENE.with_(roll_deg=180.0 + 12.0)
    view = synthetic.render(scene)
    config = dataclasses.replace(
        TURNED_DOWN, gravity_source='parameters', camera_pitch=46.0, camera_roll=12.0
    )
    own = Detector(SCENE.camera, config).detect(view.left, view.right)

    np.testing.assert_allclose(own.ground.up, scene.gravity.up, atol=1e-6)
    assert own.warnings == ()
    assert synthetic.iou(own.mask, view.obstacle) > 0.7


def test_rover_mask_is_of_the_images_as_they_arrive():
    mask = np.zeros(SCENE.camera.shape, bool)
    mask[:60] = True
    own = Detector(SCENE.camera, TURNED_DOWN, mask).detect(TURNED.left, TURNED.right)

    assert not own.known[mask].any()
    assert not own.mask[mask].any()
    assert own.known[60:150].mean() > 0.8


def test_ranges_are_along_the_optical_axis_as_ever():
    config = dataclasses.replace(TURNED_DOWN, min_range=1.0, max_range=1.6)
    own = Detector(SCENE.camera, config).detect(TURNED.left, TURNED.right)

    judged_m = TURNED.depth_m[own.known]
    assert judged_m.size > 5000
    assert np.quantile(judged_m, 0.01) > 0.95
    assert np.quantile(judged_m, 0.99) < 1.65


def test_refusal_names_the_parameter():
    words = 'is the camera mounted upside down? Then set upside_down to true'
    with pytest.raises(UnjudgeablePairError, match='the ground is at the top') as refusal:
        Detector(SCENE.camera).detect(TURNED.left, TURNED.right)
    assert words in str(refusal.value)

    words = 'is the camera mounted upright? Then set upside_down to false'
    with pytest.raises(UnjudgeablePairError, match='the ground is at the bottom') as refusal:
        Detector(SCENE.camera, TURNED_DOWN).detect(UPRIGHT.left, UPRIGHT.right)
    assert words in str(refusal.value)


@pytest.mark.parametrize('rows', [0, 1])
def test_a_single_point_is_turned_without_changing_the_upright_one(rows):
    upright = small_detection()
    vars(upright)['ground_points'] = cloud = np.full((rows, 4), 0.5, np.float32)
    cloud.flags.writeable = False
    own = in_recorded_images(upright, upright.camera.mirrored())
    assert own.ground_points.tolist() == [[0.5, -0.5, 0.5, 0.5]] * rows
    assert upright.ground_points.tolist() == [[0.5] * 4] * rows


def test_the_camera_of_the_result_is_the_given_one():
    camera = dataclasses.replace(SCENE.camera, cy=119.3)
    detector = Detector(camera, TURNED_DOWN)
    assert detector.detect(TURNED.left, TURNED.right).camera is detector.camera
