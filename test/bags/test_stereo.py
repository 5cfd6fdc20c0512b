from __future__ import annotations

import itertools
import logging

import numpy as np
import pytest
from recordings import (
    FRAME_NS,
    HEIGHT,
    IMAGE,
    INFO,
    ROS1,
    ROS2,
    START_NS,
    WIDTH,
    WRITERS,
    Recorded,
    image,
    info,
    pixels,
    stereo_messages,
    write_ros2,
)

from rover_obstacle_detection.bags import stereo
from rover_obstacle_detection.bags.calibration_watch import CalibrationWatch
from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.bags.stereo import BadFrame, StereoPair, read_pairs
from rover_obstacle_detection.errors import BagError, CameraError
from rover_obstacle_detection.messages.calibration import CameraInfo, StereoCalibration
from rover_obstacle_detection.messages.header import stamp_ns
from rover_obstacle_detection.messages.image import decode_image
from rover_obstacle_detection.messages.rectification import Rectification

LEFT, RIGHT = '/stereo/left/image_rect', '/stereo/right/image_rect'
LEFT_INFO, RIGHT_INFO = '/stereo/left/camera_info', '/stereo/right/camera_info'


def stamp_of(number):
    return START_NS + number * FRAME_NS


def read(path, **options):
    """Read all pairs of a recording; return them and their reader."""
    with open_bag(path) as bag:
        pairs = read_pairs(bag, bag.stereo_topics(), **options)
        return list(pairs), pairs


def write(tmp_path, messages):
    return write_ros2(tmp_path / 'bag', messages)


def replaced(messages, topic, number, message, type_name=IMAGE):
    """Replace one message of a recording."""
    return [
        Recorded(topic, type_name, message, each.time_ns)
        if (each.topic, each.time_ns) == (topic, stamp_of(number))
        else each
        for each in messages
    ]


@pytest.mark.parametrize('kind', WRITERS)
@pytest.mark.parametrize('is_compressed', [False, True])
def test_pairs_are_read_from_every_format(tmp_path, kind, is_compressed):
    factory = ROS1 if kind == 'rosbag1' else ROS2
    messages = stereo_messages(3, factory=factory, is_compressed=is_compressed)
    frames, pairs = read(WRITERS[kind](tmp_path / 'bag', messages))
    assert len(frames) == 3
    for number, pair in enumerate(frames):
        assert pair.stamp_ns == stamp_ns(pair.left_header) == stamp_of(number)
        assert pair.frame_id == pair.left_header.frame_id == 'left_optical'
        np.testing.assert_array_equal(pair.left, pixels(number, 'left'))
        np.testing.assert_array_equal(pair.right, pixels(number, 'right'))
        assert (pair.camera.shape, pair.camera.fx) == ((HEIGHT, WIDTH), 40)
        assert pair.extras == {}
    assert (pairs.statistics.left, pairs.statistics.right, pairs.statistics.pairs) == (3, 3, 3)
    assert pairs.bad_frames == 0


@pytest.mark.parametrize(
    ('options', 'numbers'),
    [
        ({'start_s': 0.25}, [3, 4, 5]),
        ({'duration_s': 0.25}, [0, 1, 2]),
        ({'start_s': 0.1, 'duration_s': 0.3}, [1, 2, 3]),
        ({'every': 2}, [0, 2, 4]),
        ({'every': 4}, [0, 4]),
        ({'start_s': 60.0}, []),
    ],
)
def test_a_part_of_the_recording_is_read(tmp_path, options, numbers):
    frames, _ = read(write(tmp_path, stereo_messages(6)), **options)
    assert [frame.stamp_ns for frame in frames] == [stamp_of(number) for number in numbers]


def test_different_stamps_are_paired_only_within_a_tolerance(tmp_path):
    path = write(tmp_path, stereo_messages(5, gap_ns=3_000_000))
    frames, pairs = read(path)
    assert frames == []
    assert pairs.statistics.smallest_gap_ns == 3_000_000
    assert (pairs.statistics.unmatched_left, pairs.statistics.unmatched_right) == (5, 5)
    frames, pairs = read(path, tolerance_ns=5_000_000)
    assert [frame.stamp_ns for frame in frames] == [stamp_of(number) for number in range(5)]
    np.testing.assert_array_equal(frames[4].right, pixels(4, 'right'))
    assert pairs.statistics.unmatched_left == 0


def test_a_missing_image_is_counted(tmp_path):
    messages = [
        each for each in stereo_messages(4) if (each.topic, each.time_ns) != (RIGHT, stamp_of(1))
    ]
    frames, pairs = read(write(tmp_path, messages))
    assert [frame.stamp_ns for frame in frames] == [stamp_of(number) for number in (0, 2, 3)]
    assert pairs.statistics.unmatched_left == 1


def clear_stamp(message):
    message.header.stamp.sec = message.header.stamp.nanosec = 0


@pytest.mark.parametrize(
    ('topic', 'change', 'words'),
    [
        (LEFT, lambda m: setattr(m, 'step', 5), f'{LEFT}: step is 5'),
        (RIGHT, lambda m: setattr(m, 'encoding', 'yuv'), f"{RIGHT}: encoding is 'yuv'"),
        (LEFT, lambda m: setattr(m, 'data', m.data[:9]), f'{LEFT}: data has 9 bytes'),
        (RIGHT, lambda m: setattr(m, 'width', 0), f'{RIGHT}: width is 0'),
        (
            RIGHT,
            lambda m: (setattr(m, 'height', 12), setattr(m, 'data', m.data[: 12 * WIDTH])),
            f'{RIGHT} is 32 x 12, {LEFT} is 32 x 24: expected the same size',
        ),
        (LEFT, clear_stamp, f'{LEFT}: header.stamp is 0 s'),
    ],
)
@pytest.mark.parametrize('number', [0, 1])
def test_a_bad_frame_is_reported_and_skipped(tmp_path, topic, change, words, number):
    message = image(pixels(number), stamp_of(number))
    change(message)
    messages = replaced(stereo_messages(3), topic, number, message)
    frames, pairs = read(write(tmp_path, messages))
    bad = [frame for frame in frames if isinstance(frame, BadFrame)]
    good = [frame.stamp_ns for frame in frames if isinstance(frame, StereoPair)]
    assert good == [stamp_of(other) for other in range(3) if other != number]
    assert len(bad) == pairs.bad_frames == 1
    assert bad[0].reason.startswith(words)
    assert bad[0].stamp_ns == stamp_of(number)
    assert bad[0].topic == topic


def test_a_corrupt_compressed_image_is_a_bad_frame(tmp_path):
    messages = stereo_messages(3, is_compressed=True)
    topic = f'{LEFT}/compressed'
    for each in messages:
        if (each.topic, each.time_ns) == (topic, stamp_of(1)):
            each.message.data = each.message.data[:40]
    frames, _ = read(write(tmp_path, messages))
    assert [type(frame) for frame in frames] == [StereoPair, BadFrame, StereoPair]
    assert frames[1].reason.startswith(f'{topic}: data is a PNG file of 40 bytes cut short')


def test_an_undecodable_message_is_a_bad_frame(tmp_path):
    text = ROS2.make('std_msgs/msg/String', data='?')
    messages = replaced(stereo_messages(3), RIGHT, 1, text, 'std_msgs/msg/String')
    frames, pairs = read(write(tmp_path, messages))
    assert [type(frame) for frame in frames] == [StereoPair, BadFrame, StereoPair]
    assert frames[1].topic == RIGHT
    assert frames[1].reason.startswith(f'{RIGHT}: sensor_msgs/msg/Image cannot be decoded')
    assert pairs.bad_frames == 1


@pytest.mark.parametrize('name', ['decode_camera_image', 'rectify', 'take'])
def test_any_failure_with_one_message_is_a_bad_frame(tmp_path, monkeypatch, name):
    owner = stereo if name == 'decode_camera_image' else CalibrationWatch
    works = getattr(owner, name)
    calls = itertools.count()

    def fail_at_the_fourth(*arguments):
        if next(calls) == 3:
            raise ValueError('cannot reshape\nan array')
        return works(*arguments)

    monkeypatch.setattr(owner, name, fail_at_the_fourth)
    frames, pairs = read(write(tmp_path, stereo_messages(5)))
    good = 5 if name == 'take' else 4
    assert [type(frame) for frame in frames].count(StereoPair) == good
    (bad,) = (frame for frame in frames if isinstance(frame, BadFrame))
    assert bad.reason.endswith(': ValueError: cannot reshape an array')
    assert bad.reason.startswith('/stereo/')
    assert pairs.bad_frames == 1


def test_a_calibration_of_another_size_is_an_error_naming_both_sizes(tmp_path):
    path = write(tmp_path, stereo_messages(2, size=(64, 48)))
    with pytest.raises(BagError) as caught:
        read(path)
    assert str(caught.value) == (
        f'{path}: {LEFT} and {RIGHT} are 32 x 24, but the calibration ({LEFT_INFO} and '
        f'{RIGHT_INFO}) is for 64 x 48: expected the same size'
    )


def test_images_that_change_size_later_are_bad_frames(tmp_path):
    messages = stereo_messages(3)
    for topic in (LEFT, RIGHT):
        small = image(pixels(1)[:12], stamp_of(1))
        messages = replaced(messages, topic, 1, small)
    frames, _ = read(write(tmp_path, messages))
    assert [type(frame) for frame in frames] == [StereoPair, BadFrame, StereoPair]
    assert 'are 32 x 12, but the calibration' in frames[1].reason


def test_a_calibration_change_takes_effect_once_both_cameras_sent_it(tmp_path):
    messages = stereo_messages(2) + [
        each._replace(time_ns=each.time_ns + 2 * FRAME_NS)
        for each in later(stereo_messages(2, focal=44.0))
    ]
    frames, pairs = read(write(tmp_path, messages))
    assert [frame.camera.fx for frame in frames][:2] == [40, 40]
    assert frames[-1].camera.fx == 44
    assert len(frames) == 4
    assert pairs.bad_frames == 0


def later(messages):
    for each in messages:
        each.message.header.stamp.nanosec += 2 * FRAME_NS
    return messages


@pytest.mark.parametrize('sides', [('left', 'right'), ('right',)])
def test_pairs_with_a_bad_calibration_are_bad_until_the_next_good_one(tmp_path, sides):
    messages = stereo_messages(4)
    for side in sides:
        topic = LEFT_INFO if side == 'left' else RIGHT_INFO
        zero = info(side, stamp_of(1), focal=0.0)
        messages = replaced(messages, topic, 1, zero, INFO)
    frames, _ = read(write(tmp_path, messages))
    bad = [frame for frame in frames if isinstance(frame, BadFrame)]
    # The recording has the images of a moment before their calibration.
    assert (bad[-1].stamp_ns, bad[-1].topic) == (stamp_of(2), LEFT)
    assert all('P[0] (fx) is 0.0' in frame.reason for frame in bad)
    good = [frame for frame in frames if isinstance(frame, StereoPair)]
    assert [frame.stamp_ns for frame in good] == [stamp_of(number) for number in (0, 1, 3)]
    assert [frame.camera.fx for frame in good] == [40, 40, 40]


def test_raw_images_are_rectified_with_a_warning(tmp_path, caplog):
    distortion = (-0.3, 0.1, 0.0, 0.0, 0.0)
    messages = stereo_messages(2, name='image_raw', d=distortion)
    with caplog.at_level(logging.WARNING):
        frames, _ = read(write(tmp_path, messages))
    assert len(caplog.messages) == 1
    assert (
        '/stereo/left/image_raw and /stereo/right/image_raw are raw images' in caplog.messages[0]
    )
    rectify = Rectification(CameraInfo.from_message(info('left', 0, d=distortion)), 'info')
    np.testing.assert_array_equal(frames[1].left, rectify(pixels(1, 'left')))
    assert (frames[1].left != pixels(1, 'left')).any()


def test_rectified_images_are_not_changed(tmp_path, caplog):
    frames, _ = read(write(tmp_path, stereo_messages(1, d=(-0.3, 0.1, 0.0, 0.0, 0.0))))
    np.testing.assert_array_equal(frames[0].left, pixels(0, 'left'))
    assert caplog.messages == []


def test_raw_images_without_distortion_are_not_changed_and_it_is_said(tmp_path, caplog):
    path = write(tmp_path, stereo_messages(2, name='image_raw'))
    with open_bag(path) as bag:
        recorded = bag.calibration(bag.stereo_topics())
    frames, _ = read(path)
    np.testing.assert_array_equal(frames[0].left, pixels(0, 'left'))
    assert caplog.messages == [
        '/stereo/left/image_raw and /stereo/right/image_raw are raw images, but there is no '
        f'distortion or rotation in {LEFT_INFO} and {RIGHT_INFO}: they are used as they are'
    ]
    caplog.clear()
    read(path, calibration=recorded)
    assert caplog.messages == []


def test_a_given_calibration_replaces_a_missing_one_and_rectifies(tmp_path):
    calibration = StereoCalibration(
        *(
            CameraInfo.from_message(info(side, 0, d=(-0.3, 0.1, 0.0, 0.0, 0.0)))
            for side in ('left', 'right')
        ),
        'left.yaml and right.yaml',
    )
    path = write(tmp_path, stereo_messages(1, name='image_raw', with_info=False))
    frames, _ = read(path, calibration=calibration)
    assert frames[0].camera == calibration.camera
    rectify = Rectification(calibration.right, 'yaml')
    np.testing.assert_array_equal(frames[0].right, rectify(pixels(0, 'right')))


def test_an_unknown_distortion_model_of_raw_images_is_an_error(tmp_path):
    messages = stereo_messages(1, name='image_raw', d=(0.1, 0.0, 0.0, 0.0, 0.0))
    for each in messages:
        if each.type_name == INFO:
            each.message.distortion_model = 'scaramuzza'
    with pytest.raises(CameraError, match="distortion_model is 'scaramuzza'"):
        read(write(tmp_path, messages))


@pytest.mark.parametrize('order', ['before', 'after'])
def test_extra_messages_are_attached_to_their_pair(tmp_path, order):
    labels = [
        Recorded(
            '/truth/labels', IMAGE, image(pixels(10 + number), stamp_of(number)), stamp_of(number)
        )
        for number in (0, 2)
    ]
    messages = stereo_messages(3)
    path = write(tmp_path, [*labels, *messages] if order == 'before' else [*messages, *labels])
    frames, _ = read(path, extra_topics=['/truth/labels'])
    assert [list(frame.extras) for frame in frames] == [['/truth/labels'], [], ['/truth/labels']]
    shown = decode_image(frames[2].extras['/truth/labels'], 'labels')
    np.testing.assert_array_equal(shown, pixels(12))


def test_missing_extra_messages_do_not_delay_pairs_for_long(tmp_path):
    label = Recorded('/truth/labels', IMAGE, image(pixels(7), stamp_of(39)), stamp_of(39))
    path = write(tmp_path, [*stereo_messages(40), label])
    with open_bag(path) as bag:
        pairs = read_pairs(bag, bag.stereo_topics(), extra_topics=['/truth/labels'])
        assert next(pairs).stamp_ns == stamp_of(0)
        assert pairs.statistics.left < 15
        rest = list(pairs)
    assert len(rest) == 39
    assert list(rest[-1].extras) == ['/truth/labels']
