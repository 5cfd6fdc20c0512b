import json
import re
from dataclasses import asdict
from pathlib import Path

import cv2
import numpy as np
import pytest
from hand_made import CAMERA, stereo_images, write_calibration

from rover_obstacle_detection.cli.main import main
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.messages.calibration import load_camera_info
from rover_obstacle_detection.messages.rectification import Rectification
from rover_obstacle_detection.offline.picture_files import PICTURE_NAMES


@pytest.fixture
def files(tmp_path):
    left, right = stereo_images()
    cv2.imwrite(str(tmp_path / 'left.png'), left)
    cv2.imwrite(str(tmp_path / 'right.png'), right)
    write_calibration(tmp_path)
    return tmp_path


def _detect(folder, *options):
    return main(
        [
            'detect',
            str(folder / 'left.png'),
            str(folder / 'right.png'),
            '--left-info',
            str(folder / 'left.yaml'),
            '--right-info',
            str(folder / 'right.yaml'),
            '-o',
            str(folder / 'out'),
            *options,
        ]
    )


def test_files_and_table_match_the_detection(files, capsys):
    assert _detect(files) == 0
    output = files / 'out'
    names = {'mask.png', 'points.ply', 'summary.json', *(f'{name}.png' for name in PICTURE_NAMES)}
    assert {path.name for path in output.iterdir()} == names
    detection = Detector(CAMERA).detect(*stereo_images())
    mask = cv2.imread(str(output / 'mask.png'), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(mask, detection.mask)
    points = len(detection.obstacle_points) + len(detection.ground_points)
    assert f'element vertex {points}\n'.encode() in (output / 'points.ply').read_bytes()

    summary = json.loads((output / 'summary.json').read_text())
    assert summary['obstacles'] == len(detection.obstacles) == len(summary['obstacle_list'])
    largest, listed = detection.obstacles[0], summary['obstacle_list'][0]
    assert listed['pixels'] == largest.pixels
    assert listed['range_m'] == pytest.approx(largest.range_m)
    assert listed['minimum_m'] == pytest.approx(largest.minimum_m)
    assert listed['confidence'] == pytest.approx(largest.confidence)
    assert listed['kind'] == largest.kind == 'rock'
    assert summary['obstacle_kinds'] == {'rock': len(detection.obstacles)}
    assert summary['calibration'] == f'{files}/left.yaml and {files}/right.yaml'
    assert summary['camera']['fx'] == pytest.approx(CAMERA.fx)
    assert summary['stage_ms']
    documentation = (Path(__file__).parents[2] / 'docs' / 'replay.md').read_text()
    for key in [*summary, *listed]:
        assert f'`{key}`' in documentation, key

    table = capsys.readouterr().out
    assert len(detection.obstacles) == 1
    assert re.search(r'^1 obstacle *$', table, re.MULTILINE)
    assert re.search(rf'│ rock +│ +{largest.range_m:.2f} │ +{largest.max_height_m:.2f} │', table)
    assert re.search(rf'│ +{largest.confidence:.2f} │ +{largest.pixels} │', table)
    assert f'{largest.left} {largest.top} {largest.width} {largest.height}' in table
    ground = detection.ground
    assert f'\nground: {ground.height_m:.2f} m below the camera, which looks down by ' in table
    assert f' {ground.pitch_deg:.0f} deg; if that is wrong, check the calibration\n' in table


def test_the_overlay_of_colour_images_is_in_colour(files):
    left, right = (np.dstack((image, image // 2, image // 4)) for image in stereo_images())
    cv2.imwrite(str(files / 'left.png'), left)
    cv2.imwrite(str(files / 'right.png'), right)
    assert _detect(files) == 0
    overlay = cv2.imread(str(files / 'out' / 'overlay.png'))[: CAMERA.height]
    mask = cv2.imread(str(files / 'out' / 'mask.png'), cv2.IMREAD_UNCHANGED)
    kept = (overlay == left).all(axis=2)
    assert kept[mask == 0].mean() > 0.5


def test_method_and_parameters_can_be_set(files):
    assert _detect(files, '--method', 'study', '--set', 'study_max_step=0.02') == 0
    parameters = json.loads((files / 'out' / 'summary.json').read_text())['parameters']
    assert parameters['method'] == 'study'
    assert parameters['study_max_step'] == 0.02


def _distort(folder):
    """Bend the lenses of the calibration files, and keep the focal length of the raw images."""
    for side in ('left', 'right'):
        path = folder / f'{side}.yaml'
        path.write_text(
            re.sub(r'(distortion_coefficients: .*data: )\[.*?\]', DISTORTED, path.read_text())
        )


DISTORTED = r'\1[-0.2, 0.05, 0, 0, 0]'


def test_distortion_is_named_and_raw_images_are_rectified(files, capsys):
    _distort(files)
    assert _detect(files) == 0
    assert re.search(r'WARNING: .*distortion.*left\.yaml and .*--raw', capsys.readouterr().err)
    assert _detect(files, '--raw', '--force') == 0
    assert 'distortion' not in capsys.readouterr().err
    rectified = [
        Rectification(load_camera_info(files / f'{side}.yaml'), side)(image)
        for side, image in zip(('left', 'right'), stereo_images(), strict=True)
    ]
    assert not np.array_equal(rectified[0], stereo_images()[0])
    mask = cv2.imread(str(files / 'out' / 'mask.png'), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(mask, Detector(CAMERA).detect(*rectified).mask)


def test_raw_without_a_distortion_is_a_warning(files, capsys):
    assert _detect(files, '--raw') == 0
    warning = (
        '--raw: no distortion or rotation in {0}/left.yaml and {0}/right.yaml: nothing is rec'
    )
    assert warning.format(files) in capsys.readouterr().err
    _detect_with(files, '--fx', CAMERA.fx, '--baseline', CAMERA.baseline_m, '--raw', '--force')
    assert '--raw: no distortion or rotation in --fx 207' in capsys.readouterr().err


def _detect_with(folder, *options):
    images = [str(folder / f'{side}.png') for side in ('left', 'right')]
    assert main(['detect', *images, '-o', str(folder / 'out'), *map(str, options)]) == 0
    mask = cv2.imread(str(folder / 'out' / 'mask.png'), cv2.IMREAD_UNCHANGED)
    return mask, json.loads((folder / 'out' / 'summary.json').read_text())['camera']


def test_numbers_are_as_good_as_files(files):
    numbers = ('--fx', CAMERA.fx, '--fy', CAMERA.fy, '--cx', CAMERA.cx, '--cy', CAMERA.cy)
    mask, camera = _detect_with(files, *numbers, '--baseline', CAMERA.baseline_m)
    assert camera == pytest.approx(asdict(CAMERA))
    assert np.array_equal(mask, Detector(CAMERA).detect(*stereo_images()).mask)


def _kitti(folder):
    c = CAMERA
    lines = [
        f'P{side}: {c.fx} 0 {c.cx} {-side * c.fx * c.baseline_m} 0 {c.fy} {c.cy} 0 0 0 1 0\n'
        for side in (0, 1)
    ]
    (folder / 'calib.txt').write_text(''.join(lines))
    return folder / 'calib.txt'


def test_a_file_of_another_tool_is_as_good_as_two_of_ros(files):
    mask, camera = _detect_with(files, '--calibration', _kitti(files))
    assert camera == pytest.approx(asdict(CAMERA))
    assert np.array_equal(mask, Detector(CAMERA).detect(*stereo_images()).mask)


def test_calibrations_of_both_cameras_are_not_mixed(files, capsys):
    twice = ['--calibration', str(_kitti(files))] * 2
    images = [str(files / f'{side}.png') for side in ('left', 'right')]
    assert main(['detect', *images, '-o', str(files / 'out'), *twice]) == 1
    assert 'calib.txt: is a KITTI calibration and one of two files' in capsys.readouterr().err


def test_raw_images_are_rectified_with_a_file_of_opencv(files, capsys):
    size, distortion = (CAMERA.width, CAMERA.height), np.array([-0.1, 0.02, 0, 0, 0])
    k = np.array([[CAMERA.fx, 0, CAMERA.cx], [0, CAMERA.fy, CAMERA.cy], [0, 0, 1]])
    r, t = cv2.Rodrigues(np.array([0, 0.004, 0]))[0], np.array([[-CAMERA.baseline_m], [0], [0]])
    storage = cv2.FileStorage(str(files / 'stereo.yml'), cv2.FILE_STORAGE_WRITE)
    for name, value in zip(
        ('K1', 'D1', 'K2', 'D2', 'R', 'T'), (k, distortion, k, distortion, r, t), strict=True
    ):
        storage.write(name, value)
    storage.release()
    calibration = ('--calibration', files / 'stereo.yml')
    mask, camera = _detect_with(files, *calibration, '--raw')
    capsys.readouterr()
    _detect_with(files, *calibration, '--force')
    assert re.search(r'WARNING: .*distortion.*stereo\.yml.*--raw', capsys.readouterr().err)

    found = cv2.stereoRectify(
        k, distortion, k, distortion, size, r, t, flags=cv2.CALIB_ZERO_DISPARITY, alpha=0
    )
    for side, rotation, projection in zip(('left', 'right'), found[:2], found[2:4], strict=True):
        text = (files / f'{side}.yaml').read_text()
        for name, value in (
            ('distortion_coefficients', distortion),
            ('rectification_matrix', rotation),
            ('projection_matrix', projection),
        ):
            text = re.sub(rf'({name}: .*data: )\[.*?\]', rf'\1{np.ravel(value).tolist()}', text)
        (files / f'{side}.yaml').write_text(text)
    assert _detect(files, '--raw', '--force') == 0
    expected = json.loads((files / 'out' / 'summary.json').read_text())['camera']
    assert camera == pytest.approx(expected)
    same = cv2.imread(str(files / 'out' / 'mask.png'), cv2.IMREAD_UNCHANGED)
    assert mask.any()
    assert np.array_equal(mask, same)


def test_both_views_may_be_side_by_side(files, capsys):
    cv2.imwrite(str(files / 'both.png'), np.hstack(stereo_images()))
    arguments = ['detect', str(files / 'both.png'), '--side-by-side', '-o', str(files / 'out')]
    arguments += ['--calibration', str(_kitti(files))]
    assert main(arguments) == 0
    mask = cv2.imread(str(files / 'out' / 'mask.png'), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(mask, Detector(CAMERA).detect(*stereo_images()).mask)
    cv2.imwrite(str(files / 'both.png'), stereo_images()[0][:, 1:])
    capsys.readouterr()
    assert main([*arguments, '--force']) == 1
    assert f'both.png: width is {CAMERA.width - 1}: expected an even' in capsys.readouterr().err


def test_numbers_replace_those_of_files(files):
    infos = ('--left-info', files / 'left.yaml', '--right-info', files / 'right.yaml')
    _, camera = _detect_with(files, *infos, '--baseline', 0.13)
    assert camera == pytest.approx({**asdict(CAMERA), 'baseline_m': 0.13})


def test_existing_output_needs_force(files, capsys):
    (files / 'out').mkdir()
    (files / 'out' / 'notes.txt').write_text('mine')
    assert _detect(files) == 1
    assert 'give --force' in capsys.readouterr().err
    assert [path.name for path in (files / 'out').iterdir()] == ['notes.txt']
    assert _detect(files, '--force') == 0
    assert (files / 'out' / 'notes.txt').read_text() == 'mine'
    assert (files / 'out' / 'mask.png').exists()


def _remove(name):
    return lambda folder: (folder / name).unlink()


def _write(name, data):
    return lambda folder: (folder / name).write_bytes(data)


def _cut_short(folder):
    path = folder / 'left.png'
    path.write_bytes(path.read_bytes()[:500])


def _smaller(folder):
    cv2.imwrite(str(folder / 'right.png'), stereo_images()[1][:200])


def _swap(folder):
    (folder / 'left.png').rename(folder / 'other.png')
    (folder / 'right.png').rename(folder / 'left.png')
    (folder / 'other.png').rename(folder / 'right.png')


def _negative_baseline(folder):
    text = (folder / 'right.yaml').read_text()
    (folder / 'right.yaml').write_text(text.replace(', -', ', '))


@pytest.mark.parametrize(
    ('spoil', 'complaint'),
    [
        (_remove('left.png'), r'left\.png: .*No such file'),
        (_write('left.png', b''), r'left\.png: data is empty'),
        (_write('right.png', b'hello'), r'right\.png: data .* an image'),
        (_cut_short, r'left\.png: .*cut short'),
        (_smaller, r'right\.png.*320 x 200|right\.png.*200'),
        (_swap, r'left\.png, .*right\.png: .*are left and right swapped'),
        (_remove('right.yaml'), r'right\.yaml: no such calibration file'),
        (_write('left.yaml', b'nonsense'), r'left\.yaml: is not a calibration: expected a ROS'),
        (_negative_baseline, r'right\.yaml.*baseline is -'),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(files, spoil, complaint, capsys):
    spoil(files)
    assert _detect(files) == 1
    error = capsys.readouterr().err
    assert error.count('\n') == 1
    assert re.search(complaint, error), error
    assert not (files / 'out').exists()


def test_a_parameter_without_effect_is_named(files, capsys):
    assert _detect(files, '--set', 'camera_pitch=30') == 0
    assert (
        "camera_pitch will have no effect, since gravity_source is 'est" in capsys.readouterr().err
    )
