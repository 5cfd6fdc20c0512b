"""The short Python examples of the pages: they run; the one that needs ROS 2 from apt compiles."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import cv2
import pytest

from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.messages.image import decode_image

ROOT = Path(__file__).parents[1]


LENS = """\
  intrinsics: [665.1, 665.1, 511.5, 383.5]
  resolution: [1024, 768]
  distortion_model: none
  distortion_coeffs: []
"""
CAMCHAIN = f"""\
cam0:
{LENS}
cam1:
{LENS}
  T_cn_cnm1: [[1, 0, 0, -0.06], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
"""


def python_blocks(page: str) -> list[str]:
    text = (ROOT / 'docs' / page).read_text(encoding='utf-8')
    return re.findall(r'^```python\n(.*?)^```', text, re.MULTILINE | re.DOTALL)


@pytest.fixture(scope='module')
def blocks() -> list[str]:
    return python_blocks('testing.md')


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


def test_example_with_a_calibration_file_saves_and_loads_a_detection(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_first_pair(tmp_path)
    (tmp_path / 'camchain.yaml').write_text(CAMCHAIN)
    monkeypatch.chdir(tmp_path)
    (example,) = python_blocks('getting_started.md')
    names: dict[str, Any] = {}
    exec(example, names)
    assert names['detection'].camera.baseline_m == pytest.approx(0.06)
    assert (names['detection'].mask[185:245, 760:840] == 255).mean() > 0.8
