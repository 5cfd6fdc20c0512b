"""The short examples of docs/testing.md: one runs, the one that needs ROS 2 from apt compiles."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import pytest

from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.messages.image import decode_image

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope='module')
def blocks() -> list[str]:
    page = (ROOT / 'docs' / 'testing.md').read_text(encoding='utf-8')
    return re.findall(r'^```python\n(.*?)^```', page, re.MULTILINE | re.DOTALL)


def write_first_pair(folder: Path) -> None:
    topics = [f'/stereo/{side}/image_rect' for side in ('left', 'right')]
    with open_bag(ROOT / 'bags' / 'mars_yard') as bag:
        for topic in topics:
            message = next(message for _, _, message in bag.messages((topic,)))
            image = decode_image(message, topic)
            assert cv2.imwrite(str(folder / f'{topic.split("/")[2]}.png'), image)


def test_example_without_ros_finds_the_rock(
    blocks: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_first_pair(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert 'assert' in blocks[0]
    names: dict[str, object] = {}
    exec(blocks[0], names)
    assert 'detection' in names


def test_example_with_launch_testing_compiles(blocks: list[str]) -> None:
    (example,) = (each for each in blocks if 'generate_test_description' in each)
    compile(example, 'docs/testing.md', 'exec')
