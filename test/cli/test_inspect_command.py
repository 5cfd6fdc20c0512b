import json
import shlex

import cv2
import numpy as np
import pytest
from faulty_recordings import cut_short, other_topics
from hand_made import CAMERA, FIRST_STAMP_NS, SCENE, stereo_images, write_stereo_bag
from recordings import (
    IMAGE,
    INFO,
    ROS2,
    START_NS,
    Recorded,
    image,
    pixels,
    stereo_messages,
    write_ros2,
)
from synthetic import render

from rover_obstacle_detection.cli.main import main
from rover_obstacle_detection.messages.header import make_header


def views(count=3):
    """Pairs of one scene, each from another pitch."""
    rendered = [render(SCENE.with_(pitch_deg=46.0 + turn)) for turn in range(count)]
    return [(view.left, view.right) for view in rendered]


def changed(left=None, right=None):
    def same(array):
        return array

    return [((left or same)(one), (right or same)(other)) for one, other in views()]


def inspect(capsys, *arguments, status=0):
    """Run the command; return its text with the lines of each value joined."""
    assert main(['inspect', *map(str, arguments)]) == status
    out, err = capsys.readouterr()
    assert not err
    return ' '.join(out.replace('\\\n', '').split())


def as_json(capsys, *arguments, status=0):
    assert main(['inspect', '--json', *map(str, arguments)]) == status
    return json.loads(capsys.readouterr().out)


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    return write_stereo_bag(tmp_path_factory.mktemp('inspected') / 'drive', images=views())


def test_a_good_recording_is_described_in_80_columns(bag, capsys):
    assert main(['inspect', str(bag)]) == 0
    text = capsys.readouterr().out
    lines = [line for line in text.splitlines() if str(bag) not in line]
    assert max(map(len, lines)) <= 80
    text = ' '.join(text.replace('\\\n', '').split())
    assert 'length 0.2 s, 0.4 MB damage none gravity no IMU or TF topic' in text
    assert 'stereo camera /cam left /cam/left/image_rect Image mono8 320 x 240, 3 images' in text
    assert '10.0 Hz' in text
    assert 'synchronised equal stamps, 3 pairs' in text
    assert (
        'calibrated /cam/left/camera_info and /cam/right/camera_info; 320 x 240, baseline 0.06 m, '
        'focal length 207.8 px, field of view 75 x 60 deg, constant'
    ) in text
    assert 'rectified yes by name; rows off 0.0' in text
    assert 'warning' not in text
    assert 'missing' not in text
    assert text.endswith(
        f'can be replayed: rover-obstacles replay {bag} --output drive_detections'
    )


def test_the_same_as_json(bag, capsys):
    (found,) = as_json(capsys, bag)
    assert found['bag'] == str(bag)
    assert found['can_be_replayed']
    (camera,) = found['cameras']
    assert camera['topics'] == {
        'left_image': '/cam/left/image_rect',
        'right_image': '/cam/right/image_rect',
        'left_info': '/cam/left/camera_info',
        'right_info': '/cam/right/camera_info',
    }
    assert camera['left']['images'] == 3
    assert camera['left']['rate_hz'] == pytest.approx(10)
    assert camera['synchronisation']['equal_stamps'] == 3
    assert camera['calibration']['camera']['baseline_m'] == pytest.approx(CAMERA.baseline_m)
    assert len(camera['sample']['geometry']) == 3
    assert all(each['rows_off_px'] < 0.1 for each in camera['sample']['geometry'])
    assert camera['missing'] == camera['warnings'] == []


def test_all_that_is_missing_is_said_at_once(tmp_path, capsys):
    def spoil(index, side, message):
        message.encoding = 'yuv9'

    bag = write_stereo_bag(
        tmp_path / 'drive',
        images=views(),
        infos=False,
        right_delay_ns=50_000_000,
        change_image=spoil,
    )
    text = inspect(capsys, bag, status=1)
    assert (
        'missing left and right images show different moments: smallest stamp gap 50.000 '
    ) in text
    assert 'missing no calibration for /cam/left/image_rect (no camera_info topic)' in text
    assert (
        "missing no pair can be used: /cam/left/image_rect: encoding is 'yuv9': expected one of"
    ) in text
    assert '--left-info LEFT.yaml --right-info RIGHT.yaml' in text
    assert 'not yet; then:' in text


def test_unsynchronised_images_are_judged_one_by_one(tmp_path, capsys):
    images = changed(right=lambda each: each // 3)
    bag = write_stereo_bag(tmp_path / 'drive', images=images, right_delay_ns=50_000_000)
    text = inspect(capsys, bag, status=1)
    assert 'warning the right image is darker' in text
    assert 'rectified yes by name; not measured' in text
    assert 'too few matches' not in text


@pytest.mark.parametrize(
    ('name', 'rectify', 'words'),
    [
        ('image_rect', 'always', 'raw with --rectify always: replay rectifies them;'),
        ('image_raw', 'never', 'yes with --rectify never;'),
    ],
)
def test_what_is_said_of_raw_images_is_heeded_and_in_the_command(
    tmp_path, capsys, name, rectify, words
):
    def change(side, info):
        info.distortion_model = 'plumb_bob'
        info.d = np.array([-0.2, 0.05, 0, 0, 0], np.float64)

    bag = write_stereo_bag(tmp_path / 'drive', images=views(), name=name, change_info=change)
    (found,) = as_json(capsys, bag, '--rectify', rectify)
    (camera,) = found['cameras']
    assert camera['rectify'] == rectify
    assert camera['rectified_by_name'] == (name == 'image_rect')
    assert shlex.split(camera['command'])[-2:] == ['--rectify', rectify]
    assert f'rectified {words}' in inspect(capsys, bag, '--rectify', rectify)


def test_raw_images_that_nothing_rectifies_are_named(tmp_path, capsys):
    bag = write_stereo_bag(tmp_path / 'drive', images=views(), name='image_raw')
    assert (
        'rectified raw by name: used as they are, as the calibration has no distortion or '
        'rotation; rows off'
    ) in inspect(capsys, bag)


@pytest.mark.parametrize('name', ['image_rect', 'image_raw'])
def test_the_command_replays_cameras_that_need_a_tolerance(tmp_path, capsys, monkeypatch, name):
    bag = write_stereo_bag(tmp_path / 'drive', images=views(), right_delay_ns=2_500_000, name=name)
    (found,) = as_json(capsys, bag)
    (camera,) = found['cameras']
    assert camera['synchronisation']['smallest_gap_ms'] == pytest.approx(2.5)
    assert camera['rectified_by_name'] == (name == 'image_rect')
    command = shlex.split(camera['command'])
    assert command[-2:] == ['--approximate-sync', '0.003']
    monkeypatch.chdir(tmp_path)
    assert main(command[1:]) == 0
    summary = json.loads((tmp_path / 'drive_detections' / 'summary.json').read_text())
    assert summary['counts']['detected'] == 3


@pytest.mark.parametrize(
    ('images', 'words'),
    [
        ([(right, left) for left, right in views()], 'missing left and right images are swapped'),
        (
            changed(right=lambda each: np.roll(each, -9, axis=0)),
            'by rows: median 9.0 px: recalibrate missing no sampled pair can be judged: the right '
            'image is 9 rows higher than the left one',
        ),
    ],
)
def test_wrong_cameras_cannot_be_replayed(tmp_path, capsys, images, words):
    bag = write_stereo_bag(tmp_path / 'drive', pairs=1, images=images)
    assert words in inspect(capsys, bag, status=1)


@pytest.mark.parametrize(
    ('images', 'words'),
    [
        (
            changed(right=lambda each: each // 3),
            'warning the right image is darker: median grey',
        ),
        (
            changed(left=lambda each: cv2.GaussianBlur(each, (0, 0), 1)),
            'warning the left image is less sharp',
        ),
        (
            changed(*[lambda each: each // 20] * 2),
            'warning the left image is dark: median grey',
        ),
        (
            changed(*[lambda each: np.where(each > 130, 255, each).astype(np.uint8)] * 2),
            'of the right image is saturated',
        ),
        (
            changed(right=lambda each: np.roll(each, 2, axis=0)),
            'warning the right image is off by rows: median 2.0 px: recalibrate',
        ),
        (
            [stereo_images()],
            '/cam/left/image_rect: 2 of 3 images repeat the one before, byte for byte',
        ),
    ],
)
def test_doubtful_images_are_named(tmp_path, capsys, images, words):
    bag = write_stereo_bag(tmp_path / 'drive', images=images)
    assert words in inspect(capsys, bag)


def test_a_calibration_that_changes_is_named(tmp_path, capsys):
    count = iter(range(100))

    def drift(side, info):
        info.k[2] += next(count) // 4

    bag = write_stereo_bag(tmp_path / 'drive', images=views(), change_info=drift)
    text = inspect(capsys, bag)
    assert 'warning the calibration changes 2 times: the first one is shown' in text
    assert 'constant' not in text


def test_an_invalid_calibration_is_missing(tmp_path, capsys):
    def without_baseline(side, info):
        info.p[3] = 0

    bag = write_stereo_bag(tmp_path / 'drive', images=views(), change_info=without_baseline)
    text = inspect(capsys, bag, status=1)
    assert (
        'missing /cam/left/camera_info and /cam/right/camera_info: right camera_info: P[3] is '
        '0.0, so the baseline is'
    ) in text
    assert 'rectified yes by name; not measured' in text


def test_images_of_another_size_than_the_calibration_are_missing(tmp_path, capsys):
    small = [(left[:120, :160], right[:120, :160]) for left, right in views()]
    bag = write_stereo_bag(tmp_path / 'drive', images=small)
    assert (
        'missing no pair can be used: the images are 160 x 120, but the calibration is for '
        '320 x 240'
    ) in inspect(capsys, bag, status=1)


def test_a_damaged_recording_needs_salvage(tmp_path, capsys):
    file = write_stereo_bag(tmp_path / 'drive', images=views()) / 'drive.mcap'
    file.write_bytes(file.read_bytes()[:-1000])
    text = inspect(capsys, file)
    assert 'damage none' not in text
    assert 'drive.mcap: ' in text
    assert text.endswith('--output drive_detections --salvage')


def test_a_recording_that_shows_nothing_cannot_be_replayed(tmp_path, capsys):
    (bag,) = cut_short(tmp_path)
    (found,) = as_json(capsys, bag, status=1)
    (camera,) = found['cameras']
    assert camera['missing'] == [
        'no sampled pair can be judged: neither image shows any texture: check for a covered or '
        'fogged lens'
    ]


def test_a_recording_without_cameras_lists_its_topics(tmp_path, capsys):
    (bag,) = other_topics(tmp_path)
    text = inspect(capsys, bag, status=1)
    assert 'missing no stereo topics: the recording has' in text
    assert '--left-topic LEFT_TOPIC --right-topic RIGHT_TOPIC' in text


def test_every_camera_has_its_command(tmp_path, capsys):
    front = stereo_messages(namespace='/front')
    bag = write_ros2(tmp_path / 'drive', [*front, *stereo_messages(namespace='/rear')])
    (found,) = as_json(capsys, bag)
    commands = [shlex.split(camera['command']) for camera in found['cameras']]
    assert [command[-3:] for command in commands] == [
        [f'/{name}/left/image_rect', '--right-topic', f'/{name}/right/image_rect']
        for name in ('front', 'rear')
    ]
    (found,) = as_json(capsys, bag, '--left-topic', '/rear/left/image_rect')
    assert len(found['cameras']) == 1


def test_topics_of_any_name_can_be_given(tmp_path, capsys):
    messages = [
        each._replace(topic=each.topic.replace('left', 'port').replace('right', 'starboard'))
        for each in stereo_messages()
    ]
    bag = write_ros2(tmp_path / 'drive', messages)
    given = '--left-topic', '/stereo/port/image_rect'
    given += '--right-topic', '/stereo/starboard/image_rect'
    text = inspect(capsys, bag, *given)
    assert 'warning too few matches to measure the rectification' in text
    assert ' '.join(given) in text


def test_sources_of_gravity_are_listed(tmp_path, capsys):
    header = make_header(FIRST_STAMP_NS, 'imu', ROS2)
    imu = 'sensor_msgs/msg/Imu'
    messages = [Recorded('/imu/data', imu, ROS2.make(imu, header=header), FIRST_STAMP_NS)]
    bag = write_ros2(tmp_path / 'drive', [*stereo_messages(), *messages])
    (found,) = as_json(capsys, bag)
    assert found['gravity'] == {'/imu/data': 'imu'}


def test_a_recording_that_cannot_be_opened_does_not_stop_the_others(bag, tmp_path, capsys):
    assert main(['inspect', '--json', str(tmp_path / 'none'), str(bag)]) == 1
    out, err = capsys.readouterr()
    first, second = json.loads(out)
    assert first['error'] in err
    assert str(tmp_path / 'none') in first['error']
    assert second['can_be_replayed']


def test_bad_messages_are_counted(tmp_path, capsys):
    messages = stereo_messages()
    unstamped = image(np.zeros((24, 32), np.uint8), 0)
    messages.insert(0, Recorded('/stereo/left/image_rect', IMAGE, unstamped, START_NS))
    bag = write_ros2(tmp_path / 'drive', messages)
    assert (
        '/stereo/left/image_rect: bad messages: 1: header.stamp is 0 s: expected more than 0'
    ) in inspect(capsys, bag)


def test_only_images_of_one_side(tmp_path, capsys):
    messages = [
        each for each in stereo_messages() if each.type_name == INFO or 'left' in each.topic
    ]
    bag = write_ros2(tmp_path / 'drive', messages)
    text = inspect(capsys, bag, status=1)
    assert 'missing only left images: /stereo/left/image_rect' in text


def drift(count, right_period_ns):
    """Messages of two cameras that run freely."""
    return [
        Recorded(
            f'/stereo/{side}/image_rect', IMAGE, image(pixels(number, side), stamp_ns), stamp_ns
        )
        for number in range(count)
        for side, period_ns in (('left', 100_000_000), ('right', right_period_ns))
        for stamp_ns in [START_NS + 1 + number * period_ns]
    ]


def test_cameras_that_run_freely_are_not_synchronised(tmp_path, capsys):
    messages = sorted(drift(41, 107_300_000)[2:], key=lambda each: each.time_ns)
    text = inspect(capsys, write_ros2(tmp_path / 'drive', messages), status=1)
    assert 'missing left and right images show different moments: smallest stamp gap' in text
    assert 'approximate-sync' not in text


def test_lost_images_do_not_change_the_tolerance(tmp_path, capsys):
    messages = stereo_messages(9, gap_ns=1_500_000)
    kept = [
        each
        for index, each in enumerate(messages)
        if each.type_name == INFO or 'left' in each.topic or index % 8 == 2
    ]
    # The images are random: no pair of them can be judged.
    (found,) = as_json(capsys, write_ros2(tmp_path / 'drive', kept), status=1)
    (camera,) = found['cameras']
    assert camera['synchronisation']['approximate_sync_s'] == pytest.approx(0.002)
    assert camera['synchronisation']['median_gap_ms'] == pytest.approx(1.5)
    assert camera['left']['images'] == 9
    assert camera['right']['images'] == camera['synchronisation']['pairs'] < 9
    assert f'{9 - camera["right"]["images"]} images have no partner' in camera['warnings']


def test_images_that_cannot_be_decoded_are_named(tmp_path, capsys):
    def spoil(index, side, message):
        if index < 2 and side == 'right':
            message.encoding = 'rgb\x1b[31m'

    bag = write_stereo_bag(tmp_path / 'drive', images=views(), change_image=spoil)
    text = inspect(capsys, bag)
    assert 'warning 2 sampled pairs cannot be used: /cam/right/image_rect: encoding is' in text
    assert '\x1b' not in text
