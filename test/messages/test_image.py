from __future__ import annotations

from array import array
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from rover_obstacle_detection.errors import ImageError
from rover_obstacle_detection.messages.header import make_header, stamp_ns
from rover_obstacle_detection.messages.image import (
    decode_any_image,
    decode_camera_image,
    decode_compressed_image,
    decode_float_image,
    decode_image,
    encode_image,
)
from rover_obstacle_detection.messages.rosbags_factory import RosbagsFactory

FACTORY = RosbagsFactory()
HEADER = make_header(5, 'left_optical', FACTORY)


def image_message(pixels, encoding, *, padding=0, big_endian=False, as_array=False):
    """Build an Image with ``padding`` bytes after each row."""
    height, width = pixels.shape[:2]
    stored = pixels.astype(pixels.dtype.newbyteorder('>' if big_endian else '<'))
    rows = stored.reshape(height, -1).view(np.uint8)
    rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=77)
    data = rows.tobytes()
    return SimpleNamespace(
        height=height,
        width=width,
        step=rows.shape[1],
        encoding=encoding,
        is_bigendian=int(big_endian),
        data=array('B', data) if as_array else np.frombuffer(data, np.uint8),
    )


def compressed_message(data, format_='png'):
    return SimpleNamespace(format=format_, data=np.frombuffer(bytes(data), np.uint8))


def random_pixels(*shape, dtype=np.uint8):
    return np.random.default_rng(1).integers(0, np.iinfo(dtype).max, shape, dtype)


@given(
    hnp.array_shapes(min_dims=2, max_dims=2, max_side=9),
    st.sampled_from(['mono8', '8UC1', 'mono16', '16UC1', 'bgr8', '8UC3']),
    st.integers(0, 5),
    st.booleans(),
    st.booleans(),
)
def test_decoding_honours_step_and_endianness(shape, encoding, padding, big_endian, as_array):
    dtype = np.uint16 if '16' in encoding else np.uint8
    pixels = random_pixels(
        *shape, *((3,) if '3' in encoding or 'bgr' in encoding else ()), dtype=dtype
    )
    message = image_message(
        pixels, encoding, padding=padding, big_endian=big_endian, as_array=as_array
    )
    decoded = decode_any_image(message, '/left')
    np.testing.assert_array_equal(decoded, pixels)
    assert decoded.dtype == dtype
    assert decoded.dtype.isnative


YUV = {
    'yuv422': cv2.COLOR_YUV2BGR_UYVY,
    'uyvy': cv2.COLOR_YUV2BGR_UYVY,
    'yuv422_yuy2': cv2.COLOR_YUV2BGR_YUY2,
    'yuyv': cv2.COLOR_YUV2BGR_YUY2,
    'nv12': cv2.COLOR_YUV2BGR_NV12,
    'nv21': cv2.COLOR_YUV2BGR_NV21,
}


def yuv_message(encoding, height=4, width=6, padding=0):
    shape = (height * 3 // 2, width) if encoding.startswith('nv') else (height, width, 2)
    pixels = random_pixels(*shape)
    message = image_message(pixels, encoding, padding=padding)
    message.height = height
    return message, pixels


@pytest.mark.parametrize('padding', [0, 5])
@pytest.mark.parametrize('encoding', YUV)
def test_yuv_is_decoded_to_bgr(encoding, padding):
    message, pixels = yuv_message(encoding, padding=padding)
    decoded = decode_any_image(message, '/left')
    assert decoded.shape == (4, 6, 3)
    np.testing.assert_array_equal(decoded, cv2.cvtColor(pixels, YUV[encoding]))


def test_a_grey_scene_stays_grey_in_yuv():
    grey = random_pixels(4, 6)
    neutral = np.full((2, 6), 128, np.uint8)
    message = image_message(np.vstack((grey, neutral)), 'nv12')
    message.height = 4
    decoded = decode_image(message, '/left').astype(int)
    assert np.ptp(decoded, axis=2).max() == 0
    # The video range, 16 to 235, becomes 0 to 255.
    expected = ((grey.astype(int) - 16) * 255 / 219).clip(0, 255)
    assert np.abs(decoded[..., 0] - expected).max() <= 1


@pytest.mark.parametrize(
    ('encoding', 'size', 'words'),
    [
        ('yuyv', (4, 5), 'width is 5: expected an even number for yuyv'),
        ('nv12', (4, 7), 'width is 7: expected an even number for nv12'),
        ('nv21', (3, 6), 'height is 3: expected an even number for nv21'),
    ],
)
def test_yuv_of_odd_size_is_refused(encoding, size, words):
    with pytest.raises(ImageError, match=words):
        decode_image(yuv_message(encoding, *size)[0], '/left')


def test_yuv_without_its_colour_rows_is_refused():
    message = image_message(random_pixels(4, 6), 'nv12')
    with pytest.raises(ImageError, match=r'24 bytes: expected 1.5 height x step = 6 x 6 = 36'):
        decode_image(message, '/left')


def test_compressed_grey_of_a_yuv_camera_stays_grey():
    pixels = random_pixels(4, 6)
    data = cv2.imencode('.png', pixels)[1]
    decoded = decode_compressed_image(compressed_message(data, 'nv12; png compressed '), '/left')
    np.testing.assert_array_equal(decoded, pixels)


@pytest.mark.parametrize(
    ('encoding', 'order'),
    [('rgb8', [2, 1, 0]), ('bgra8', [0, 1, 2]), ('rgba8', [2, 1, 0]), ('8UC4', [0, 1, 2])],
)
def test_colour_is_decoded_to_bgr(encoding, order):
    pixels = random_pixels(4, 5, 4 if 'a' in encoding or '4' in encoding else 3)
    decoded = decode_image(image_message(pixels, encoding, padding=3), '/left')
    np.testing.assert_array_equal(decoded, pixels[..., order])


@pytest.mark.parametrize(
    ('pattern', 'red_at'), [('rggb', (0, 0)), ('bggr', (1, 1)), ('gbrg', (1, 0)), ('grbg', (0, 1))]
)
def test_bayer_mosaic_is_decoded_to_bgr_or_16_bit_grey(pattern, red_at):
    mosaic = np.zeros((8, 8), np.uint8)
    mosaic[red_at[0] :: 2, red_at[1] :: 2] = 200
    decoded = decode_image(image_message(mosaic, f'bayer_{pattern}8'), '/left')
    np.testing.assert_array_equal(decoded[2:6, 2:6], np.broadcast_to((0, 0, 200), (4, 4, 3)))
    deep = decode_image(image_message(mosaic.astype(np.uint16) * 256, f'bayer_{pattern}16'), '/l')
    assert deep.dtype == np.uint16
    np.testing.assert_allclose(deep[2:6, 2:6], 0.299 * 200 * 256, rtol=0.01)


def test_grey_image_shares_the_memory_of_the_message():
    message = image_message(random_pixels(6, 7), 'mono8', padding=2)
    assert np.shares_memory(decode_image(message, '/left'), message.data)


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'width': 0}, ['width is 0', 'positive']),
        ({'height': -1}, ['height is -1', 'positive']),
        ({'step': 9}, ['step is 9', 'at least 10 bytes', 'mono8']),
        ({'step': 11}, ['data has 40 bytes', '4 x 11 = 44']),
        ({'height': 3}, ['data has 40 bytes', '3 x 10 = 30']),
        ({'data': np.zeros(39, np.uint8)}, ['data has 39 bytes', '= 40']),
        ({'data': np.zeros(0, np.uint8)}, ['data has 0 bytes', '= 40']),
        ({'encoding': 'yuv9'}, ["encoding is 'yuv9'", 'mono8', 'bayer_grbg16']),
        ({'encoding': 'rgb8'}, ['step is 10', 'at least 30 bytes']),
    ],
)
def test_invalid_field_is_named(changes, words):
    message = image_message(random_pixels(4, 10), 'mono8')
    vars(message).update(changes)
    with pytest.raises(ImageError) as caught:
        decode_image(message, '/rover/left')
    for word in ['/rover/left: ', *words]:
        assert word in str(caught.value)


def picture(noise=0.0):
    """A smooth 12-bit picture with noise."""
    rng = np.random.default_rng(3)
    rows, columns = np.mgrid[:60, :80]
    levels = 2000 + 1500 * np.sin(rows / 9) * np.cos(columns / 7) + rng.normal(0, noise, (60, 80))
    return np.clip(levels, 0, 4095).astype(np.uint16)


@pytest.mark.parametrize('big_endian', [False, True])
@pytest.mark.parametrize('encoding', ['mono16', '16UC1', 'bayer_rggb16'])
@pytest.mark.parametrize('noise', [0.0, 20.0, 150.0])
def test_wrong_byte_order_is_refused(big_endian, encoding, noise):
    message = image_message(picture(noise), encoding, big_endian=big_endian)
    assert decode_camera_image(message, '/left').dtype == np.uint16
    message.is_bigendian = int(not big_endian)
    said = f'/left: is_bigendian is {int(not big_endian)}, .*: expected {int(big_endian)}'
    with pytest.raises(ImageError, match=said):
        decode_camera_image(message, '/left')


def test_byte_order_is_not_questioned_in_noise_darkness_and_8_bit_levels():
    for pixels in (
        random_pixels(60, 80, dtype=np.uint16),
        np.full((60, 80), 256, np.uint16),
        np.random.default_rng(1).integers(0, 4, (60, 80)).astype(np.uint16),
        np.random.default_rng(1).integers(230, 260, (60, 80)).astype(np.uint16),
        picture() >> 4,
        (picture() >> 4) << 8,
    ):
        message = image_message(pixels, 'mono16')
        np.testing.assert_array_equal(decode_camera_image(message, '/left'), pixels)


def test_byte_order_of_labels_is_not_questioned():
    message = image_message(picture(), 'mono16', big_endian=True)
    message.is_bigendian = 0
    assert decode_any_image(message, '/instances').dtype == np.uint16


@pytest.mark.parametrize('extension', ['.png', '.jpg'])
def test_compressed_image_is_decoded(extension):
    pixels = np.full((20, 30, 3), (10, 120, 240), np.uint8)
    message = compressed_message(cv2.imencode(extension, pixels)[1])
    np.testing.assert_allclose(decode_any_image(message, '/left'), pixels, atol=3)


@pytest.mark.parametrize('dtype', [np.uint8, np.uint16])
def test_compressed_grey_keeps_its_bit_depth(dtype):
    pixels = random_pixels(6, 7, dtype=dtype)
    decoded = decode_compressed_image(compressed_message(cv2.imencode('.png', pixels)[1]), '/left')
    np.testing.assert_array_equal(decoded, pixels)
    assert decoded.dtype == dtype


def test_compressed_alpha_becomes_bgr_and_16_bit_colour_becomes_grey():
    alpha = random_pixels(4, 5, 4)
    decoded = decode_compressed_image(compressed_message(cv2.imencode('.png', alpha)[1]), '/l')
    np.testing.assert_array_equal(decoded, alpha[..., :3])
    deep = np.full((4, 5, 3), 40_000, np.uint16)
    decoded = decode_compressed_image(compressed_message(cv2.imencode('.png', deep)[1]), '/l')
    np.testing.assert_array_equal(decoded, np.full((4, 5), 40_000))


def test_compressed_bayer_mosaic_is_decoded_to_bgr():
    mosaic = np.zeros((8, 8), np.uint8)
    mosaic[::2, ::2] = 200
    png = cv2.imencode('.png', mosaic)[1]
    decoded = decode_compressed_image(
        compressed_message(png, 'bayer_rggb8; png compressed '), '/left'
    )
    np.testing.assert_array_equal(decoded[2:6, 2:6], np.broadcast_to((0, 0, 200), (4, 4, 3)))


@pytest.mark.parametrize('extension', ['.png', '.jpg'])
@pytest.mark.parametrize('kept', [0.1, 0.5, 0.9, 0.99])
def test_truncated_compressed_image_is_refused(extension, kept, capfd):
    data = cv2.imencode(extension, random_pixels(60, 80))[1]
    with pytest.raises(ImageError, match=r'/left: data is a .* cut short'):
        decode_compressed_image(compressed_message(data[: int(kept * len(data))]), '/left')
    assert capfd.readouterr().err == ''


@pytest.mark.parametrize(
    ('data', 'words'), [(b'', 'data is empty'), (b'not an image at all', 'cannot be decoded')]
)
def test_compressed_data_that_is_not_an_image_is_refused(data, words):
    with pytest.raises(ImageError, match=f'/left: .*{words}'):
        decode_compressed_image(compressed_message(data), '/left')


@settings(max_examples=50)
@given(st.sampled_from(['.png', '.jpg']), st.integers(0, 10**9), st.integers(0, 255))
def test_damaged_compressed_image_is_decoded_or_refused(extension, position, value):
    data = cv2.imencode(extension, random_pixels(16, 16))[1]
    data[position % len(data)] = value
    try:
        decoded = decode_compressed_image(compressed_message(data), '/left')
    except ImageError as error:
        assert str(error).startswith('/left: ')  # noqa: PT017
    else:
        assert decoded.dtype in (np.uint8, np.uint16)


@pytest.mark.parametrize(
    ('encoding', 'dtype', 'channels'),
    [('mono8', np.uint8, 1), ('mono16', np.uint16, 1), ('bgr8', np.uint8, 3), ('32FC1', 'f4', 1)],
)
def test_encoded_array_decodes_to_itself(encoding, dtype, channels):
    pixels = random_pixels(6, 9, channels)[::2].astype(dtype)
    pixels = pixels[..., 0] if channels == 1 else pixels
    message = encode_image(pixels, encoding, HEADER, FACTORY)
    assert (message.height, message.width) == (3, 9)
    assert message.step == 9 * channels * pixels.itemsize
    assert message.header.frame_id == 'left_optical'
    raw = FACTORY.typestore.serialize_cdr(message, message.__msgtype__)
    again = FACTORY.typestore.deserialize_cdr(raw, message.__msgtype__)
    decode = decode_float_image if encoding == '32FC1' else decode_image
    np.testing.assert_array_equal(decode(again, '/x'), pixels)


def test_array_and_encoding_must_match():
    with pytest.raises(ValueError, match='mono8 does not fit an array of float64 with 1 channels'):
        encode_image(np.zeros((2, 2)), 'mono8', HEADER, FACTORY)
    with pytest.raises(ImageError, match=r'/depth: encoding is .mono8.: expected 32FC1'):
        decode_float_image(image_message(random_pixels(2, 2), 'mono8'), '/depth')


@given(st.integers(0, 2**31 * 10**9 - 1))
def test_header_keeps_the_stamp(stamp):
    assert stamp_ns(make_header(stamp, '', FACTORY)) == stamp
