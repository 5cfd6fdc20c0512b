from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.rover_mask import RoverMask


def test_no_image_and_no_polygon_give_no_mask() -> None:
    assert RoverMask.load('', '') is None


def test_the_polygon_is_filled() -> None:
    mask = RoverMask.load(polygon='[[1, 2], [3, 2], [3, 4], [1, 4]]')
    assert mask is not None

    expected = np.zeros((6, 5), bool)
    expected[2:5, 1:4] = True
    np.testing.assert_array_equal(mask.pixels(6, 5), expected)


def test_the_polygon_may_extend_beyond_the_image() -> None:
    mask = RoverMask.load(polygon='[[-10, 3], [20, 3], [20, 30], [-10, 30]]')
    assert mask is not None

    pixels = mask.pixels(4, 6)
    assert pixels[3].all()
    assert not pixels[:3].any()


def test_the_mask_is_the_union_of_image_and_polygon(tmp_path: Path) -> None:
    image = np.zeros((4, 6), np.uint8)
    image[0, 0] = 1
    cv2.imwrite(str(tmp_path / 'mask.png'), image)

    mask = RoverMask.load(str(tmp_path / 'mask.png'), '[[5, 3], [5, 3], [5, 3]]')

    assert mask is not None
    assert np.argwhere(mask.pixels(4, 6)).tolist() == [[0, 0], [3, 5]]


def test_an_image_of_another_size_is_refused(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / 'mask.png'), np.zeros((4, 6), np.uint8))
    mask = RoverMask.load(str(tmp_path / 'mask.png'))
    assert mask is not None

    with pytest.raises(ConfigurationError, match=r'rover_mask is 6 x 4: expected .* 8 x 4'):
        mask.pixels(4, 8)


@pytest.mark.parametrize(
    'text',
    ['[]', '[[0, 0], [1, 1]]', 'nonsense', '[[0, 0], [1], [2, 2]]', '3', '[[0,0],[9e9,0],[1,1]]'],
)
def test_an_invalid_polygon_is_refused(text: str) -> None:
    with pytest.raises(ConfigurationError, match=r'rover_polygon is .* expected three or more'):
        RoverMask.load(polygon=text)


@pytest.mark.parametrize(
    'text',
    ['[' * 5000, '[' * 20_000, f'[[{"9" * 400}, 0], [0, 0], [1, 1]]', '[[0,0],[1,NaN],[1,1]]'],
)
def test_a_polygon_that_python_cannot_parse_is_refused_on_a_short_line(text: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        RoverMask.load(polygon=text)
    assert 'expected three or more corners in pixels' in str(caught.value)
    assert len(str(caught.value)) < 300


def test_an_image_beyond_the_limits_of_opencv_is_refused(tmp_path: Path) -> None:
    header = struct.pack('>II5B', 100_000, 100_000, 8, 0, 0, 0, 0)
    chunk = b'IHDR' + header
    (tmp_path / 'mask.png').write_bytes(
        b'\x89PNG\r\n\x1a\n'
        + struct.pack('>I', len(header))
        + chunk
        + struct.pack('>I', zlib.crc32(chunk))
    )
    with pytest.raises(ConfigurationError, match='expected an image file'):
        RoverMask.load(str(tmp_path / 'mask.png'))


def test_a_missing_or_invalid_image_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r'rover_mask is .*no such file'):
        RoverMask.load(str(tmp_path / 'none.png'))
    for content in (b'', b'not an image'):
        (tmp_path / 'mask.png').write_bytes(content)
        with pytest.raises(ConfigurationError, match='expected an image file'):
            RoverMask.load(str(tmp_path / 'mask.png'))
