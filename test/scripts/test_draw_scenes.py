from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import pytest

from rover_obstacle_detection.simulation.presets import scene_of
from rover_obstacle_detection.simulation.rigs import RIGS
from rover_obstacle_detection.simulation.suite import load_suite

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def scripts(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / 'scripts'))


@cache
def suite_scenes(suite):
    return load_suite(suite)


@pytest.mark.parametrize(('suite', 'prefix'), [('drawn', 'drawn'), ('training', 'train')])
def test_script_reproduces_the_suites(suite, prefix):
    from draw_scenes import random_scene

    scenes = [scene for scene in suite_scenes(suite) if scene.seed >= 2000]
    assert len(scenes) > 20
    for scene in scenes[::5]:
        assert scene == scene_of(**random_scene(scene.seed, prefix))


def test_script_reproduces_the_wide_suite():
    from draw_scenes import LANDFORM_WEIGHTS, random_wide_scene

    scenes = suite_scenes('training_wide')
    assert len(scenes) == 120
    for scene in scenes[::5]:
        assert scene == scene_of(**random_wide_scene(scene.seed, 'wide'))
    names = {name for scene in scenes for name in scene.conditions}
    assert names >= {*LANDFORM_WEIGHTS} - {''}


def test_training_tuning_and_reporting_suites_share_no_seed():
    seeds = [
        scene.seed
        for suite in ('training', 'training_wide', 'standard', 'drawn', 'hazards', 'unseen')
        for scene in suite_scenes(suite)
    ]
    assert len(seeds) > 550
    assert len(seeds) == len(set(seeds))


def test_drawn_rigs_differ_from_the_named_rigs():
    for scene in suite_scenes('drawn'):
        rig, named = scene.rig_used(), RIGS[scene.rig]
        assert rig.baseline_m != named.baseline_m
        assert rig.horizontal_view_deg != named.horizontal_view_deg
        assert 0.6 < rig.camera_height_m / named.camera_height_m < 1.5


def test_printed_lines_form_a_suite(monkeypatch, capsys, tmp_path):
    import draw_scenes

    monkeypatch.setattr(sys, 'argv', ['x', '7', '3', '--prefix', 'mine'])
    draw_scenes.main()
    path = tmp_path / 'mine.yaml'
    path.write_text('scenes:\n' + capsys.readouterr().out)
    assert [scene.seed for scene in load_suite(str(path))] == [7, 8, 9]
    assert all(scene.name.startswith('mine_') for scene in load_suite(str(path)))
