"""Sizes from headers, and images that would take far more memory than their bytes."""

from __future__ import annotations

import struct
import tracemalloc
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from rover_obstacle_detection.errors import ImageError
from rover_obstacle_detection.messages.image import decode_compressed_image
from rover_obstacle_detection.messages.image_header import declared_size

IMAGE = np.random.default_rng(1).integers(0, 255, (30, 50), np.uint8)
EXTENSIONS = ('.png', '.jpg', '.pgm', '.bmp', '.tiff')


def encoded(extension: str, image: np.ndarray = IMAGE) -> bytes:
    return bytes(cv2.imencode(extension, image)[1])


def refusal(data: bytes, **limit: int) -> str:
    message = SimpleNamespace(format='png', data=np.frombuffer(data, np.uint8))
    with pytest.raises(ImageError) as caught:
        decode_compressed_image(message, '/left', **limit)
    return str(caught.value)


@pytest.mark.parametrize('extension', EXTENSIONS)
@pytest.mark.parametrize('channels', [1, 3])
def test_size_is_that_of_the_image(extension, channels):
    image = IMAGE if channels == 1 or extension == '.pgm' else np.dstack([IMAGE] * 3)
    assert declared_size(encoded(extension, image)) == (50, 30)


def test_comments_in_a_pnm_header_and_fill_bytes_in_a_jpeg_are_skipped():
    assert declared_size(b'P5\n# by a camera\n50 # wide\n30\n255\n' + IMAGE.tobytes()) == (50, 30)
    jpeg = encoded('.jpg')
    assert declared_size(jpeg[:2] + b'\xff\xff' + jpeg[2:]) == (50, 30)


@pytest.mark.parametrize('data', [b'', b'GIF89a' + bytes(90), b'\xff\xd8\xff', b'P5 wide', b'BM'])
def test_other_data_is_refused(data):
    with pytest.raises(ValueError, match=r'expected a JPEG|damaged'):
        declared_size(data)


@given(
    st.sampled_from(EXTENSIONS),
    st.lists(st.tuples(st.integers(0, 120), st.integers(0, 255)), max_size=4),
    st.integers(0, 2000),
)
@example('.png', [], 8)
def test_damaged_headers_give_a_size_or_a_value_error(extension, changes, kept):
    data = bytearray(encoded(extension)[:kept])
    for position, value in changes:
        if position < len(data):
            data[position] = value
    try:
        width, height = declared_size(bytes(data))
    except ValueError:
        return
    assert 0 <= width < 1 << 32
    assert 0 <= height < 1 << 32


def test_png_chunk_of_four_gigabytes_is_refused_before_it_is_allocated():
    png = bytearray(encoded('.png'))
    chunk = png.index(b'IDAT') - 4
    png[chunk : chunk + 4] = b'\xff\xff\xff\xff'
    assert "PNG chunk b'IDAT' has a length of 4294967295 bytes" in refusal(bytes(png))


def test_huge_jpeg_is_refused_before_it_is_allocated():
    jpeg = bytearray(encoded('.jpg'))
    frame = jpeg.index(b'\xff\xc0')
    jpeg[frame + 5 : frame + 9] = struct.pack('>HH', 15000, 65000)
    tracemalloc.start()
    said = refusal(bytes(jpeg))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert (
        said == '/left: data is an image of 65000 x 15000 pixels: expected at most 67108864 pixels'
    )
    assert peak < 1 << 20


def test_image_larger_than_the_camera_is_refused():
    said = refusal(encoded('.png'), most_pixels=1499)
    assert said == '/left: data is an image of 50 x 30 pixels: expected at most 1499 pixels'
