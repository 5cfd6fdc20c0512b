from __future__ import annotations

import struct

import numpy as np
import pytest

from rover_obstacle_detection.messages.cloud import decode_cloud, encode_cloud
from rover_obstacle_detection.messages.header import make_header
from rover_obstacle_detection.messages.rosbags_factory import RosbagsFactory

FACTORY = RosbagsFactory()
HEADER = make_header(5, 'left_optical', FACTORY)
POINTS = np.array([[1.5, -2, 3, 0.25], [4, 5, 6, -0.5], [7, 8, 9, 0]], np.float32)


def test_cloud_is_unpadded_little_endian_float32():
    message = encode_cloud(POINTS, HEADER, FACTORY)
    expected = b''.join(struct.pack('<4f', *point) for point in POINTS)
    assert message.data.tobytes() == expected
    assert (message.height, message.width) == (1, 3)
    assert (message.point_step, message.row_step) == (16, 48)
    assert message.is_dense is True
    assert message.is_bigendian is False
    fields = [(each.name, each.offset, each.datatype, each.count) for each in message.fields]
    assert fields == [('x', 0, 7, 1), ('y', 4, 7, 1), ('z', 8, 7, 1), ('height', 12, 7, 1)]
    assert message.header.frame_id == 'left_optical'


def test_confidence_is_the_fifth_field():
    points = np.column_stack((POINTS, np.float32([0.5, 0.25, 1])))
    message = encode_cloud(points, HEADER, FACTORY)
    expected = b''.join(struct.pack('<5f', *point) for point in points)
    assert message.data.tobytes() == expected
    assert (message.point_step, message.row_step) == (20, 60)
    fields = [(each.name, each.offset, each.datatype) for each in message.fields]
    assert fields[3:] == [('height', 12, 7), ('confidence', 16, 7)]
    np.testing.assert_array_equal(decode_cloud(message), points)


@pytest.mark.parametrize('count', [0, 3])
def test_kind_is_a_byte_after_the_confidence(count):
    points = np.column_stack((POINTS, np.float32([0.5, 0.25, 1])))[:count]
    kinds = np.array([1, 3, 5], np.uint8)[:count]
    message = encode_cloud(points, HEADER, FACTORY, kinds)
    expected = b''.join(
        struct.pack('<5fB3x', *point, kind) for point, kind in zip(points, kinds, strict=True)
    )
    assert message.data.tobytes() == expected
    assert (message.point_step, message.row_step, message.width) == (24, 24 * count, count)
    fields = [(each.name, each.offset, each.datatype, each.count) for each in message.fields]
    assert fields[4:] == [('confidence', 16, 7, 1), ('kind', 20, 2, 1)]
    decoded = decode_cloud(message)
    assert decoded.shape == (count, 6)
    np.testing.assert_array_equal(decoded, np.column_stack((points, kinds)))


@pytest.mark.parametrize('count', [0, 1, 3])
def test_cloud_survives_serialisation(count):
    points = np.repeat(POINTS, 2, axis=0)[::2][:count]
    message = encode_cloud(points, HEADER, FACTORY)
    raw = FACTORY.typestore.serialize_cdr(message, message.__msgtype__)
    again = FACTORY.typestore.deserialize_cdr(raw, message.__msgtype__)
    decoded = decode_cloud(again)
    np.testing.assert_array_equal(decoded, points)
    assert decoded.dtype == np.float32
    assert decoded.shape == (count, 4)


def test_padded_big_endian_cloud_is_decoded():
    message = encode_cloud(POINTS, HEADER, FACTORY)
    padded = np.pad(POINTS.astype('>f4'), ((0, 0), (0, 2)))
    message.data = padded.reshape(-1).view(np.uint8)
    message.is_bigendian, message.point_step, message.row_step = True, 24, 72
    np.testing.assert_array_equal(decode_cloud(message), POINTS)


def test_field_of_unsupported_type_is_named():
    message = encode_cloud(POINTS, HEADER, FACTORY)
    message.fields[1].datatype = 8
    with pytest.raises(ValueError, match="field 'y' is neither float32 nor uint8"):
        decode_cloud(message)
