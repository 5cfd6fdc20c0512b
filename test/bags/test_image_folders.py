import json
import logging
import os

import cv2
import numpy as np
import pytest
from hand_made import CAMERA, stereo_images
from recordings import HEIGHT, WIDTH, pixels

from rover_obstacle_detection.bags import image_layouts
from rover_obstacle_detection.bags.decompression import MAX_BYTES
from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.bags.stereo import BadFrame, read_pairs
from rover_obstacle_detection.calibration_files.numbers import CameraNumbers
from rover_obstacle_detection.calibration_files.request import CalibrationRequest
from rover_obstacle_detection.cli.main import main
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.errors import BagError
from rover_obstacle_detection.messages.image import decode_image

START_NS = 1_403_636_579_763_555_584
SECOND_NS = 10**9
SENSOR = """\
T_BS:
  cols: 4
  rows: 4
  data: [1, 0, 0, X, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
resolution: [32, 24]
camera_model: pinhole
intrinsics: [40, 40, 15.5, 11.5]
distortion_model: radial-tangential
distortion_coefficients: [0.1, 0, 0, 0]
"""
KITTI = """\
P0: 40 0 15.5 0 0 40 11.5 0 0 0 1 0
P1: 40 0 15.5 -4 0 40 11.5 0 0 0 1 0
P2: 50 0 15.5 1 0 50 11.5 0 0 0 1 0
P3: 50 0 15.5 -4 0 50 11.5 0 0 0 1 0
"""
NUMBERS = CalibrationRequest(numbers=CameraNumbers(fx=40.0, baseline_m=0.1))


def write_images(root, folders, names, suffix='.png'):
    for folder, side in zip(folders, ('left', 'right'), strict=True):
        (root / folder).mkdir(parents=True, exist_ok=True)
        for number, name in enumerate(names):
            cv2.imwrite(str(root / folder / f'{name}{suffix}'), pixels(number, side))


def euroc(root, count=2):
    names = [START_NS + number * 50_000_000 for number in range(count)]
    write_images(root / 'mav0', ('cam0/data', 'cam1/data'), names)
    for camera, x in (('cam0', '0'), ('cam1', '0.1')):
        lines = [f'{name},{name}.png\n' for name in names]
        (root / 'mav0' / camera / 'data.csv').write_text('#timestamp [ns],file\n' + ''.join(lines))
        (root / 'mav0' / camera / 'sensor.yaml').write_text(SENSOR.replace('X', x))
    return root


def kitti_odometry(root, numbers=(0, 1)):
    folders = [f'image_{number}' for number in numbers]
    write_images(root, folders, ('000000', '000001'))
    (root / 'times.txt').write_text('0.000000e+00\n1.036224e-01\n')
    (root / 'calib.txt').write_text(KITTI)
    return root


def kitti_raw(root):
    write_images(root / 'drive', ('image_00/data', 'image_01/data'), ('0000000000', '0000000001'))
    (root / 'drive' / 'image_00' / 'timestamps.txt').write_text(
        '2011-09-26 13:02:25.964389445\n2011-09-26 13:02:26.074343445\n'
    )
    (root / 'calib_cam_to_cam.txt').write_text(KITTI.replace('P', 'P_rect_0'))
    return root / 'drive'


def read(path, calibration=None, **topics):
    with open_bag(path) as bag:
        found = bag.stereo_topics(**topics)
        return list(read_pairs(bag, found, calibration=calibration))


def stamps(pairs):
    return [pair.stamp_ns for pair in pairs]


def numbers_only(path):
    return read(path, NUMBERS.calibration(lambda: (WIDTH, HEIGHT), ''))


def assert_images(pairs):
    for number, pair in enumerate(pairs):
        assert np.array_equal(pair.left, pixels(number, 'left'))
        assert np.array_equal(pair.right, pixels(number, 'right'))


def test_euroc_is_read_and_rectified_with_its_sensors(tmp_path):
    for path in (euroc(tmp_path), tmp_path / 'mav0'):
        pairs = read(path)
        assert stamps(pairs) == [START_NS, START_NS + 50_000_000]
        assert pairs[0].camera.baseline_m == pytest.approx(0.1)
        assert not np.array_equal(pairs[0].left, pixels(0, 'left'))


def test_euroc_without_its_files_has_the_stamps_of_its_names(tmp_path):
    euroc(tmp_path)
    for each in [*tmp_path.rglob('*.csv'), *tmp_path.rglob('*.yaml')]:
        each.unlink()
    pairs = numbers_only(tmp_path)
    assert stamps(pairs) == [START_NS, START_NS + 50_000_000]
    assert_images(pairs)
    with pytest.raises(
        BagError, match='no calibration beside the images: expected one given with --fx'
    ):
        read(tmp_path)


def test_a_listed_image_that_is_missing_is_a_bad_frame(tmp_path):
    (euroc(tmp_path, 3) / 'mav0' / 'cam1' / 'data' / f'{START_NS}.png').unlink()
    bad, *good = read(tmp_path)
    assert isinstance(bad, BadFrame)
    assert bad.topic == '/stereo/right/image/compressed'
    file = tmp_path / 'mav0' / 'cam1' / 'data' / f'{START_NS}.png'
    assert bad.reason == f'{file}: cannot be read: No such file or directory'
    assert len(good) == 2


def test_kitti_odometry_is_read_with_its_calibration(tmp_path):
    pairs = read(kitti_odometry(tmp_path))
    assert stamps(pairs) == [SECOND_NS, SECOND_NS + 103_622_400]
    assert_images(pairs)
    camera = pairs[0].camera
    assert (camera.width, camera.fx, camera.baseline_m) == (WIDTH, 40, pytest.approx(0.1))


def test_kitti_has_a_colour_camera_too(tmp_path):
    only = read(kitti_odometry(tmp_path / 'colour', (2, 3)))
    kitti_odometry(tmp_path / 'both')
    both = kitti_odometry(tmp_path / 'both', (2, 3))
    given = read(both, left_image='/stereo/left_color/image_rect/compressed')
    assert [each[0].camera.fx for each in (only, given, read(both))] == [50, 50, 40]


def test_kitti_raw_is_read_with_the_calibration_of_its_day(tmp_path):
    pairs = read(kitti_raw(tmp_path))
    first_ns = 1_317_042_145_964_389_445
    assert stamps(pairs) == [first_ns, first_ns + 109_954_000]
    assert_images(pairs)
    assert pairs[0].camera.fx == 40


@pytest.mark.parametrize(
    ('names', 'expected'),
    [
        ((START_NS, START_NS + 5), [START_NS, START_NS + 5]),
        (('1700000000', '1700000001'), [1_700_000_000 * SECOND_NS, 1_700_000_001 * SECOND_NS]),
        (
            ('1700000000.05', '1700000000.1'),
            [1_700_000_000_050_000_000, 1_700_000_000_100_000_000],
        ),
    ],
)
def test_left_and_right_have_the_stamps_of_their_names(tmp_path, caplog, names, expected):
    write_images(tmp_path, ('left', 'right'), names, '.pgm')
    with caplog.at_level(logging.WARNING):
        pairs = numbers_only(tmp_path)
    assert stamps(pairs) == expected
    assert_images(pairs)
    assert not caplog.records


@pytest.mark.parametrize(
    'names',
    [
        ('000000', '000001'),
        ('rock', 'wall'),
        # Beyond the seconds that a stamp can have.
        ('3000000000', '3000000001'),
        ('3000000000.5', '3000000001.5'),
        ('3000000000000000000', '3000000000000000001'),
    ],
)
def test_other_names_are_ten_images_per_second(tmp_path, caplog, names):
    write_images(tmp_path, ('left', 'right'), names)
    pairs = numbers_only(tmp_path)
    assert stamps(pairs) == [SECOND_NS, SECOND_NS + 100_000_000]
    (record,) = caplog.records
    assert f'{tmp_path}: the names of the images are no stamps' in record.getMessage()


def test_names_may_say_left_and_right(tmp_path):
    (tmp_path / 'left').mkdir()
    (tmp_path / 'right').mkdir()
    for number, name in enumerate(('9', '10')):
        for side in ('left', 'right'):
            cv2.imwrite(str(tmp_path / side / f'{side}_{name}.png'), pixels(number, side))
    pairs = numbers_only(tmp_path)
    assert_images(pairs)
    assert stamps(pairs) == [10**9, 11 * 10**8]


def test_names_of_nothing_in_common_are_refused(tmp_path):
    write_images(tmp_path, ('left', 'other'), ('a',))
    write_images(tmp_path, ('other', 'right'), ('b',))
    with pytest.raises(
        BagError, match=r'left and .*right: no image is on both sides, as by a\.png'
    ):
        numbers_only(tmp_path)


def test_times_that_begin_at_0_are_shifted(tmp_path):
    write_images(tmp_path, ('left', 'right'), ('0.00', '0.50'))
    assert stamps(numbers_only(tmp_path)) == [10**9, 15 * 10**8]


def test_times_before_0_are_shifted(tmp_path):
    (kitti_odometry(tmp_path) / 'times.txt').write_text('-5\n1\n')
    assert stamps(read(tmp_path)) == [10**9, 7 * 10**9]


def test_an_image_without_partner_is_counted(tmp_path):
    write_images(tmp_path, ('left', 'right'), ('a', 'b', 'c'))
    (tmp_path / 'right' / 'b.png').unlink()
    (tmp_path / 'right' / 'c.png').write_bytes(b'')
    with open_bag(tmp_path) as bag:
        calibration = NUMBERS.calibration(lambda: (WIDTH, HEIGHT), '')
        pairs = read_pairs(bag, bag.stereo_topics(), calibration=calibration)
        good, bad = pairs
    assert good.stamp_ns == SECOND_NS
    assert 'data is empty' in bad.reason
    assert (pairs.statistics.left, pairs.statistics.right, pairs.statistics.pairs) == (3, 2, 2)


def test_bad_and_lone_images_are_named_by_their_files(tmp_path, caplog):
    write_images(tmp_path, ('left', 'right'), 'abcdef')
    left, right = tmp_path / 'left', tmp_path / 'right'
    (left / 'b.png').write_bytes(b'no image')
    (right / 'c.png').write_bytes((right / 'c.png').read_bytes()[:40])
    cv2.imwrite(str(right / 'd.png'), pixels(0, 'right')[:-8])
    (left / 'e.png').unlink()
    (left / 'e.png').symlink_to(tmp_path / 'nothing.png')
    (right / 'f.png').unlink()
    good, *bad = numbers_only(tmp_path)
    assert good.names == (str(left / 'a.png'), str(right / 'a.png'))
    reasons = [each.reason for each in bad]
    for reason, start in zip(
        reasons,
        (
            f'{left / "b.png"}: data cannot be decoded as an image',
            f'{right / "c.png"}: data is a PNG file of 40 bytes cut short',
            f'{right / "d.png"} is {WIDTH} x {HEIGHT - 8}, {left / "d.png"} is {WIDTH} x ',
            f'{left / "e.png"}: cannot be read: No such file or directory',
        ),
        strict=True,
    ):
        assert reason.startswith(start)
    assert (f'no partner for {right / "e.png"}, {left / "f.png"}') in [
        record.getMessage() for record in caplog.records
    ]


def test_only_the_first_lone_images_are_listed(tmp_path, caplog):
    write_images(tmp_path, ('left', 'right'), 'abcdefgh')
    for name in 'bcdefgh':
        (tmp_path / 'right' / f'{name}.png').unlink()
    assert len(numbers_only(tmp_path)) == 1
    *_, record = caplog.records
    assert record.getMessage().endswith(f'{tmp_path}/left/f.png and 2 others')


def test_pairs_that_do_not_fit_the_calibration_are_named_by_their_files(tmp_path):
    write_images(tmp_path, ('left', 'right'), 'ab')
    for side in ('left', 'right'):
        cv2.imwrite(str(tmp_path / side / 'b.png'), pixels(0, side)[:-8])
    _, bad = numbers_only(tmp_path)
    assert bad.reason.startswith(f'{tmp_path}/left/b.png and {tmp_path}/right/b.png are {WIDTH} x')


def test_images_have_a_wire_format(tmp_path):
    with open_bag(kitti_odometry(tmp_path)) as bag:
        messages = list(bag.serialized_messages(['/stereo/left/camera_info']))
        assert [(topic, stamp) for topic, stamp, _ in messages] == [
            ('/stereo/left/camera_info', SECOND_NS)
        ]
        assert len(messages[0][2]) > 8 * (9 + 9 + 12)


@pytest.mark.parametrize(
    ('file', 'text', 'words'),
    [
        ('euroc/mav0/cam0/data.csv', 'x,y.png\n', 'data.csv: expected lines of a stamp in ns'),
        ('euroc/mav0/cam0/data.csv', '5,y.png\n', f'no stamp for {START_NS}.png and 1 other'),
        ('euroc/mav0/cam1/sensor.yaml', 'T_BS: 3\n', 'sensor.yaml: right: T_BS has 1 number:'),
        ('kitti/times.txt', '0.5\n', 'times.txt: has 1 time: expected one for 000001.png'),
        ('kitti/times.txt', 'noon\n', "times.txt: 'noon': expected seconds or a date and time"),
        ('kitti/calib.txt', 'P0: 3\n', 'calib.txt: P0 has 1 number: expected 12'),
        ('euroc/mav0/cam0/data.csv', f'1,{"x" * 200_000}', 'data.csv: expected lines of a stamp'),
        ('euroc/mav0/cam0/data.csv', f'{10**30},y.png\n', f'{10**30} ns: expected at most 21'),
        ('kitti/times.txt', '3e9\n', 'times.txt: 3000000000000000000 ns: expected at most 2147'),
    ],
)
def test_a_damaged_file_is_named(tmp_path, file, text, words):
    euroc(tmp_path / 'euroc')
    kitti_odometry(tmp_path / 'kitti')
    (tmp_path / file).write_text(text)
    with pytest.raises(BagError) as caught:
        read(tmp_path / file.split('/')[0])
    assert words in str(caught.value)
    assert '\n' not in str(caught.value)
    assert 'Error:' not in str(caught.value)


def test_a_table_of_stamps_is_read_at_bounded_cost(tmp_path, monkeypatch):
    monkeypatch.setattr(image_layouts, 'MAX_TABLE_BYTES', 20)
    with pytest.raises(BagError, match=r'times.txt: has more than 20 bytes: expected a file of'):
        read(kitti_odometry(tmp_path))


def test_an_image_is_read_at_bounded_cost(tmp_path):
    write_images(tmp_path, ('left', 'right'), ('a', 'b'))
    with (tmp_path / 'left' / 'a.png').open('r+b') as file:
        file.truncate(2 * MAX_BYTES)
    bad, _ = numbers_only(tmp_path)
    assert bad.reason.endswith(f'/a.png: has more than {MAX_BYTES} bytes: expected an image')


def test_a_name_need_not_be_text(tmp_path):
    name = os.fsdecode(b'\xff')
    write_images(tmp_path, ('left', 'right'), ('0',))
    for side in ('left', 'right'):
        (tmp_path / side / '0.png').rename(tmp_path / side / f'{name}.png')
    assert_images(numbers_only(tmp_path))


def test_folders_without_images_are_refused(tmp_path):
    write_images(tmp_path, ('left', 'right'), ())
    with pytest.raises(BagError, match=r'no images in .*left, .*right'):
        read(tmp_path)
    (tmp_path / 'right').rmdir()
    with pytest.raises(BagError, match=r'no images of a known layout: EuRoC .*KITTI .*left and r'):
        read(tmp_path)


def test_a_folder_of_images_is_replayed_as_a_bag_is(tmp_path, capsys):
    for side, image in zip(('left', 'right'), stereo_images(), strict=True):
        (tmp_path / 'in' / side).mkdir(parents=True)
        cv2.imwrite(str(tmp_path / 'in' / side / f'{START_NS}.png'), image)
    arguments = ['replay', str(tmp_path / 'in'), '-o', str(tmp_path / 'out')]
    assert main(arguments) == 1
    assert '--fx or --hfov, --baseline, or --calibration' in capsys.readouterr().err
    numbers = [f'--{each}={getattr(CAMERA, each)}' for each in ('fx', 'fy', 'cx', 'cy')]
    assert main([*arguments, *numbers, f'--baseline={CAMERA.baseline_m}']) == 0
    summary = json.loads((tmp_path / 'out' / 'summary.json').read_text())
    assert summary['counts']['detected'] == 1
    assert summary['topics']['left_image'] == '/stereo/left/image/compressed'
    with open_bag(tmp_path / 'out' / 'detections') as bag:
        ((_, stamp, mask),) = bag.messages(['/stereo/obstacle_mask'])
    assert stamp == START_NS
    expected = Detector(CAMERA).detect(*stereo_images()).mask
    assert np.array_equal(decode_image(mask, 'mask') > 0, expected > 0)
