from __future__ import annotations

import pytest

from rover_obstacle_detection.cli import arguments
from rover_obstacle_detection.messages.raw_images import (
    ALWAYS,
    NEVER,
    RECTIFY,
    are_raw,
    is_named_rectified,
)


@pytest.mark.parametrize(
    'topic',
    [
        'left/image_rect',
        '/stereo/left/image_rect_color/compressed',
        '/camera/infra1/image_rect_raw',
        '/zed/zed_node/left/color/rect/image',
        '/zed/zed_node/left/color/rect/image/compressed',
        '/Left/Rectified/image',
        '/left/rectified_image',
        '/left/rect',
        '/rectified/left/image_rect_raw',
    ],
)
def test_rect_in_the_name_means_rectified(topic):
    assert is_named_rectified(topic)


@pytest.mark.parametrize(
    'topic',
    [
        'left/image_raw',
        '/left/image',
        '/left/image_raw/compressed',
        '/zed/zed_node/left/color/raw/image',
        # What only contains the word, such as a namespace, says nothing of the image.
        '/rectangle/left/image',
        '/correctly/left/image_raw',
        '/left/image_unrectified',
        '/left/rect/image_unrect',
        '/left/direct_image',
        '/left/rectangle_image',
        # The image's own name counts more than its folder.
        '/rectified/left/image_raw',
        '/rectified/left/raw/compressed',
    ],
)
def test_other_names_mean_raw(topic):
    assert not is_named_rectified(topic)


def test_one_raw_image_makes_a_raw_pair_and_the_user_decides():
    raw, rectified = '/l/image_raw', '/r/image_rect'
    assert are_raw(raw, rectified)
    assert are_raw(raw, raw)
    assert not are_raw(rectified, rectified)
    assert are_raw(rectified, rectified, ALWAYS)
    assert not are_raw(raw, raw, NEVER)


def test_command_line_offers_every_choice():
    assert arguments.RECTIFY == RECTIFY
