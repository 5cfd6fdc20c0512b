"""The README's picture is what the detector draws."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.bags.stereo import read_pairs
from rover_obstacle_detection.pictures import RED

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def script(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / 'scripts'))
    import make_readme_picture

    return make_readme_picture


@pytest.fixture
def left_image(script):
    with open_bag(script.BAG) as bag:
        return next(read_pairs(bag, bag.stereo_topics())).left


def test_obstacles_are_drawn_in_red_over_the_left_image(script, left_image, tmp_path):
    output = tmp_path / 'overlay.png'
    detection = script.draw(script.BAG, output)
    picture = cv2.imread(str(output))
    height, width = left_image.shape[:2]
    assert picture.shape[1] == width
    assert height < picture.shape[0] < 1.1 * height, 'the key is a strip below the image'

    obstacle = detection.mask > 0
    assert 0.02 < obstacle.mean() < 0.5
    # The outline is black and red, three pixels to each side of the border.
    inside = cv2.erode(detection.mask, np.ones((7, 7), np.uint8)) > 0
    tint = 0.6 * left_image + 0.4 * np.array(RED)
    is_tinted = (np.abs(picture[:height] - tint) <= 1).all(axis=-1)
    assert is_tinted[inside].mean() > 0.9, 'only labels cover tinted pixels'
    free = detection.known & ~obstacle
    far_from_outlines = free & (cv2.dilate(detection.mask, np.ones((9, 9), np.uint8)) == 0)
    assert is_tinted[far_from_outlines].mean() < 0.01, 'free ground keeps its colours'
    changed = (picture[:height] != left_image).any(axis=-1)
    assert changed[far_from_outlines].mean() < 0.15, 'only labels reach into free ground'


def test_command_line_writes_the_same_picture_each_time(script, monkeypatch, tmp_path):
    written = []
    for name in ('one.png', 'two.png'):
        monkeypatch.setattr(sys, 'argv', ['make_readme_picture.py', str(tmp_path / name)])
        assert script.main() == 0
        written.append((tmp_path / name).read_bytes())
    assert written[0] == written[1]
    assert sorted(path.name for path in tmp_path.iterdir()) == ['one.png', 'two.png']


def test_the_shipped_picture_is_up_to_date(script, monkeypatch, tmp_path, capsys):
    shipped = str(ROOT / 'docs' / 'images' / 'overlay.png')
    arguments = ['make_readme_picture.py', str(tmp_path / 'new.png'), '--compare', shipped]
    monkeypatch.setattr(sys, 'argv', arguments)
    assert script.main() == 0, capsys.readouterr().err


@pytest.mark.parametrize('change', ['smaller', 'another rock', 'a rock less'])
def test_a_picture_with_other_obstacles_is_out_of_date(
    script, monkeypatch, tmp_path, capsys, change
):
    drawn, stale = tmp_path / 'drawn.png', tmp_path / 'stale.png'
    detection = script.draw(script.BAG, drawn)
    picture = cv2.imread(str(drawn))
    if change == 'smaller':
        picture = picture[:-1]
    elif change == 'another rock':
        cv2.circle(picture, (250, 150), 22, RED, cv2.FILLED)
    else:
        picture[: detection.mask.shape[0], : picture.shape[1] // 5] = 128
    cv2.imwrite(str(stale), picture)

    arguments = ['make_readme_picture.py', str(tmp_path / 'new.png'), '--compare', str(stale)]
    monkeypatch.setattr(sys, 'argv', arguments)
    assert script.main() == 1
    assert f'{stale} is out of date: it agrees in ' in capsys.readouterr().err
