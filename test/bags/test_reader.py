from __future__ import annotations

import sqlite3

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
    info,
    pixels,
    stereo_messages,
    text_messages,
    write_mcap,
    write_ros2,
)

from rover_obstacle_detection.bags.reader import BadMessage, open_bag
from rover_obstacle_detection.errors import BagError, CameraError
from rover_obstacle_detection.messages.header import stamp_ns
from rover_obstacle_detection.messages.image import decode_image

LEFT = '/stereo/left/image_rect'


@pytest.mark.parametrize('kind', WRITERS)
def test_every_format_yields_the_same_messages(tmp_path, kind):
    factory = ROS1 if kind == 'rosbag1' else ROS2
    path = WRITERS[kind](tmp_path / 'bag', stereo_messages(4, factory=factory))
    with open_bag(path) as bag:
        assert bag.topics == {
            '/stereo/left/image_rect': IMAGE,
            '/stereo/left/camera_info': INFO,
            '/stereo/right/image_rect': IMAGE,
            '/stereo/right/camera_info': INFO,
        }
        assert bag.notes == ()
        assert bag.message_count(LEFT) == 4
        assert bag.message_count('/none') == 0
        assert (bag.start_ns, bag.end_ns) == (START_NS, START_NS + 3 * FRAME_NS + 1)
        camera = bag.calibration(bag.stereo_topics()).camera
        assert (camera.width, camera.height, camera.fx) == (WIDTH, HEIGHT, 40)
        assert camera.baseline_m == pytest.approx(0.1)
        read = list(bag.messages([LEFT]))
    assert [time_ns for _, time_ns, _ in read] == [START_NS + n * FRAME_NS for n in range(4)]
    for number, (topic, time_ns, message) in enumerate(read):
        assert topic == LEFT
        assert stamp_ns(message.header) == time_ns
        np.testing.assert_array_equal(decode_image(message, topic), pixels(number))


@pytest.mark.parametrize('kind', ['mcap', 'sqlite3', 'rosbag1', 'mcap file of no profile'])
def test_a_time_span_is_read(tmp_path, kind):
    factory = ROS1 if kind == 'rosbag1' else ROS2
    path = WRITERS[kind](tmp_path / 'bag', stereo_messages(5, factory=factory))
    with open_bag(path) as bag:
        span = START_NS + FRAME_NS, START_NS + 3 * FRAME_NS
        times = [time_ns for _, time_ns, _ in bag.messages([LEFT], *span)]
        assert times == [START_NS + FRAME_NS, START_NS + 2 * FRAME_NS]
        assert list(bag.messages(['/none'])) == []
        assert list(bag.messages([])) == []


def test_a_folder_without_metadata_is_read_from_its_files(tmp_path):
    folder = write_ros2(tmp_path / 'bag', stereo_messages(2))
    (folder / 'metadata.yaml').unlink()
    write_mcap(
        folder / 'bag_1.mcap', [m._replace(time_ns=m.time_ns + 1) for m in stereo_messages(3)]
    )
    with open_bag(folder) as bag:
        assert bag.message_count(LEFT) == 5
        times = [time_ns for _, time_ns, _ in bag.messages([LEFT])]
    assert times == sorted(times)
    assert len(times) == 5


def test_a_folder_with_broken_metadata_is_read_from_its_files(tmp_path):
    folder = write_ros2(tmp_path / 'bag', stereo_messages(2), 'sqlite3')
    (folder / 'metadata.yaml').write_text('')
    with open_bag(folder) as bag:
        assert bag.message_count(LEFT) == 2


def test_an_undecodable_message_is_reported_as_bad(tmp_path):
    good = stereo_messages(3)
    with_text = [
        m._replace(
            message=ROS2.make('std_msgs/msg/String', data='?'), type_name='std_msgs/msg/String'
        )
        if m.topic == LEFT and m.time_ns == START_NS + FRAME_NS
        else m
        for m in good
    ]
    with open_bag(write_ros2(tmp_path / 'bag', with_text)) as bag:
        read = [message for _, _, message in bag.messages([LEFT])]
    assert [isinstance(message, BadMessage) for message in read] == [False, True, False]
    assert read[1].topic == LEFT
    assert read[1].log_time_ns == START_NS + FRAME_NS
    assert 'sensor_msgs/msg/Image cannot be decoded' in read[1].reason


def test_missing_definitions_of_standard_types_do_not_matter(tmp_path):
    folder = write_ros2(tmp_path / 'bag', stereo_messages(2) + text_messages(), 'sqlite3')
    with sqlite3.connect(next(folder.glob('*.db3'))) as database:
        database.execute("DELETE FROM message_definitions WHERE topic_type LIKE 'sensor_msgs%'")
    database.close()
    with open_bag(folder) as bag:
        assert bag.calibration(bag.stereo_topics()).camera.fx == 40
        assert len(list(bag.messages(['/log']))) == 3


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'baseline': 0.0}, 'baseline is'),
        ({'baseline': -0.1}, 'are left and right swapped?'),
        ({'focal': 0.0}, 'P[0] (fx) is 0.0'),
        ({'size': (0, 24)}, 'size is 0 x 24'),
    ],
)
def test_an_impossible_calibration_is_named_with_its_topics(tmp_path, changes, words):
    path = write_ros2(tmp_path / 'bag', stereo_messages(1, **changes))
    with open_bag(path) as bag, pytest.raises(CameraError) as caught:
        bag.calibration(bag.stereo_topics())
    assert str(caught.value).startswith(
        f'{path}: /stereo/left/camera_info and /stereo/right/camera_info: '
    )
    assert words in str(caught.value)


def test_a_missing_calibration_says_what_to_do(tmp_path):
    path = write_ros2(tmp_path / 'bag', stereo_messages(1, with_info=False))
    with open_bag(path) as bag, pytest.raises(BagError) as caught:
        bag.calibration(bag.stereo_topics())
    for words in (str(path), LEFT, 'no camera_info topic', '--left-info'):
        assert words in str(caught.value)


def test_calibration_of_one_camera_is_not_enough(tmp_path):
    messages = stereo_messages(1, with_info=False)
    about = Recorded('/stereo/left/camera_info', INFO, info('left', START_NS), START_NS)
    path = write_ros2(tmp_path / 'bag', [*messages, about])
    with open_bag(path) as bag, pytest.raises(BagError, match='no calibration for /stereo/right'):
        bag.calibration(bag.stereo_topics())


def test_missing_topics_are_named_with_the_recording(tmp_path):
    path = write_ros2(tmp_path / 'bag', text_messages())
    with open_bag(path) as bag, pytest.raises(BagError) as caught:
        bag.stereo_topics()
    assert str(caught.value).startswith(
        f'{path}: no stereo topics: the recording has /log (std_msgs'
    )
