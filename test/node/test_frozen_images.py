from __future__ import annotations

from array import array

import numpy as np
import pytest

from rover_obstacle_detection.node.frozen_images import FrozenImages

PERIOD_NS = 100_000_000
START_NS = 1_000_000_000_000


def noise(seed: int, size: int = 64 * 48) -> bytes:
    return np.random.default_rng(seed).integers(0, 256, size, np.uint8).tobytes()


class Pairs:
    """A stream at 10 Hz; sides that are not frozen are new in every pair."""

    def __init__(self, limit: int = 10) -> None:
        self.images = FrozenImages(limit)
        self.number = 0

    def send(self, count: int, *, left: bytes | None = None, right: bytes | None = None) -> str:
        text = ''
        for _ in range(count):
            self.number += 1
            images = left or noise(2 * self.number), right or noise(2 * self.number + 1)
            text = self.images.check(images, START_NS + self.number * PERIOD_NS)
        return text


@pytest.mark.parametrize(
    ('frozen', 'words'),
    [
        ({'left': noise(0)}, 'left image has'),
        ({'right': noise(0)}, 'right image has'),
        ({'left': noise(0), 'right': noise(1)}, 'left and right images have'),
    ],
)
def test_repeated_image_is_named_with_its_duration(frozen: dict[str, bytes], words: str) -> None:
    pairs = Pairs()
    pairs.send(5)

    assert pairs.send(10, **frozen) == ''
    assert pairs.send(3, **frozen) == (
        f'{words} not changed for 12 frames (1.2 s): the camera or its driver is frozen'
    )
    assert pairs.send(1) == ''


def test_shorter_freeze_is_named_if_both_images_repeat() -> None:
    pairs = Pairs()
    pairs.send(10, left=noise(0))

    text = pairs.send(15, left=noise(0), right=noise(1))

    assert text.startswith('left and right images have not changed for 14 frames (1.4 s)')


def test_one_changed_byte_is_a_new_image() -> None:
    size = 1024 * 768
    images = [np.frombuffer(noise(0, size), np.uint8).copy() for _ in range(2)]
    # Not among the bytes that are compared first.
    images[1][1] ^= 1
    pairs = Pairs(limit=2)

    for number in range(9):
        assert pairs.send(1, left=images[number % 2].tobytes()) == ''


def test_message_data_of_rclpy_is_compared() -> None:
    pairs = Pairs(limit=2)

    texts = [pairs.send(1, left=array('B', noise(0))) for _ in range(3)]

    assert texts[:2] == ['', '']
    assert texts[2].startswith('left image has not changed for 2 frames')


def test_image_of_another_size_is_a_new_image() -> None:
    pairs = Pairs(limit=1)
    pairs.send(1, left=noise(0, 3000))

    assert pairs.send(1, left=noise(0, 3001)) == ''


@pytest.mark.parametrize('data', [bytes(3000), b'\xff' * 3000, array('B')])
def test_image_without_any_content_is_left_to_the_detector(data: bytes) -> None:
    pairs = FrozenImages(1)

    assert not any(
        pairs.check((data, data), START_NS + number * PERIOD_NS) for number in range(20)
    )


def test_pair_that_is_sent_twice_counts_once() -> None:
    images = FrozenImages(1)

    assert [images.check((noise(0), noise(1)), START_NS) for _ in range(5)] == [''] * 5
    assert images.check((noise(0), noise(1)), START_NS + PERIOD_NS)


def test_restart_of_a_recording_begins_anew() -> None:
    pairs = Pairs(limit=4)
    for _ in range(5):
        pairs.number = 0
        # The last pair of a round equals the first of the next.
        assert pairs.send(4, left=noise(0)) == ''
