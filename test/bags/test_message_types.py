"""Names of message definitions become Python code in rosbags, so they must be names."""

from __future__ import annotations

import pytest
from mcap.writer import Writer
from recordings import ROS1, ROS2, START_NS, WRITERS, stereo_messages
from rosbags.typesys import TypesysError

from rover_obstacle_detection.bags.message_types import types_from_msg
from rover_obstacle_detection.bags.reader import open_bag

CODE = 'pkg/msg/A:\n    """"""\n    import os\n    os.abort()\nclass B'


@pytest.mark.parametrize('name', [CODE, '2d/msg/A', 'pkg/msg/sub/A', "pkg/msg/A'", ''])
def test_type_names_that_are_no_names_are_refused(name):
    with pytest.raises(TypesysError):
        types_from_msg('uint8 data\n', name)


def test_names_of_referred_types_are_checked():
    text = f'pkg/2d data\n{"=" * 80}\nMSG: pkg/2d\nuint8 x\n'
    with pytest.raises(TypesysError):
        types_from_msg(text, 'pkg/msg/A')


def test_definitions_are_parsed():
    types = types_from_msg('uint8 MOST=3\nuint8[] data\nfloat64 X_1\n', 'pkg/msg/A')
    constants, fields = types['pkg/msg/A']
    assert [name for name, *_ in constants] == ['MOST']
    assert [name for name, _ in fields] == ['data', 'X_1']


def test_recording_with_code_for_a_type_name_has_other_messages_that_can_be_read(tmp_path):
    path = WRITERS['mcap file'](tmp_path / 'bag', stereo_messages(1))
    with path.open('wb') as file:
        writer = Writer(file)
        writer.start('ros2')
        for topic, name in (('/bad', CODE), ('/good', 'pkg/msg/Number')):
            schema = writer.register_schema(name, 'ros2msg', b'uint8 data\n')
            channel = writer.register_channel(topic, 'cdr', schema)
            writer.add_message(channel, START_NS, b'\0\1\0\0\7', START_NS)
        writer.finish()
    with open_bag(path) as bag:
        (message,) = [message for _, _, message in bag.messages(['/good'])]
        (bad,) = [message for _, _, message in bag.messages(['/bad'])]
    assert message.data == 7
    assert 'cannot be decoded' in bad.reason


@pytest.mark.parametrize('kind', WRITERS)
def test_names_of_real_recordings_pass(kind, tmp_path):
    factory = ROS1 if kind == 'rosbag1' else ROS2
    path = WRITERS[kind](tmp_path / 'bag', stereo_messages(1, factory=factory))
    with open_bag(path) as bag:
        assert len(list(bag.messages(list(bag.topics)))) == 4
