"""Rendered images and their ground truth. Skipped without Mitsuba or LLVM."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from rover_obstacle_detection.errors import MissingExtraError
from rover_obstacle_detection.simulation.cache import render_bag
from rover_obstacle_detection.simulation.frames import SceneWorld, render, right_camera
from rover_obstacle_detection.simulation.labels import (
    DROP,
    FREE,
    NOT_COUNTED,
    ROCK,
    SLOPE,
    survey,
)
from rover_obstacle_detection.simulation.presets import scene_of
from rover_obstacle_detection.simulation.renderer import load_mitsuba
from rover_obstacle_detection.simulation.rocks import RockField


@pytest.fixture(autouse=True, scope='module')
def _mitsuba():
    try:
        load_mitsuba()
    except MissingExtraError as error:
        pytest.skip(str(error))


class View:
    """One view of a scene, without the sensor model."""

    def __init__(self, scene, rocks=None):
        self.scene = scene
        self.world = SceneWorld(scene)
        if rocks is not None:
            self.world.rocks = rocks
        self.camera = self.world.camera
        self.pose = self.world.poses[0]
        mesh = self.world.rock_mesh(self.pose)
        self.renderer = self.world.renderer(self.pose, mesh)
        self.hits = self.renderer.cast(self.camera, self.pose)
        self.disparity = self.camera.fx * self.camera.baseline_m / self.hits.depth_m
        rows, columns = np.mgrid[: self.camera.height, : self.camera.width].astype(np.float32)
        self.rows, self.right_columns = rows, (columns - self.disparity).astype(np.float32)

    def grey(self, side, samples):
        camera, pose = self.camera, self.pose
        if side == 'right':
            camera, pose = right_camera(self.scene, camera, pose)
        return self.renderer.radiance(camera, pose, samples, 1 + (side == 'right')).mean(2)

    def reprojected(self):
        """Disparity error of the left pixels in the right camera, and which are visible there."""
        camera, pose = right_camera(self.scene, self.camera, self.pose)
        depth, _ = self.renderer.cast_at(camera, pose, self.right_columns, self.rows)
        with np.errstate(invalid='ignore'):
            error_px = np.abs(camera.fx * camera.baseline_m / depth - self.disparity)
            # A larger error means that a nearer surface occludes the pixel.
            visible = (self.right_columns >= 0) & (error_px < 1)
        return error_px, visible


@pytest.fixture(scope='module')
def nominal():
    parameters = {'width': 240, 'sensor': {'samples': 16}}
    return View(scene_of('nominal', 3, ['noon'], 'study', parameters))


@pytest.fixture(scope='module')
def crater():
    scene = scene_of('crater', 5, ['crater'], 'study', {'width': 240, 'sensor': {'samples': 4}})
    return next(render(scene))


@pytest.mark.parametrize('rig', ['study', 'hazcam'])
def test_true_depth_reprojects_onto_the_same_surface(rig, nominal):
    view = nominal if rig == 'study' else View(scene_of('x', 4, ['noon'], rig, {'width': 128}))
    error_px, visible = view.reprojected()
    assert visible.sum() > 0.85 * np.isfinite(view.hits.depth_m).sum()
    assert error_px[visible].mean() < 0.01
    assert np.percentile(error_px[visible], 99) < 0.01


def test_images_agree_with_true_depth(nominal):
    left, right = nominal.grey('left', 25), nominal.grey('right', 25)
    error_px, visible = nominal.reprojected()
    ground = visible & (error_px < 0.05) & (nominal.hits.instances == 0)
    ground = cv2.erode(ground.astype(np.uint8), np.ones((9, 9))) > 0
    first = cv2.GaussianBlur(left, (0, 0), 1)
    second = cv2.remap(
        cv2.GaussianBlur(right, (0, 0), 1), nominal.right_columns, nominal.rows, cv2.INTER_CUBIC
    )
    slope_y, slope_x = np.gradient((first + second) / 2)
    design = np.column_stack([slope_x[ground], slope_y[ground]])
    shift_px, *_ = np.linalg.lstsq(design, (first - second)[ground], rcond=None)
    assert ground.sum() > 15_000
    assert np.corrcoef(first[ground], second[ground])[0, 1] > 0.99
    assert np.abs(shift_px).max() < 0.02


def test_plain_sgbm_matches_true_disparity_on_sunlit_ground(nominal):
    frame = next(render(nominal.scene))
    left, right = (cv2.cvtColor(each, cv2.COLOR_RGB2GRAY) for each in (frame.left, frame.right))
    matcher = cv2.StereoSGBM_create(
        numDisparities=32,
        blockSize=5,
        P1=300,
        P2=1200,
        uniquenessRatio=8,
        speckleWindowSize=50,
        speckleRange=2,
        mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )
    disparity = matcher.compute(left, right) / 16.0
    _, visible = nominal.reprojected()
    ground = visible & (nominal.hits.instances == 0)
    sunlit = ground & (left > 0.6 * np.median(left[ground]))
    matched = sunlit & (disparity > 0)
    error_px = np.abs(disparity - nominal.disparity)[matched]
    # SGBM computes no disparity in the leftmost numDisparities columns.
    assert matched[:, 32:].sum() > 0.97 * sunlit[:, 32:].sum()
    assert (error_px < 1).mean() > 0.99
    assert np.median(error_px) < 0.25


def survey_of(frame, cell_m=0.02):
    """Slope, drop and height above ground, from depth, instances and pose only."""
    x_over_z, y_over_z = frame.camera.rays()
    z = frame.depth_m
    points = frame.pose.to_world(np.stack([x_over_z * z, y_over_z * z, z], 2))
    low = points.reshape(-1, 3).min(0)
    column, row = (
        np.rint((points[..., axis] - low[axis]) / cell_m).astype(int) for axis in (0, 1)
    )
    ground = frame.instances == 0
    shape = (row.max() + 1, column.max() + 1)
    count, total = np.zeros(shape), np.zeros(shape)
    np.add.at(count, (row[ground], column[ground]), 1)
    np.add.at(total, (row[ground], column[ground]), points[ground][:, 2])
    height = np.full(shape, np.nan)
    height[count > 0] = total[count > 0] / count[count > 0]
    for sigma in (1, 2, 4, 8, 16, 32):
        weight = cv2.GaussianBlur(np.isfinite(height) * 1.0, (0, 0), sigma)
        mean = cv2.GaussianBlur(np.nan_to_num(height), (0, 0), sigma) / np.maximum(weight, 1e-9)
        holes = np.isnan(height) & (weight > 1e-3)
        height[holes] = mean[holes]
    height = np.where(np.isnan(height), np.nanmean(height), height).astype(np.float32)
    surveyed = survey(height, 0.0, 0.0, cell_m)
    at = (row, column)
    return (
        surveyed.slope_deg[at],
        surveyed.drop_m[at],
        points[..., 2] - surveyed.height_m[at],
    )


def overlap(first, second):
    return (first & second).sum() / (first | second).sum()


def test_labels_agree_with_depth_and_instances(crater):
    slope_deg, drop_m, above_m = survey_of(crater)
    ground = crater.instances == 0
    steep = ground & (slope_deg > 20)
    low = ground & ~steep & (drop_m > 0.10)
    assert overlap(steep, ground & (crater.labels == SLOPE)) > 0.9
    assert overlap(low, ground & (crater.labels == DROP)) > 0.85
    assert (crater.labels == SLOPE).sum() > 2500
    assert (crater.labels == DROP).sum() > 500
    checked = 0
    height, width = crater.labels.shape
    for number in np.unique(crater.instances)[1:]:
        pixels = crater.instances == number
        rows, columns = np.nonzero(pixels)
        inside = rows.min() > 0 and columns.min() > 0
        inside &= rows.max() < height - 1 and columns.max() < width - 1
        if pixels.sum() < 40 or not inside:
            continue
        checked += 1
        top_m = above_m[pixels].max()
        # The bounds overlap because a rock hides the ground behind it.
        if (crater.labels[pixels] == ROCK).all():
            assert top_m > 0.10
        else:
            assert top_m < 0.14
    assert checked > 5


def test_each_rock_has_one_label(crater):
    for number in np.unique(crater.instances)[1:]:
        values = set(np.unique(crater.labels[crater.instances == number]))
        assert values in ({ROCK}, {NOT_COUNTED}) or not values & {ROCK, NOT_COUNTED}


def test_sky_has_no_depth_and_is_not_counted():
    scene = scene_of('x', 6, ['moon'], 'hazcam', {'width': 160, 'sensor': {'samples': 4}})
    frame = next(render(scene))
    sky = np.isnan(frame.depth_m)
    assert 0.05 < sky.mean() < 0.5
    assert sky[:8].mean() > 0.8
    assert (frame.labels[sky] == NOT_COUNTED).all()
    assert (frame.instances[sky] == 0).all()
    assert frame.left[sky].mean() < 0.2 * frame.left[~sky].mean()


def test_shadows_point_away_from_the_sun():
    # The sun is on the left, so the shadow is to the right of the rock.
    scene = scene_of(
        'x',
        1,
        [],
        'study',
        {
            'width': 160,
            'terrain': {'relief_m': 0, 'roughness_m': 0, 'clods_m': 0},
            'soil': {'world': 'moon'},
            'light': {'sun_elevation_deg': 30, 'sun_azimuth_deg': 90},
        },
    )
    one = RockField(np.array([1.0]), np.zeros(1), np.array([0.3]), np.array([7]))
    view = View(scene, one)
    light = view.grey('left', 4)
    rows, columns = np.nonzero(view.hits.instances == 1)
    row = round(rows.mean())
    left, right = columns[rows == row].min(), columns[rows == row].max()
    shadow, sunlit = light[row, right + 2 : right + 5], light[row, left - 4 : left - 1]
    assert shadow.mean() < 0.1 * sunlit.mean()


def world_points(view):
    rays = np.stack(np.broadcast_arrays(*view.camera.rays(), np.float32(1)), axis=2)
    return view.pose.to_world(rays * view.hits.depth_m[..., np.newaxis])


def test_pixels_on_the_walls_and_floor_of_a_trench():
    scene = scene_of(
        'x',
        2,
        [],
        'study',
        {
            'width': 160,
            'terrain': {
                'relief_m': 0,
                'roughness_m': 0,
                'steps': [{'ahead_m': 1.0, 'rise_m': -0.4, 'width_m': 0.8, 'waviness_m': 0}],
            },
            'rocks': {'cover': 0, 'placed': 0},
        },
    )
    view = View(scene)
    labels = view.world.label(view.hits, view.pose, view.world.rock_mesh(view.pose))
    x, _, z = np.moveaxis(world_points(view), 2, 0)
    wall = (z < -0.05) & (z > -0.35)
    floor = (x > 1.25) & (x < 1.55) & (z < -0.38)
    level = (x < 0.7) | (x > 2.1)
    # The far wall fills more of the image than the horizontal extent of its slope.
    assert wall.sum() > 500
    assert floor.sum() > 500
    assert (labels[wall] == SLOPE).all()
    assert (labels[floor] == DROP).all()
    assert (labels[level] == FREE).all()
    error_px, visible = view.reprojected()
    assert error_px[visible].mean() < 0.02


def test_shade_darkens_the_requested_ground_and_stays_out_of_view():
    light = {'sun_elevation_deg': 25.0, 'sun_azimuth_deg': 120.0, 'sky': 0.02}
    shade = {'shade_m': 0.8, 'shade_ahead_m': 1.2, 'shade_left_m': 0.1}
    flat = {'relief_m': 0, 'roughness_m': 0, 'clods_m': 0}
    lit, shaded = (
        View(scene_of('x', 2, [], 'study', {'width': 160, 'terrain': flat, 'light': each}))
        for each in (light, light | shade)
    )
    np.testing.assert_array_equal(shaded.hits.depth_m, lit.hits.depth_m)
    ratio = shaded.grey('left', 4) / lit.grey('left', 4)
    x, y, _ = np.moveaxis(world_points(lit), 2, 0)
    distance = np.hypot(x - 1.2, y - 0.1)
    ground = lit.hits.instances == 0
    assert np.median(ratio[ground & (distance < 0.25)]) < 0.2
    assert np.median(ratio[ground & (distance > 0.6)]) > 0.95


def test_slabs_are_thin_and_upright():
    def extent(slabs):
        scene = scene_of('x', 2, [], 'vga', {'width': 96, 'rocks': {'slabs': slabs}})
        world = SceneWorld(scene)
        world.rocks = RockField(
            np.full(20, 2.0), np.zeros(20), np.full(20, 0.5), np.arange(200, 220)
        )
        mesh = world.rock_mesh(world.poses[0])
        ratios = []
        for number in range(1, 21):
            points = mesh.vertices[mesh.faces[mesh.instance == number].ravel()]
            points = points - points.mean(0)
            thickness = np.sqrt(
                np.linalg.eigvalsh(points[:, :2].T @ points[:, :2] / len(points))[0]
            )
            ratios.append(np.ptp(points[:, 2]) / thickness)
        return np.median(ratios)

    assert extent(1.0) > 2 * extent(0.0)


def test_dark_rocks_are_dark():
    def mean_tone(conditions):
        world = SceneWorld(scene_of('x', 2, conditions, 'vga', {'width': 96}))
        return world.rock_mesh(world.poses[0]).colours.mean()

    assert mean_tone(['dark_rocks']) < 0.4 * mean_tone([])


def messages(path):
    with AnyReader([path]) as reader:
        return [(each.topic, time_ns, bytes(data)) for each, time_ns, data in reader.messages()]


def test_equal_seeds_give_equal_bags_and_rocks_persist_during_a_drive(tmp_path):
    def bag(name, seed, frames=2):
        parameters = {
            'width': 96,
            'sensor': {'samples': 4},
            'drive': {'frames': frames, 'step_m': 0.1, 'turn_deg': 3.0},
        }
        path = tmp_path / name / 'scene'
        render_bag(scene_of('scene', seed, ['dunes'], 'vga', parameters), path)
        return messages(path)

    first, again, other = bag('a', 1), bag('b', 1), bag('c', 2, frames=1)
    assert first == again
    assert {each[:2] for each in other} == {each[:2] for each in first if each[1] == first[0][1]}
    left_images = [
        {data for topic, _, data in each if topic == '/stereo/left/image_rect'}
        for each in (first, other)
    ]
    assert [len(each) for each in left_images] == [2, 1]
    assert not left_images[0] & left_images[1]
    seen = [set(np.frombuffer(data, np.uint16)) for topic, _, data in first if 'inst' in topic]
    assert len(seen[0] & seen[1]) > 0.5 * len(seen[0])
