from __future__ import annotations

import dataclasses
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hand_made import small_detection

from rover_obstacle_detection import DetectorConfig, StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.result.cue import KIND_NUMBERS, KINDS, Cue
from rover_obstacle_detection.messages.calibration import CameraInfo
from rover_obstacle_detection.messages.cloud import decode_cloud
from rover_obstacle_detection.messages.header import make_header, stamp_ns
from rover_obstacle_detection.messages.image import decode_float_image, decode_image
from rover_obstacle_detection.messages.outputs import OUTPUTS
from rover_obstacle_detection.messages.rectification import needs_rectification
from rover_obstacle_detection.messages.rosbags_factory import RosbagsFactory
from rover_obstacle_detection.pictures import (
    KIND_COLOURS,
    overlay_picture,
    regions_picture,
    roughness_step_picture,
    seeds_picture,
)

FACTORY = RosbagsFactory()
HEADER = make_header(1_700_000_000_123_456_789, 'left_optical', FACTORY)
SHAPE = (24, 32)
CAMERA = StereoCamera(width=32, height=24, fx=40, fy=40, cx=15.5, cy=11.5, baseline_m=0.1)


def detection(disparity=None, mask=None, known=None):
    """Build a wall at 0.8 m with an unmatched border and one obstacle."""
    if disparity is None:
        disparity = np.full(SHAPE, 5, np.float32)
        disparity[:4], disparity[:, :6] = 0, 0
    if mask is None:
        mask = np.zeros(SHAPE, np.uint8)
        mask[10:14, 10:20] = 255
    rows = np.broadcast_to(np.arange(24, dtype=np.float32)[:, None], SHAPE)
    heights = np.where(mask > 0, rows / 100, rows / 1000)
    return small_detection(
        CAMERA,
        parameters=DetectorParameters.from_config(DetectorConfig(min_range=0.5, ground_cell=0.0)),
        ground=GroundPlane(normal=(0, -1, 0), height_m=1.0, up=(0, -1, 0)),
        grey=np.full(SHAPE, 90, np.uint8),
        disparity=disparity,
        regions=np.ones(SHAPE, np.int32),
        seeds=np.ones(SHAPE, bool),
        roughness=np.full(SHAPE, 0.01, np.float32),
        step=np.full(SHAPE, 0.02, np.float32),
        height=np.where(disparity > 0, heights, np.nan).astype(np.float32),
        height_noise=np.full(SHAPE, 0.02, np.float32),
        cues=(mask > 0).astype(np.uint8),
        known=disparity > 0 if known is None else known,
        mask=mask,
    )


def encode(name, seen):
    """Encode an output, serialise it and read it back."""
    output = OUTPUTS[name]
    message = output.encode(seen, HEADER, FACTORY)
    raw = FACTORY.typestore.serialize_cdr(message, output.type_name)
    return FACTORY.typestore.deserialize_cdr(raw, output.type_name)


def test_output_topics_and_types():
    assert {name: each.type_name for name, each in OUTPUTS.items()} == {
        'obstacle_mask': 'sensor_msgs/msg/Image',
        'obstacle_points': 'sensor_msgs/msg/PointCloud2',
        'ground_points': 'sensor_msgs/msg/PointCloud2',
        'obstacle_grid': 'nav_msgs/msg/OccupancyGrid',
        'disparity': 'stereo_msgs/msg/DisparityImage',
        'camera_info': 'sensor_msgs/msg/CameraInfo',
        'obstacle_markers': 'visualization_msgs/msg/MarkerArray',
        'detection_image': 'sensor_msgs/msg/Image',
        'debug/known': 'sensor_msgs/msg/Image',
        'debug/regions': 'sensor_msgs/msg/Image',
        'debug/seeds': 'sensor_msgs/msg/Image',
        'debug/roughness_step': 'sensor_msgs/msg/Image',
    }


@pytest.mark.parametrize('name', OUTPUTS)
@pytest.mark.parametrize('empty', [False, True])
def test_every_output_has_the_header_of_the_left_image(name, empty):
    nothing = np.zeros(SHAPE, np.float32), np.zeros(SHAPE, np.uint8)
    message = encode(name, detection(*nothing) if empty else detection())
    header = message.markers[0].header if name == 'obstacle_markers' else message.header
    assert stamp_ns(header) == 1_700_000_000_123_456_789
    assert header.frame_id == 'left_optical'


def test_clouds_hold_the_points_of_the_masks_pixels():
    seen = detection()
    mask = decode_image(encode('obstacle_mask', seen), 'mask')
    np.testing.assert_array_equal(mask, seen.mask)
    assert encode('obstacle_mask', seen).encoding == 'mono8'
    matched = seen.disparity > 0
    for name, where in (
        ('obstacle_points', (mask == 255) & matched),
        ('ground_points', (mask == 0) & matched),
    ):
        message = encode(name, seen)
        fields = [field.name for field in message.fields]
        assert fields[:4] == ['x', 'y', 'z', 'height']
        cloud = decode_cloud(message)
        np.testing.assert_array_equal(cloud[:, :3], seen.points[where])
        np.testing.assert_array_equal(cloud[:, 3], seen.height[where])
        assert np.isfinite(cloud).all()
        if name == 'obstacle_points':
            assert fields[4:] == ['confidence', 'kind']
            np.testing.assert_array_equal(cloud[:, 4], np.float32(seen.obstacles[0].confidence))
            assert (cloud[:, 5] == KIND_NUMBERS['rock']).all()


def test_cloud_has_the_carried_points_and_not_the_rims():
    whole = detection()
    disparity, height = whole.disparity.copy(), whole.height.copy()
    disparity[12, 14:16], height[12, 14:16] = 0, np.nan
    disparity[10, 10:13], height[10, 10:13] = 3.0, 0.0
    seen = replace(whole, disparity=disparity, height=height, known=whole.known)
    message = encode('obstacle_points', seen)
    assert (message.width, message.height, message.is_dense) == (40 - 3, 1, True)
    assert len(message.data) == 37 * 24 == message.row_step
    cloud = decode_cloud(message)
    np.testing.assert_array_equal(cloud[:, :5], seen.obstacle_points)
    np.testing.assert_array_equal(cloud[:, 5], seen.obstacle_point_kinds)
    rows = np.flatnonzero(np.isclose(cloud[:, 1] / cloud[:, 2], 0.5 / 40, atol=1e-4))
    np.testing.assert_allclose(cloud[rows[4:6], :2], whole.points[12, 14:16, :2], atol=1e-3)
    assert cloud[:, 2].max() == pytest.approx(0.8, abs=1e-3)


def test_points_have_the_kind_of_their_pixel():
    whole = detection()
    cues = whole.cues.copy()
    parts = {10: Cue.SLOPE, 11: Cue.DROP, 12: Cue.ROUGHNESS_STEP, 13: Cue.HEIGHT}
    for row, cue in parts.items():
        cues[row][whole.mask[row] > 0] = cue
    cloud = decode_cloud(encode('obstacle_points', replace(whole, cues=cues)))
    rows = np.rint(cloud[:, 1] / cloud[:, 2] * 40 + 11.5)
    for row, cue in parts.items():
        of_row = cloud[rows == row, 5]
        assert (len(of_row), set(of_row)) == (10, {KIND_NUMBERS[KINDS[cue]]})


def test_known_image_marks_known_pixels():
    seen = detection()
    message = encode('debug/known', seen)
    assert (message.encoding, message.width, message.height) == ('mono8', 32, 24)
    assert bytes(message.data) == bytes(np.where(seen.known, 255, 0).astype(np.uint8))
    assert 0 < np.count_nonzero(message.data) < message.data.size


def test_unknown_pixels_are_in_neither_cloud():
    mask = np.zeros(SHAPE, np.uint8)
    mask[10:14, 10:20] = 255
    known = np.ones(SHAPE, bool)
    known[:, 15:] = False
    seen = detection(mask=mask, known=known)
    for name, where in (
        ('obstacle_points', (mask == 255) & known & (seen.disparity > 0)),
        ('ground_points', (mask == 0) & known & (seen.disparity > 0)),
    ):
        cloud = decode_cloud(encode(name, seen))
        np.testing.assert_array_equal(cloud[:, :3], seen.points[where])


def test_disparity_image_gives_the_depth_of_the_points():
    seen = detection()
    message = encode('disparity', seen)
    disparity = decode_float_image(message.image, 'disparity')
    valid = disparity >= message.min_disparity
    np.testing.assert_array_equal(valid, seen.disparity > 0)
    depth = message.f * message.t / disparity[valid]
    np.testing.assert_allclose(depth, seen.points[valid][:, 2], rtol=1e-6)
    window = message.valid_window
    assert (window.x_offset, window.y_offset, window.width, window.height) == (6, 4, 26, 20)
    assert message.max_disparity == pytest.approx(40 * 0.1 / 0.5)
    assert message.delta_d == 1 / 16


def test_box_encloses_the_points_of_the_obstacle():
    seen = detection()
    clear, box, _ = encode('obstacle_markers', seen).markers
    assert (clear.action, clear.ns) == (3, '')
    points = decode_cloud(encode('obstacle_points', seen))[:, :3]
    centre = np.array([getattr(box.pose.position, axis) for axis in 'xyz'])
    size = np.array([getattr(box.scale, axis) for axis in 'xyz'])
    assert (box.type, box.action, box.ns, box.id) == (1, 0, 'rock', 0)
    np.testing.assert_allclose((centre - size / 2)[:2], points.min(axis=0)[:2], atol=1e-6)
    np.testing.assert_allclose((centre + size / 2)[:2], points.max(axis=0)[:2], atol=1e-6)
    assert centre[2] == pytest.approx(0.8)
    assert size[2] == pytest.approx(0.01)
    assert box.pose.orientation.w == 1
    assert box.color.a == pytest.approx(0.1 + 0.5 * seen.obstacles[0].confidence)


def test_label_above_the_box_shows_confidence_kind_and_height():
    seen = detection()
    _, box, label = encode('obstacle_markers', seen).markers
    (obstacle,) = seen.obstacles
    assert (label.type, label.action, label.ns, label.id) == (9, 0, 'labels', 0)
    assert label.text == f'{obstacle.confidence:.2f} rock 0.13 m'
    assert label.scale.z > 0.02
    assert label.color.a == 1
    assert label.pose.position.x == box.pose.position.x
    assert label.pose.position.z == box.pose.position.z
    top = box.pose.position.y - box.scale.y / 2
    assert label.pose.position.y + label.scale.z / 2 < top < label.pose.position.y + 0.2


def test_label_of_a_low_obstacle_shows_no_height():
    mask = np.zeros(SHAPE, np.uint8)
    mask[8, 10:20] = 255
    (obstacle,) = detection(mask=mask).obstacles
    assert obstacle.max_height_m == pytest.approx(0.08), 'the limit is 0.10 m'
    label = encode('obstacle_markers', detection(mask=mask)).markers[2]
    assert label.text == f'{obstacle.confidence:.2f} rock'


def test_kinds_of_obstacle_have_namespaces_and_colours_of_their_own():
    mask = np.zeros(SHAPE, np.uint8)
    cues = np.zeros(SHAPE, np.uint8)
    kinds = {'slope': Cue.SLOPE, 'drop': Cue.DROP, 'rough': Cue.ROUGHNESS_STEP, 'rock': Cue.HEIGHT}
    for index, cue in enumerate(kinds.values()):
        part = np.s_[4 + 5 * index : 7 + 5 * index, 10 : 20 - index]
        mask[part], cues[part] = 255, cue
    seen = replace(detection(mask=mask), cues=cues)
    markers = encode('obstacle_markers', seen).markers[1:]
    boxes, labels = markers[:4], markers[4:]
    assert [each.ns for each in boxes] == list(kinds)
    assert [each.text.split()[1] for each in labels] == list(kinds)
    assert [len(each.text.split()) for each in labels] == [2, 2, 2, 4], 'only rocks have heights'
    assert {each.ns for each in labels} == {'labels'}
    for box in boxes:
        blue, green, red = KIND_COLOURS[box.ns]
        colour = (box.color.r, box.color.g, box.color.b)
        assert colour == pytest.approx((red / 255, green / 255, blue / 255), abs=1e-6)


def test_label_without_a_ground_plane_shows_no_height():
    seen = detection()
    assumed = replace(seen, ground=replace(seen.ground, measured=False))
    label = encode('obstacle_markers', assumed).markers[2]
    assert label.text == f'{seen.obstacles[0].confidence:.2f} rock'


def test_box_is_more_opaque_with_higher_confidence():
    mask = np.zeros(SHAPE, np.uint8)
    mask[6:8, 8:10] = 255
    mask[14:23, 8:24] = 255
    made = detection(mask=mask)
    probability = np.where(np.arange(SHAPE[0])[:, np.newaxis] < 10, 0.5, 0.99)
    seen = replace(made, rock_probability=np.full(SHAPE, probability, np.float32))
    large, small = seen.obstacles
    boxes = encode('obstacle_markers', seen).markers[1:3]
    assert large.confidence > small.confidence
    assert boxes[0].color.a > boxes[1].color.a > 0


def test_obstacle_without_3d_points_has_no_markers():
    seen = detection()
    mask = seen.mask.copy()
    mask[0:2, 0:2] = 255
    assert len(detection(mask=mask).obstacles) == 2
    assert len(encode('obstacle_markers', detection(mask=mask)).markers) == 3


def test_unjudgeable_pair_has_an_empty_ground_cloud_and_nothing_known():
    config = DetectorConfig(grid_cell=0.5, grid_extent=3.0)
    made = {
        name: output.encode_unknown(SHAPE, config, HEADER, FACTORY)
        for name, output in OUTPUTS.items()
        if output.encode_unknown
    }
    # An empty obstacle cloud or a black mask would mean that there is no obstacle.
    assert set(made) == {'ground_points', 'obstacle_grid', 'debug/known'}
    for message in made.values():
        assert stamp_ns(message.header) == stamp_ns(HEADER)
        assert message.header.frame_id == 'left_optical'
    ground = made['ground_points']
    assert [field.name for field in ground.fields] == ['x', 'y', 'z', 'height']
    assert (ground.width, ground.height, len(ground.data)) == (0, 1, 0)
    known = decode_image(made['debug/known'], 'known')
    assert known.shape == SHAPE
    assert not known.any()
    grid = made['obstacle_grid']
    assert (grid.info.width, grid.info.height, grid.info.resolution) == (6, 6, 0.5)
    assert (grid.data == -1).all()
    assert len(grid.data) == 36


@pytest.mark.parametrize(
    ('name', 'draw'),
    [
        ('detection_image', overlay_picture),
        ('debug/regions', regions_picture),
        ('debug/seeds', seeds_picture),
        ('debug/roughness_step', roughness_step_picture),
    ],
)
def test_pictures_are_published_unchanged(name, draw):
    message = encode(name, detection())
    assert message.encoding == 'bgr8'
    np.testing.assert_array_equal(decode_image(message, name), draw(detection()))


@pytest.mark.parametrize('name', OUTPUTS)
@pytest.mark.parametrize('empty', [False, True])
def test_live_node_and_replay_make_the_same_bytes(name, empty):
    serialization = pytest.importorskip('rclpy.serialization', reason='needs the extra ros')
    from rover_obstacle_detection.node.rclpy_factory import RclpyFactory

    nothing = np.zeros(SHAPE, np.float32), np.zeros(SHAPE, np.uint8)
    seen, output = detection(*nothing) if empty else detection(), OUTPUTS[name]
    live_header = make_header(1_700_000_000_123_456_789, 'left_optical', RclpyFactory())
    live = serialization.serialize_message(output.encode(seen, live_header, RclpyFactory()))
    store = FACTORY.typestore
    # Padding bytes between fields are undefined; reading and writing again clears them.
    live = store.serialize_cdr(store.deserialize_cdr(live, output.type_name), output.type_name)
    written = store.serialize_cdr(output.encode(seen, HEADER, FACTORY), output.type_name)
    assert bytes(live) == bytes(written)


def test_camera_info_is_that_of_the_masks_pixels():
    camera = dataclasses.replace(CAMERA, cx_right=12.5)
    message = encode('camera_info', dataclasses.replace(detection(), camera=camera))
    assert (message.width, message.height) == SHAPE[::-1]
    # Of the left camera, and nothing is left to rectify.
    assert StereoCamera.from_camera_info(message, right_of(message, camera)) == camera
    assert not needs_rectification(CameraInfo.from_message(message))


def right_of(left, camera):
    p = left.p.copy()
    p[2], p[3] = camera.cx_right, -camera.fx * camera.baseline_m
    return SimpleNamespace(width=left.width, height=left.height, p=p)


def test_principal_point_offset_is_subtracted_once():
    seen = detection()
    verged = dataclasses.replace(seen, camera=dataclasses.replace(CAMERA, cx_right=12.5))
    disparity = decode_float_image(encode('disparity', verged).image, 'disparity')
    assert disparity.max() == 5
