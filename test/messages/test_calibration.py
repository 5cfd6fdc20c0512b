from __future__ import annotations

import pytest

from rover_obstacle_detection.errors import CameraError
from rover_obstacle_detection.messages.calibration import (
    CameraInfo,
    load_camera_info,
    load_stereo_calibration,
)
from rover_obstacle_detection.messages.rosbags_factory import (
    RosbagsFactory,
    ros1_typestore,
    ros2_typestore,
)

LEFT = """\
image_width: 640
image_height: 480
camera_name: left
camera_matrix: {rows: 3, cols: 3, data: [500, 0, 320, 0, 501.5, 240, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0.1, 0.0, 0.0, 0.0, 0.0]}
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
projection_matrix: {rows: 3, cols: 4, data: [400, 0, 310, 0, 0, 400, 230, 0, 0, 0, 1, 0]}
"""
RIGHT = LEFT.replace('[400, 0, 310, 0, 0', '[400, 0, 310, -48.0, 0')


@pytest.fixture
def files(tmp_path):
    left, right = tmp_path / 'left.yaml', tmp_path / 'right.yaml'
    left.write_text(LEFT)
    right.write_text(RIGHT)
    return left, right


def test_calibration_file_is_read_completely(files):
    info = load_camera_info(files[1])
    assert (info.width, info.height) == (640, 480)
    assert info.distortion_model == 'plumb_bob'
    assert info.d == (0.1, 0, 0, 0, 0)
    assert info.k == (500, 0, 320, 0, 501.5, 240, 0, 0, 1)
    assert info.r == (1, 0, 0, 0, 1, 0, 0, 0, 1)
    assert info.p == (400, 0, 310, -48, 0, 400, 230, 0, 0, 0, 1, 0)
    assert info.roi is None


def test_two_files_give_a_stereo_camera(files):
    camera = load_stereo_calibration(*files).camera
    assert (camera.width, camera.height, camera.fx, camera.cy) == (640, 480, 400, 230)
    assert camera.baseline_m == pytest.approx(0.12)


@pytest.mark.parametrize(
    ('before', 'after', 'words'),
    [
        ('image_width: 640', 'image_width: wide', "image_width is 'wide'"),
        ('image_height: 480\n', '', 'image_height is None'),
        ('500, 0, 320', '500, 320', 'camera_matrix has 8 numbers: expected 9'),
        ('projection_matrix', 'projection', 'projection_matrix is missing'),
        ('[0.1, 0.0', '[0.1, much', 'distortion_coefficients contains a value that is not'),
        ('[400, 0, 310', '[0, 0, 310', 'P[0] (fx) is 0.0'),
        ('[400, 0, 310', '[.nan, 0, 310', 'not finite'),
        ('camera_name: left', 'camera_model: fisheye', "camera_model is 'fisheye': expected pin"),
        (LEFT, 'just a line', 'is not a ROS camera calibration file'),
        (LEFT, '%YAML:1.0\nM: !!opencv-matrix\n', 'is not valid YAML'),
        (LEFT, '', 'is not a ROS camera calibration file'),
    ],
)
def test_error_names_the_file_and_the_invalid_key(files, before, after, words):
    left, right = files
    left.write_text(LEFT.replace(before, after))
    with pytest.raises(CameraError) as caught:
        load_stereo_calibration(left, right)
    assert str(left) in str(caught.value)
    assert words in str(caught.value)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(
    ('shift', 'baseline'), [('0', '0 m: expected'), ('48.0', '-0.12 m: expected')]
)
def test_zero_or_negative_baseline_is_refused(files, shift, baseline):
    left, right = files
    right.write_text(RIGHT.replace('-48.0', shift))
    with pytest.raises(CameraError) as caught:
        load_stereo_calibration(left, right)
    assert f'{left} and {right}: ' in str(caught.value)
    assert baseline in str(caught.value)


def test_unreadable_file_is_named(tmp_path):
    with pytest.raises(CameraError, match=r'none\.yaml: no such calibration file'):
        load_camera_info(tmp_path / 'none.yaml')
    with pytest.raises(CameraError, match='cannot be read: Is a directory'):
        load_camera_info(tmp_path)


@pytest.mark.parametrize('typestore', [ros1_typestore(), ros2_typestore()])
def test_camera_info_of_ros_1_and_ros_2_is_read(files, typestore):
    info = load_camera_info(files[1])
    factory = RosbagsFactory(typestore)
    names = dict.fromkeys('dkrp') if typestore is ros2_typestore() else dict.fromkeys('DKRP')
    matrices = {name: list(getattr(info, name.lower())) for name in names}
    message = factory.make(
        'sensor_msgs/msg/CameraInfo',
        width=640,
        height=480,
        distortion_model='plumb_bob',
        binning_x=2,
        **matrices,
    )
    read = CameraInfo.from_message(message)
    assert (read.k, read.d, read.r, read.p) == (info.k, info.d, info.r, info.p)
    assert (read.width, read.binning_x, read.binning_y) == (640, 2, 0)
