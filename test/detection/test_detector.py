from __future__ import annotations

import contextlib
import dataclasses
import pickle
import re

import numpy as np
import pytest
from synthetic import Box, Dome, mast, pinhole, render

import rover_obstacle_detection
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.errors import CameraError, ImageError, UnjudgeablePairError

SCENE = mast(solids=(Box(0.35, 1.4, 0.25, 0.25, 0.22), Dome(-0.3, 1.0, 0.2)), solid_brightness=0.3)
METHODS = ('hybrid', 'study')
PRODUCTS = {
    'grey': np.uint8,
    'disparity': np.float32,
    'points': np.float32,
    'regions': np.int32,
    'seeds': np.bool_,
    'roughness': np.float32,
    'step': np.float32,
    'height': np.float32,
    'height_noise': np.float32,
    'rock_probability': np.float32,
    'cues': np.uint8,
    'obstacle_numbers': np.int32,
    'confidence': np.float32,
    'known': np.bool_,
    'mask': np.uint8,
}
CLOUDS = {'obstacle_points': 5, 'ground_points': 4}

both_methods = pytest.mark.parametrize('method', METHODS)


def detector(scene=SCENE, method='hybrid', rover_mask=None, **config):
    # A mean shift with the default radius takes seconds.
    quick = {'mean_shift_spatial_radius': 3.0} if method == 'study' else {}
    return Detector(scene.camera, DetectorConfig(method=method, **quick, **config), rover_mask)


def detect(scene=SCENE, method='hybrid', rover_mask=None, **config):
    view = render(scene)
    return detector(scene, method, rover_mask, **config).detect(
        view.left, view.right, gravity=scene.gravity
    )


def arrays(found):
    return {name: getattr(found, name) for name in (*PRODUCTS, *CLOUDS)}


@pytest.fixture(scope='module', params=METHODS)
def found(request):
    return detect(method=request.param, ground_cell=0.0)


def test_package_exports_the_detector():
    assert rover_obstacle_detection.Detector is Detector
    assert rover_obstacle_detection.DetectorConfig is DetectorConfig


def test_default_configuration_is_used():
    assert Detector(SCENE.camera).config == DetectorConfig()


@pytest.mark.parametrize(('name', 'dtype'), PRODUCTS.items())
def test_products_have_size_and_type(found, name, dtype):
    product = getattr(found, name)
    shape = (*SCENE.camera.shape, 3) if name == 'points' else SCENE.camera.shape
    assert product.shape == shape
    assert product.dtype == dtype


@pytest.mark.parametrize('name', [*PRODUCTS, *CLOUDS])
def test_products_are_read_only_and_computed_once(found, name):
    product = getattr(found, name)
    assert getattr(found, name) is product
    with pytest.raises(ValueError, match='read-only'):
        product[:] = 0


def test_detection_is_immutable(found):
    with pytest.raises(dataclasses.FrozenInstanceError):
        found.mask = np.zeros(SCENE.camera.shape, np.uint8)


def test_unmatched_pixels_have_no_disparity_and_no_point(found):
    assert np.isfinite(found.disparity).all()
    assert (found.disparity >= 0).all()
    missing = found.disparity == 0
    assert 0 < missing.mean() < 0.5
    np.testing.assert_array_equal(np.isnan(found.points), np.repeat(missing[..., None], 3, 2))
    np.testing.assert_allclose(
        found.points[..., 2][~missing],
        SCENE.camera.depth_m(found.disparity[~missing]),
        rtol=1e-5,
    )


@pytest.mark.parametrize('name', ['roughness', 'step', 'height'])
def test_lengths_are_finite_or_nan(found, name):
    metres = getattr(found, name)
    assert not np.isinf(metres).any()
    assert 0.5 < np.isfinite(metres).mean() < 1
    if name != 'height':
        assert np.nanmin(metres) >= 0


def test_every_pixel_has_a_region(found):
    numbers = np.unique(found.regions)
    assert numbers[0] >= 1
    assert len(numbers) > 1


def test_seeds_are_whole_regions(found):
    for number in np.unique(found.regions):
        assert len(np.unique(found.seeds[found.regions == number])) == 1


def test_mask_is_free_or_obstacle(found):
    assert set(np.unique(found.mask)) == {0, 255}
    assert found.known[found.mask == 255].mean() > 0.9


def test_grey_is_the_left_image(found):
    # Smoothed where noise hides its texture: here, in a few pixels.
    assert (found.grey == render(SCENE).left).mean() > 0.99


def test_obstacles_are_those_of_the_mask(found):
    assert sum(each.pixels for each in found.obstacles) == np.count_nonzero(found.mask)
    pixels = [each.pixels for each in found.obstacles]
    assert pixels == sorted(pixels, reverse=True)


def pixel_of(points):
    camera = SCENE.camera
    columns = points[:, 0] / points[:, 2] * camera.fx + camera.cx
    rows = points[:, 1] / points[:, 2] * camera.fy + camera.cy
    for coordinates in (columns, rows):
        np.testing.assert_allclose(coordinates, np.rint(coordinates), atol=0.01)
    return np.rint(rows).astype(int), np.rint(columns).astype(int)


@pytest.mark.parametrize(('cloud', 'level'), [('obstacle_points', 255), ('ground_points', 0)])
def test_clouds_have_the_points_of_the_mask(found, cloud, level):
    points = getattr(found, cloud)
    assert points.dtype == np.float32
    assert points.shape[1:] == (CLOUDS[cloud],)
    assert np.isfinite(points).all()
    rows, columns = pixel_of(points)
    order = rows * SCENE.camera.width + columns
    assert (np.diff(order) > 0).all()
    has_point = np.zeros(SCENE.camera.shape, bool)
    has_point[rows, columns] = True
    judged = (found.disparity > 0) & np.isfinite(found.height)
    surface = (found.mask == level) & found.known
    rims = found.rims.behind if level else found.rims.before
    np.testing.assert_array_equal(has_point & judged, surface & judged & ~rims)
    own = judged[rows, columns]
    np.testing.assert_array_equal(points[own, 3], found.height[rows, columns][own])
    np.testing.assert_array_equal(points[own, :3], found.points[rows, columns][own])
    if cloud == 'ground_points':
        assert own.all()
    else:
        np.testing.assert_array_equal(has_point & ~judged, surface & ~judged)
        np.testing.assert_array_equal(points[:, 4], found.confidence[rows, columns])


@both_methods
def test_same_pair_gives_the_same_detection(method):
    one, other = detect(method=method), detect(method=method)
    for name, product in arrays(one).items():
        np.testing.assert_array_equal(product, getattr(other, name), err_msg=name)
    assert one.ground == other.ground
    assert one.obstacles == other.obstacles


@both_methods
def test_detector_is_stateless(method):
    used = detector(method=method)
    view = render(SCENE)
    for pair in ((view.right, view.left), (np.zeros_like(view.left), view.right)):
        # The hybrid refuses both.
        with contextlib.suppress(UnjudgeablePairError):
            used.detect(*pair)
    again = used.detect(view.left, view.right, gravity=SCENE.gravity)
    np.testing.assert_array_equal(again.mask, detect(method=method).mask)


@both_methods
def test_images_are_neither_modified_nor_kept(method):
    left, right = render(SCENE).left.copy(), render(SCENE).right.copy()
    found = detector(method=method).detect(left, right, gravity=SCENE.gravity)
    np.testing.assert_array_equal(left, render(SCENE).left)
    np.testing.assert_array_equal(right, render(SCENE).right)
    left[:], right[:] = 0, 0
    expected = arrays(detect(method=method))
    for name, product in arrays(found).items():
        np.testing.assert_array_equal(product, expected[name], err_msg=name)
    assert left.flags.writeable


@both_methods
@pytest.mark.parametrize('kind', ['bgr', 'uint16', 'bgr uint16', 'strided', 'read-only'])
def test_form_of_the_images_does_not_matter(method, kind):
    def converted(image):
        if 'bgr' in kind:
            image = np.repeat(image[..., np.newaxis], 3, axis=2)
        if 'uint16' in kind:
            image = image.astype(np.uint16) << 4
        if kind == 'strided':
            image = np.repeat(image, 2, axis=1)[:, ::2]
        image.flags.writeable = kind != 'read-only'
        return image

    view = render(SCENE)
    found = detector(method=method).detect(
        converted(view.left.copy()), converted(view.right.copy()), gravity=SCENE.gravity
    )
    np.testing.assert_array_equal(found.mask, detect(method=method).mask)


@pytest.mark.parametrize('side', ['left', 'right'])
def test_image_of_another_size_is_refused(side):
    view = render(SCENE)
    images = {'left': view.left, 'right': view.right}
    images[side] = images[side][:200]
    with pytest.raises(ImageError, match=f'{side} image is 320 x 200: .* 320 x 240'):
        detector().detect(images['left'], images['right'])


def test_rover_mask_of_another_size_is_refused():
    with pytest.raises(ImageError, match=r'\(10, 20\).*\(240, 320\)'):
        detector(rover_mask=np.zeros((10, 20), bool))


@both_methods
def test_rover_mask_is_never_judged(method):
    free = detect(method=method)
    rover = np.zeros(SCENE.camera.shape, bool)
    rover[101:, :161] = True
    assert free.mask[rover].any()
    found = detect(method=method, rover_mask=rover)
    assert not found.mask[rover].any()
    assert not found.disparity[rover].any()
    assert not found.known[rover].any()
    assert np.isnan(found.points[rover]).all()
    assert found.mask[:, 180:].any()
    for cloud in CLOUDS:
        rows, columns = pixel_of(getattr(found, cloud))
        assert not rover[rows, columns].any()


@both_methods
def test_rover_mask_may_cover_the_image(method):
    found = detect(method=method, rover_mask=np.ones(SCENE.camera.shape, bool))
    assert not found.mask.any()
    assert not found.known.any()
    assert len(found.obstacle_points) == len(found.ground_points) == 0


GRAVITY = pytest.mark.parametrize(
    'gravity', [None, Gravity.from_angles(46, 0, 1.0)], ids=['', 'gravity']
)


@pytest.mark.parametrize('level', [0, 90, 255])
@GRAVITY
def test_untextured_images_are_unknown_to_the_study(level, gravity):
    image = np.full(SCENE.camera.shape, level, np.uint8)
    found = detector(method='study').detect(image, image, gravity=gravity)
    assert not found.disparity.any()
    assert not found.seeds.any()
    assert (found.regions == 1).all()
    for name in ('points', 'roughness', 'step', 'height'):
        assert np.isnan(getattr(found, name)).all()
    for cloud in CLOUDS:
        assert getattr(found, cloud).shape == (0, CLOUDS[cloud])
    # Only darkness can make such a region an obstacle.
    if level >= DetectorConfig().dark_grey_level:
        assert not found.mask.any()
        assert found.obstacles == ()


@pytest.mark.parametrize(
    ('level', 'reason'), [(0, 'it is black'), (90, 'covered or fogged lens'), (255, 'it is white')]
)
@GRAVITY
def test_untextured_images_are_refused_by_the_hybrid(level, reason, gravity):
    image = np.full(SCENE.camera.shape, level, np.uint8)
    words = f'neither image shows any texture: .*{reason}'
    with pytest.raises(UnjudgeablePairError, match=words):
        detector().detect(image, image, gravity=gravity)


def unrelated_images():
    return np.random.default_rng(0).integers(0, 256, (2, *SCENE.camera.shape), np.uint8)


def test_unrelated_images_give_consistent_products_of_the_study():
    found = detector(method='study').detect(*unrelated_images())
    assert (found.disparity > 0).mean() < 0.5
    assert sum(each.pixels for each in found.obstacles) == np.count_nonzero(found.mask)
    for cloud in CLOUDS:
        assert np.isfinite(getattr(found, cloud)).all()


def test_unrelated_images_are_refused_by_the_hybrid():
    with pytest.raises(UnjudgeablePairError):
        detector().detect(*unrelated_images())


SIZES = [(64, 48), (63, 49), (321, 243), (33, 31), (160, 16), (16, 160)]


@both_methods
@pytest.mark.parametrize(('width', 'height'), SIZES)
def test_tiny_and_odd_sizes(method, width, height):
    camera = pinhole(width, height, 60.0, 0.06)
    scene = mast(camera=camera)
    found = detect(scene, method=method)
    for name, dtype in PRODUCTS.items():
        product = getattr(found, name)
        assert product.shape[:2] == (height, width)
        assert product.dtype == dtype
    assert found.regions.min() >= 1
    # A step at 2 m is only one to three pixels high, and noise looks like rocks.
    step_px = camera.fx * DetectorConfig().max_step / 2
    assert (found.mask > 0).mean() < (0.5 if step_px > 2 else 0.75)


@pytest.mark.parametrize(('width', 'height'), [(1, 1), (15, 100), (100, 15)])
def test_images_too_small_to_match_are_refused(width, height):
    camera = StereoCamera(width, height, 60.0, 60.0, width / 2, height / 2, 0.1)
    with pytest.raises(CameraError, match=rf'{width} x {height} pixels: expected at least 16'):
        Detector(camera)


@both_methods
def test_stages_are_reported_as_they_end(method):
    stages = []
    view = render(SCENE)
    found = detector(method=method).detect(view.left, view.right, on_stage=stages.append)
    in_order = {
        'hybrid': ['grey', 'disparity', 'local ground', 'outlines', 'border', 'mask'],
        'study': ['grey', 'disparity', 'segmentation', 'terrain', 'decision', 'morphology'],
    }
    assert [stage for stage in stages if stage in in_order[method]] == in_order[method]
    assert len(set(stages)) == len(stages)
    assert found.mask.any()


def test_given_gravity_is_the_vertical():
    view = render(SCENE)
    gravity = Gravity.from_angles(40.0, 3.0)
    found = detector().detect(view.left, view.right, gravity=gravity)
    assert found.ground.up == gravity.up


def test_configured_gravity_is_used_where_none_is_given():
    view = render(SCENE)
    configured = detector(gravity_source='parameters', camera_pitch=44.0, camera_roll=2.0)
    found = configured.detect(view.left, view.right)
    assert found.ground.up == Gravity.from_angles(44.0, 2.0).up
    given = configured.detect(view.left, view.right, gravity=SCENE.gravity)
    assert given.ground.up == SCENE.gravity.up
    ignored = detector(camera_pitch=44.0).detect(view.left, view.right)
    assert ignored.ground.up == detector().detect(view.left, view.right).ground.up
    assert ignored.ground.up != configured.detect(view.left, view.right).ground.up


def test_configured_gravity_of_an_upside_down_camera_points_down_in_its_images():
    view = render(SCENE.with_(roll_deg=180.0))
    turned = detector(
        gravity_source='parameters', camera_pitch=44.0, camera_roll=2.0, upside_down=True
    )
    found = turned.detect(view.left, view.right)
    assert found.ground.measured
    assert found.ground.up == pytest.approx(Gravity.from_angles(44.0, 182.0).up)


def test_border_that_the_left_image_leaves_black_is_not_judged():
    view = render(SCENE)
    left = view.left.copy()
    left[:, 290:] = 0
    found = detector(method='study').detect(left, view.right, gravity=SCENE.gravity)
    assert not found.mask[:, 290:].any()
    assert not found.known[:, 290:].any()
    assert found.known[100:, 200:270].mean() > 0.5


@both_methods
def test_histogram_is_equalized_if_configured(method):
    scene = mast(noise=0.5)
    view = render(scene)
    dim = [image // 8 for image in (view.left, view.right)]
    plain = detector(scene, method).detect(*dim)
    equalized = detector(scene, method, equalize_histogram=True).detect(*dim)
    assert plain.grey.max() < 32
    assert equalized.grey.max() == 255


def test_a_pickled_detection_is_the_same_and_read_only(found):
    again = pickle.loads(pickle.dumps(found))
    for name, array in arrays(found).items():
        np.testing.assert_array_equal(getattr(again, name), array)
    assert again.obstacles == found.obstacles
    assert not again.mask.flags.writeable
    assert repr(again) == repr(found)


def test_repr_is_one_short_line(found):
    assert re.fullmatch(
        rf'<Detection 320 x 240, {found.config.method}: {len(found.obstacles)} obstacles?, '
        r'[\d.]+% obstacle, [\d.]+% unknown, 0 warnings>',
        repr(found),
    )


@pytest.mark.parametrize('image', [None, [[1, 2]], 'left.png'])
def test_what_is_no_array_is_named(image):
    with pytest.raises(ImageError, match=f'left image is {type(image).__name__}: expected an arr'):
        detector().detect(image, image)


def test_what_is_no_camera_is_named():
    with pytest.raises(CameraError, match='camera is NoneType: expected a StereoCamera'):
        Detector(None)
