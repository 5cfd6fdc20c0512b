from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from rover_obstacle_detection.calibration_files.numbers import CameraNumbers
from rover_obstacle_detection.calibration_files.request import CalibrationRequest
from rover_obstacle_detection.errors import CameraError

SIZE = (640, 480)
K1 = np.array([[500.0, 0, 320], [0, 501, 240], [0, 0, 1]])
K2 = np.array([[505.0, 0, 322], [0, 506, 238], [0, 0, 1]])
D1, D2 = np.array([-0.1, 0.02, 0.001, 0, 0]), np.array([-0.12, 0.03, 0, 0.001, 0])
R = cv2.Rodrigues(np.array([0.01, -0.02, 0.005]))[0]
T = np.array([-0.12, 0.001, 0.002])
FLAGS = cv2.CALIB_ZERO_DISPARITY
RECTIFIED = cv2.stereoRectify(K1, D1, K2, D2, SIZE, R, T[:, None], flags=FLAGS, alpha=0)
P1, P2 = RECTIFIED[2], RECTIFIED[3]

CHAIN = """\
cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.1, 0.02, 0.001, 0]
  distortion_model: radtan
  intrinsics: [500.0, 501.0, 320.0, 240.0]
  resolution: [640, 480]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
POSE  cam_overlaps: [0]
  camera_model: pinhole
  distortion_coeffs: [-0.12, 0.03, 0, 0.001]
  distortion_model: radtan
  intrinsics: [505.0, 506.0, 322.0, 238.0]
  resolution: [640, 480]
  rostopic: /cam1/image_raw
""".replace(
    'POSE', ''.join(f'  - {row}\n' for row in np.vstack((np.c_[R, T], [0, 0, 0, 1])).tolist())
)

PARALLEL = """\
  - [1, 0, 0, -0.2]
  - [0, 1, 0, 0]
  - [0, 0, 1, 0]
  - [0, 0, 0, 1]
"""

SENSOR = """\
# comment
sensor_type: camera
T_BS:
  cols: 4
  rows: 4
  data: POSE
rate_hz: 20
resolution: [640, 480]
camera_model: pinhole
intrinsics: [500.0, 501.0, 320.0, 240.0]
distortion_model: radial-tangential
distortion_coefficients: [-0.1, 0.02, 0.001, 0]
"""

KITTI = """\
P0: 7.070912e+02 0 6.018873e+02 0 0 7.070912e+02 1.831104e+02 0 0 0 1 0
P1: 7.070912e+02 0 6.018873e+02 -3.798145e+02 0 7.070912e+02 1.831104e+02 0 0 0 1 0
P2: 7.0e+02 0 6.0e+02 4.688783e+01 0 7.0e+02 1.8e+02 1.178601e-01 0 0 1 6.203223e-03
P3: 7.0e+02 0 6.0e+02 -3.334597e+02 0 7.0e+02 1.8e+02 1.930130e+00 0 0 1 3.318498e-03
Tr: 1 2 3 4 5 6 7 8 9 10 11 12
"""


def opencv_file(path, **matrices):
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in matrices.items():
        storage.write(name, value)
    storage.release()
    return path


def text_file(path, text):
    path.write_text(text)
    return path


def load(*files, images='left.png', size=SIZE):
    return CalibrationRequest(files).calibration(lambda: size, images)


def assert_is_the_camera(calibration):
    camera = calibration.camera
    assert (camera.width, camera.height) == SIZE
    found = (camera.fx, camera.fy, camera.cx, camera.cy)
    assert found == pytest.approx((P1[0, 0], P1[1, 1], P1[0, 2], P1[1, 2]))
    assert camera.baseline_m == pytest.approx(-P2[0, 3] / P2[0, 0])
    assert camera.baseline_m == pytest.approx(np.linalg.norm(T))
    assert calibration.left.r == pytest.approx(RECTIFIED[0].ravel())
    assert calibration.right.r == pytest.approx(RECTIFIED[1].ravel())
    assert calibration.right.k == pytest.approx(K2.ravel())
    assert calibration.right.d[:4] == pytest.approx(D2[:4])


@pytest.mark.parametrize('suffix', ['yml', 'yaml', 'xml'])
@pytest.mark.parametrize('letter', ['K', 'M', 'cameraMatrix'])
def test_opencv_calibration_is_rectified(tmp_path, suffix, letter):
    intrinsic = {f'{letter}1': K1, 'D1': D1, f'{letter}2': K2, 'D2': D2}
    path = opencv_file(tmp_path / f'stereo.{suffix}', **intrinsic, R=R, T=T)
    assert_is_the_camera(load(path))


def test_opencv_rectification_is_used_where_it_is_given(tmp_path):
    intrinsic = {'K1': K1, 'D1': D1, 'K2': K2, 'D2': D2, 'image_width': 640, 'image_height': 480}
    r1, r2, p1, p2 = RECTIFIED[:4]
    path = opencv_file(tmp_path / 'stereo.yml', **intrinsic, R1=r1, R2=r2, P1=p1, P2=p2)
    assert_is_the_camera(load(path, size=(1, 1)))


def test_two_files_of_opencv_complete_each_other(tmp_path):
    intrinsics = opencv_file(tmp_path / 'intrinsics.yml', M1=K1, D1=D1, M2=K2, D2=D2)
    extrinsics = opencv_file(tmp_path / 'extrinsics.yml', R=R, T=T)
    assert_is_the_camera(load(intrinsics, extrinsics))
    with pytest.raises(CameraError, match=r'extrinsics\.yml: lacks K1, D1, K2, D2: expected'):
        load(extrinsics)


def test_opencv_projections_alone_are_of_rectified_images(tmp_path):
    calibration = load(opencv_file(tmp_path / 'stereo.yml', P1=P1, P2=P2))
    assert calibration.camera.fx == pytest.approx(P1[0, 0])
    assert calibration.left.k == pytest.approx(P1[:, :3].ravel())
    assert calibration.left.d == ()


def load_parts(*files):
    return CalibrationRequest(files, are_parts=True).calibration(lambda: SIZE, 'left.png')


def test_parts_of_a_calibration_complete_each_other(tmp_path):
    intrinsics = opencv_file(tmp_path / 'intrinsics.yml', M1=K1, D1=D1, M2=K2, D2=D2)
    extrinsics = opencv_file(tmp_path / 'extrinsics.yml', R=R, T=T)
    assert_is_the_camera(load_parts(intrinsics, extrinsics))
    both = opencv_file(tmp_path / 'both.yml', M1=K1, D1=D1, M2=K2, D2=2 * D2, R=R, T=T)
    with pytest.raises(CameraError, match=r'intrinsics\.yml and .*both\.yml: differ in D2: expec'):
        load_parts(intrinsics, both)
    chain = text_file(tmp_path / 'camchain.yaml', CHAIN)
    for files in ((intrinsics, chain), (chain, chain)):
        with pytest.raises(
            CameraError, match=r'camchain\.yaml: is a Kalibr calibration and one of'
        ):
            load_parts(*files)
    assert_is_the_camera(load_parts(chain))


def test_a_request_is_repeated_with_the_options_that_gave_it():
    a, b = Path('a.yml'), Path('b.yml')
    parts = CalibrationRequest((a, b), are_parts=True)
    assert parts.arguments() == ['--calibration', 'a.yml', '--calibration', 'b.yml']
    assert CalibrationRequest((a,)).arguments() == ['--calibration', 'a.yml']
    sides = CalibrationRequest((a, b), CameraNumbers(fx=5.0)).arguments()
    assert sides == ['--left-info', 'a.yml', '--right-info', 'b.yml', '--fx', '5.0']


@pytest.mark.parametrize(
    ('others', 'lacking'),
    [
        ({'K1': K1, 'K2': K2, 'R': R, 'T': T, 'distortion_1': D1}, 'D1, D2'),
        ({'P1': P1, 'P2': P2, 'K1': K1, 'K2': K2, 'R': R, 'T': T}, 'D1, D2'),
        ({'P1': P1, 'P2': P2, 'K1': K1, 'K2': K2, 'D1': D1, 'D2': D2}, 'R, T'),
        ({'P1': P1, 'P2': P2, 'R1': R, 'R2': R, 'R': R, 'T': T}, 'K1, D1, K2, D2'),
    ],
)
def test_no_part_of_opencv_calibration_is_taken_as_absent(tmp_path, others, lacking):
    with pytest.raises(CameraError, match=f': lacks {lacking}: expected K1'):
        load(opencv_file(tmp_path / 'stereo.yml', **others))


def test_opencv_rectification_is_computed_without_both_rotations(tmp_path):
    intrinsic = {'K1': K1, 'D1': D1, 'K2': K2, 'D2': D2, 'R': R, 'T': T}
    assert_is_the_camera(load(opencv_file(tmp_path / 'stereo.yml', **intrinsic, P1=P1, P2=P2)))


def test_opencv_fisheye_is_named_in_the_file(tmp_path):
    intrinsic = {'K1': K1, 'D1': D1[:4], 'K2': K2, 'D2': D2[:4], 'R': R, 'T': T}
    path = opencv_file(tmp_path / 'stereo.yml', **intrinsic, distortion_model='fisheye')
    assert load(path).left.distortion_model == 'equidistant'


def test_kalibr_camera_chain_is_rectified(tmp_path):
    assert_is_the_camera(load(text_file(tmp_path / 'camchain.yaml', CHAIN)))


def test_the_distortion_model_is_that_of_ros(tmp_path):
    left = load(text_file(tmp_path / 'camchain.yaml', CHAIN)).left
    assert (left.distortion_model, left.d) == ('plumb_bob', (-0.1, 0.02, 0.001, 0, 0))
    intrinsic = {'K1': K1, 'D1': D1, 'K2': K2, 'D2': np.r_[D2, 0.01, 0, 0], 'R': R, 'T': T}
    found = load(opencv_file(tmp_path / 'stereo.yml', **intrinsic))
    assert (found.left.distortion_model, found.left.d) == ('plumb_bob', tuple(D1))
    assert (found.right.distortion_model, len(found.right.d)) == ('rational_polynomial', 8)


def test_kalibr_fisheye_is_rectified(tmp_path):
    text = re.sub(r'distortion_coeffs: .*', 'distortion_coeffs: [0.01, 0, 0, 0]', CHAIN)
    calibration = load(text_file(tmp_path / 'chain.yaml', text.replace('radtan', 'equidistant')))
    assert calibration.left.distortion_model == 'equidistant'
    assert calibration.camera.baseline_m == pytest.approx(np.linalg.norm(T))


@pytest.mark.parametrize(('model', 'fx'), [('none', 500), ('equidistant', 463)])
def test_parallel_cameras_are_not_turned(tmp_path, model, fx):
    text = CHAIN.replace('radtan', model).replace('505.0, 506.0', '500.0, 501.0')
    text = re.sub(r'distortion_coeffs: .*', 'distortion_coeffs: [0, 0, 0, 0]', text)
    text = re.sub(r'(?<=T_cn_cnm1:\n)(  - .*\n){4}', PARALLEL, text)
    calibration = load(text_file(tmp_path / 'camchain.yaml', text))
    assert calibration.camera.fx == pytest.approx(fx, rel=0.02)
    assert calibration.camera.baseline_m == pytest.approx(0.2)
    assert calibration.left.r == pytest.approx(np.eye(3).ravel())


def test_both_sides_may_come_from_one_file(tmp_path):
    path = text_file(tmp_path / 'camchain.yaml', CHAIN)
    assert_is_the_camera(load(path, path))


def test_euroc_sensors_are_rectified(tmp_path):
    left = SENSOR.replace('POSE', str(np.eye(4).ravel().tolist()))
    pose = np.linalg.inv(np.vstack((np.c_[R, T], [0, 0, 0, 1])))
    right = SENSOR.replace('POSE', str(pose.ravel().tolist()))
    right = right.replace('[500.0, 501.0, 320.0, 240.0]', '[505.0, 506.0, 322.0, 238.0]')
    right = right.replace('[-0.1, 0.02, 0.001, 0]', '[-0.12, 0.03, 0, 0.001]')
    files = [text_file(tmp_path / f'{n}.yaml', text) for n, text in enumerate((left, right))]
    assert_is_the_camera(load(*files))


def test_exchanged_sensors_of_euroc_are_named(tmp_path):
    poses = np.eye(4), np.eye(4)
    poses[0][0, 3] = 0.1
    texts = [SENSOR.replace('POSE', str(pose.ravel().tolist())) for pose in poses]
    files = [text_file(tmp_path / f'{n}.yaml', text) for n, text in enumerate(texts)]
    with pytest.raises(CameraError, match='the second sensor lies left of the first sensor: exp'):
        load(*files)
    assert load(*reversed(files)).camera.baseline_m == pytest.approx(0.1)


def test_kitti_has_a_grey_and_a_colour_pair(tmp_path):
    path = text_file(tmp_path / 'calib.txt', KITTI)
    grey = load(path, size=(1226, 370)).camera
    assert (grey.width, grey.height) == (1226, 370)
    assert (grey.fx, grey.cx, grey.cy) == (707.0912, 601.8873, 183.1104)
    assert grey.baseline_m == pytest.approx(0.53715, abs=1e-5)
    for images in ('kitti/image_2/000000.png', 'image_02/data/0.png', '/stereo/left_color/image'):
        colour = load(path, images=images, size=(1226, 370)).camera
        assert colour.fx == 700
        assert colour.baseline_m == pytest.approx(0.5409, abs=1e-3)


def test_kitti_raw_recordings_name_the_projection_differently(tmp_path):
    text = 'S_rect_00: 1.2e+03 3.7e+02\n' + KITTI.replace('P', 'P_rect_0')
    camera = load(text_file(tmp_path / 'calib_cam_to_cam.txt', text), size=(1, 1)).camera
    assert (camera.width, camera.height, camera.fx) == (1200, 370, 707.0912)


def test_numbers_replace_those_of_any_file(tmp_path):
    path = opencv_file(tmp_path / 'stereo.yml', K1=K1, D1=D1, K2=K2, D2=D2, R=R, T=1000 * T)
    with pytest.raises(CameraError, match=r'stereo\.yml: the baseline is 120\.\d+ m.*in another'):
        load(path)
    request = CalibrationRequest((path,), CameraNumbers(baseline_m=0.12))
    assert request.calibration(lambda: SIZE, '').camera.baseline_m == pytest.approx(0.12)


@pytest.mark.parametrize(
    ('name', 'text', 'words'),
    [
        ('chain.yaml', CHAIN.replace('cam1', 'cam2'), 'cam1 is missing: expected cam0 and cam1'),
        ('chain.yaml', 'cam0: 3', 'cam0 is 3: expected intrinsics, resolution, ...'),
        ('chain.yaml', f'cam0: {[1] * 999}', 'cam0 is [1, 1, 1, 1, 1, 1, ...]: expected'),
        ('chain.yaml', CHAIN.replace(', -0.12]', ', 0.12]'), 'cam1 lies left of cam0: expected '),
        ('chain.yaml', CHAIN.replace('500.0, 501', '501'), 'cam0: intrinsics has 3 numbers: exp'),
        ('chain.yaml', CHAIN.replace('pinhole', 'omni'), "cam0: camera_model is 'omni': expected"),
        ('chain.yaml', CHAIN.replace('T_cn', 'T_no'), 'cam1: T_cn_cnm1 is missing: expected 16'),
        ('chain.yaml', CHAIN.replace('- [0.9', '- [9.9'), 'expected a rotation'),
        ('chain.yaml', CHAIN.replace('radtan', 'fov'), "distortion_model is 'fov': expected one"),
        ('chain.yaml', CHAIN.replace('[640', '[x'), 'resolution contains a value that is not a f'),
        ('chain.yaml', CHAIN.replace('[640', '[641', 1), 'left camera is 641 x 480, the right on'),
        (
            'chain.yaml',
            CHAIN.replace('[500', '[0'),
            'left camera has a focal length of 0: expected more',
        ),
        ('sensor.yaml', SENSOR, 'is the EuRoC calibration of one camera: expected both'),
        ('calib.txt', KITTI.replace('P1', 'P4'), 'P1 is missing: expected 12 numbers'),
        ('calib.txt', KITTI.replace('P0: 7', 'P0: much 7'), 'P0 contains a value that is not a f'),
        ('calib.txt', KITTI.replace('P0: 7.070912e+02', 'P0: 0'), 'focal length of 0'),
        (
            'stereo.yml',
            '%YAML:1.0\n---\nK1: 3\n',
            'lacks D1, K2, D2, R, T: expected K1 (or M1), D1, K2',
        ),
        ('stereo.yml', '%YAML:1.0\n---\nK1: !!opencv-matrix\n   rows: 3\n', 'lacks D1, K2'),
        ('stereo.yml', '%YAML:1.0\n---\nK1: [1, 2\n', 'cv2.FileStorage: '),
        (
            'stereo.xml',
            '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aa">]><x><K1>&a;</K1></x>',
            'no declarations',
        ),
        ('stereo.xml', '<?xml version="1.0"?>\n<opencv_storage>\n<K1', 'cv2.FileStorage'),
        ('words.yaml', 'some: thing', 'is not a calibration: expected a ROS (image_width, ...)'),
        ('words.yaml', 'a line', 'is not a calibration: expected'),
        ('empty.yaml', '', 'is not a calibration: expected'),
        ('left.yaml', 'image_width: 3', 'is the ROS calibration of one camera: expected both'),
        ('large.yaml', 'a' * 300_000, 'has more than 250000 bytes'),
    ],
)
def test_an_error_names_the_file_and_what_was_expected(tmp_path, name, text, words):
    path = text_file(tmp_path / name, text)
    with pytest.raises(CameraError) as caught:
        load(path)
    assert str(caught.value).startswith(f'{path}: ')
    assert words in str(caught.value)
    assert '\n' not in str(caught.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(CameraError, match=r'none\.yaml: no such calibration file'):
        load(tmp_path / 'none.yaml')
