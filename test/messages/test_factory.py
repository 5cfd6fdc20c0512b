from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.messages.rosbags_factory import (
    RosbagsFactory,
    ros1_typestore,
    ros2_typestore,
)


def test_every_standard_message_can_be_made_with_defaults():
    factory = RosbagsFactory()
    for type_name in ros2_typestore().types:
        message = factory.make(type_name)
        raw = factory.typestore.serialize_cdr(message, type_name)
        assert repr(factory.typestore.deserialize_cdr(raw, type_name)) == repr(message)


def test_fields_not_given_are_zero():
    info = RosbagsFactory().make('sensor_msgs/msg/CameraInfo', width=8, d=np.ones(2))
    assert (info.width, info.height, info.distortion_model) == (8, 0, '')
    np.testing.assert_array_equal(info.d, [1, 1])
    np.testing.assert_array_equal(info.p, np.zeros(12))
    assert info.roi.do_rectify is False


def test_ros_1_messages_can_be_made():
    header = RosbagsFactory(ros1_typestore()).make('std_msgs/msg/Header', frame_id='x')
    assert (header.seq, header.stamp.sec, header.frame_id) == (0, 0, 'x')


def test_unknown_field_is_refused():
    with pytest.raises(TypeError, match="std_msgs/msg/Header has no field 'seq'"):
        RosbagsFactory().make('std_msgs/msg/Header', seq=1)
