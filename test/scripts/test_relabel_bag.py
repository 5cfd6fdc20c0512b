from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from rover_obstacle_detection.errors import MissingExtraError
from rover_obstacle_detection.simulation.cache import render_bag
from rover_obstacle_detection.simulation.presets import scene_of
from rover_obstacle_detection.simulation.renderer import load_mitsuba

ROOT = Path(__file__).resolve().parents[2]


def content(path):
    with AnyReader([path]) as reader:
        return {connection.topic: bytes(data) for connection, _, data in reader.messages()}


def values(data):
    return dict(
        zip(*np.unique(np.frombuffer(data, np.uint8)[-96 * 72 :], return_counts=True), strict=True)
    )


def test_only_labels_follow_the_limit(tmp_path, monkeypatch):
    try:
        load_mitsuba()
    except MissingExtraError as error:
        pytest.skip(str(error))
    monkeypatch.syspath_prepend(str(ROOT / 'scripts'))
    from relabel_bag import relabel

    parameters = {
        'width': 96,
        'sensor': {'samples': 4},
        'terrain': {'steps': [{'ahead_m': 1.0, 'rise_m': -0.2, 'width_m': 0.9}]},
    }
    rendered = tmp_path / 'scene'
    render_bag(scene_of('scene', 3, ['noon'], 'study', parameters), rendered)
    relabel(rendered, tmp_path / 'same', 0.1)
    relabel(rendered, tmp_path / 'high', 0.25)
    first, same, high = (
        content(path) for path in (rendered, tmp_path / 'same', tmp_path / 'high')
    )
    assert same == first
    changed = {topic for topic in first if high[topic] != first[topic]}
    assert changed == {'/truth/labels', '/truth/scene'}
    low, other = values(first['/truth/labels']), values(high['/truth/labels'])
    assert low[3] > 100
    assert 3 not in other
    assert other.get(1, 0) < low[1]
    assert other[2] == pytest.approx(low[2], rel=0.1)
