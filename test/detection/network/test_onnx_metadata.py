from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection.detection.network.onnx_metadata import read_metadata

# Wire types of Protocol Buffers.
VARINT, FIXED64, LENGTH_DELIMITED, FIXED32 = 0, 1, 2, 5


def varint(number):
    encoded = b''
    while number > 0x7F:
        encoded += bytes([number & 0x7F | 0x80])
        number >>= 7
    return encoded + bytes([number])


def field(number, content):
    return varint(number << 3 | LENGTH_DELIMITED) + varint(len(content)) + content


def entry(key, value):
    """A ``metadata_props`` field of a model."""
    return field(14, field(1, key.encode()) + field(2, value.encode()))


@given(st.dictionaries(st.text(max_size=300), st.text(max_size=300), max_size=4))
def test_metadata_are_read_as_they_were_written(metadata):
    model = b''.join(entry(key, value) for key, value in metadata.items())
    assert read_metadata(model) == metadata


def test_all_other_fields_are_skipped():
    others = (
        varint(1 << 3 | VARINT) + varint(8)
        + varint(5 << 3 | VARINT) + varint(2**63)
        + field(2, b'producer')
        + field(7, entry('inside', 'the graph') * 50)
        + varint(20 << 3 | FIXED32) + b'\xff' * 4
        + varint(21 << 3 | FIXED64) + b'\xff' * 8
    )  # fmt: skip
    model = others + entry('features_version', '7') + others
    assert read_metadata(model) == {'features_version': '7'}


def test_missing_key_or_value_is_empty():
    assert read_metadata(field(14, field(1, b'key'))) == {'key': ''}
    assert read_metadata(field(14, field(2, b'value'))) == {'': 'value'}


@pytest.mark.parametrize(
    ('model', 'message'),
    [
        (b'not a model', 'unknown wire type 6'),
        (b'\xff' * 20, 'ends within a number'),
        (varint(14 << 3 | LENGTH_DELIMITED), 'ends within a number'),
        (varint(14 << 3 | 3), 'unknown wire type 3'),
    ],
)
def test_bytes_that_are_no_model_are_refused(model, message):
    with pytest.raises(ValueError, match=f'{message}.*expected a serialised ONNX model'):
        read_metadata(model)


@given(st.binary(max_size=200))
def test_any_other_bytes_raise_nothing_but_value_error(model):
    try:
        metadata = read_metadata(model)
    except ValueError:
        return
    assert all(isinstance(text, str) for pair in metadata.items() for text in pair)
