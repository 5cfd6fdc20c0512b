"""The script that updates the page of the blind conditions."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import update_blind_conditions
from blind_views import tiny_view
from labelled import labelled_view
from recordings import stereo_messages, write_ros2
from studies.blind_views import detector, referred_to, views
from update_blind_conditions import BLOCK, PAGE, chosen, under_all

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.errors import BagError, ImageError, UnjudgeablePairError
from rover_obstacle_detection.evaluation.blind.conditions import CONDITIONS, Condition
from rover_obstacle_detection.evaluation.blind.view import View, exchanged
from rover_obstacle_detection.evaluation.vertical import angles_deg

BAGS = Path(__file__).parents[2] / 'bags'
MOON, YARD = BAGS / 'simulated_vga_moon', BAGS / 'mars_yard'


def refuse(view: View):
    raise UnjudgeablePairError('dark')


def test_page_has_the_block_with_every_condition() -> None:
    text = PAGE.read_text(encoding='utf-8')
    assert re.findall(r'<!-- (?:begin|end) (\S+) -->', text) == [BLOCK, BLOCK]
    for condition in CONDITIONS:
        for strength in condition.strengths:
            assert f'\n| {condition.name} | {strength} |' in text


def test_conditions_are_chosen_by_name_or_group() -> None:
    assert chosen(['*']) == list(CONDITIONS)
    names = [condition.name for condition in chosen(['FOG', 'both*', 'wrong vert*'])]
    assert {'fog', 'both images flat', 'both out of focus', 'pitch too large'} < set(names)
    assert 'noise' not in names
    assert chosen(['nothing like it']) == []


def test_every_view_is_judged_under_each_strength() -> None:
    condition = Condition('g', 'c', {'as it is': lambda view: view, 'never': lambda view: None})
    results = under_all([condition], [tiny_view(), tiny_view()], refuse)
    assert [(each.strength, len(each.views), each.refused) for each in results] == [
        ('as it is', 2, 2),
        ('never', 0, 0),
    ]


def test_views_have_the_next_pair_as_another_moment() -> None:
    judge = detector(DetectorConfig())
    yard, moon = views([YARD, MOON], judge, frames=1)
    assert yard.left.shape == yard.other.shape == (768, 1024)
    assert moon.left.shape == moon.other.shape == (300, 400)
    assert np.isfinite(moon.depth_m).any()
    # The moon's pose is recorded; the yard's is estimated.
    assert moon.up is not None
    assert angles_deg(moon.up.up)[0] == pytest.approx(24.07, abs=0.01)
    assert yard.up is not None
    assert angles_deg(yard.up.up)[0] == pytest.approx(46, abs=2)
    (alone,) = views([MOON], judge)
    np.testing.assert_array_equal(alone.other, alone.right[::-1, ::-1])
    # Without an estimate there is no vertical, but still the truth.
    (dark,) = views([YARD], refuse, frames=1)
    assert dark.up is None
    assert np.isfinite(dark.depth_m).any()


def test_undamaged_detection_is_the_truth_of_unlabelled_pairs() -> None:
    frame = labelled_view()
    detection = Detector(frame.camera).detect(frame.left, frame.right)
    referred = referred_to(frame, detection)
    obstacle = detection.mask == 255
    assert obstacle.any()
    assert not detection.known.all()
    np.testing.assert_array_equal(referred.labels == 1, obstacle)
    np.testing.assert_array_equal(referred.labels == 255, ~detection.known & ~obstacle)
    both = np.isfinite(referred.depth_m) & np.isfinite(frame.depth_m)
    error = np.abs(referred.depth_m[both] - frame.depth_m[both]) / frame.depth_m[both]
    assert np.median(error) < 0.02
    assert np.isnan(referred.depth_m[~detection.known]).all()


def test_recording_needs_no_labels(tmp_path: Path) -> None:
    bag = write_ros2(tmp_path / 'bare', stereo_messages(2))
    first, second = views([bag], refuse)
    np.testing.assert_array_equal(first.other, second.right)
    # The reference was refused, so nothing is known to be true.
    assert (first.labels == 255).all()
    assert np.isnan(first.depth_m).all()
    shape = first.camera.shape
    answer = SimpleNamespace(
        known=np.ones(shape, bool),
        mask=np.zeros(shape, np.uint8),
        disparity=np.full(shape, 2, np.float32),
        ground=SimpleNamespace(up=(0.0, -1.0, 0.0)),
    )
    answer.mask[:4] = 255
    judged, _ = views([bag], lambda view: answer)
    assert (judged.labels[:4] == 1).all()
    assert (judged.labels[4:] == 0).all()
    assert judged.depth_m == pytest.approx(judged.camera.depth_m(2))
    assert judged.up is not None
    assert judged.up.up == (0.0, -1.0, 0.0)


def test_recording_that_cannot_be_used_is_named(tmp_path: Path) -> None:
    with pytest.raises(BagError, match='missing'):
        views([tmp_path / 'missing'], refuse)


def test_detector_refuses_exchanged_images() -> None:
    judge = detector(DetectorConfig())
    (moon,) = views([MOON], judge)
    assert judge(moon).known.mean() > 0.5
    with pytest.raises(ImageError, match='swapped'):
        judge(exchanged(moon))


def test_page_and_json_are_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page, figures = tmp_path / 'page.md', tmp_path / 'figures.json'
    page.write_text(f'a\n<!-- begin {BLOCK} -->\nold\n<!-- end {BLOCK} -->\nb\n')
    call = ['x', '--bags', str(MOON), '--conditions', 'undamaged', '--page', str(page)]
    monkeypatch.setattr(sys, 'argv', call)
    update_blind_conditions.main()
    text = page.read_text()
    assert text.startswith('a\n')
    assert text.endswith('b\n')
    assert 'old' not in text
    assert '1 pair of `simulated_vga_moon`.' in text
    assert '| undamaged | true gravity given | 0/1 |' in text
    page.write_text('untouched')
    monkeypatch.setattr(sys, 'argv', [*call, '--print', '--json', str(figures)])
    update_blind_conditions.main()
    assert page.read_text() == 'untouched'
    assert '| undamaged | gravity estimated |' in capsys.readouterr().out
    rows = json.loads(figures.read_text())
    assert [row['strength'] for row in rows] == ['gravity estimated', 'true gravity given']
    assert 0.5 < rows[0]['free'] < 1
    monkeypatch.setattr(sys, 'argv', [*call[:4], 'none of them'])
    with pytest.raises(SystemExit, match='no condition matches none of them'):
        update_blind_conditions.main()
