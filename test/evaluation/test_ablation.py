"""The hybrid without a stage as a method."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from rover_obstacle_detection.detection import hybrid
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.evaluation.methods import detector_method
from rover_obstacle_detection.evaluation.methods.ablation import ablated_methods, left_out_stage
from rover_obstacle_detection.evaluation.methods.names import METHOD_DESCRIPTIONS
from rover_obstacle_detection.evaluation.methods.registry import make_method


@pytest.fixture
def stages(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, object]]:
    """Two optional stages, and a detector that records its arguments."""
    made = []

    def detector(camera, config, **changes):
        made.append({'method': config.method, **changes})
        blank = SimpleNamespace(mask=np.zeros((2, 2), np.uint8))
        return SimpleNamespace(camera=camera, detect=lambda left, right: blank)

    monkeypatch.setattr(hybrid, 'OPTIONAL_STAGES', ('regions', 'outlines'), raising=False)
    monkeypatch.setattr(detector_method, 'Detector', detector)
    return made


def test_stage_is_left_out_by_name(stages: list[dict[str, object]]) -> None:
    assert ablated_methods() == ('hybrid', 'hybrid without regions', 'hybrid without outlines')
    assert left_out_stage('hybrid without regions') == 'regions'
    assert left_out_stage('hybrid without taste') is None
    assert left_out_stage('regions') is None
    for name in ablated_methods()[:2]:
        make_method(name, DetectorConfig(method='study'))(None, None, None)
    assert stages == [
        {'method': 'hybrid'},
        {'method': 'hybrid', 'leave_out': frozenset({'regions'})},
    ]


def test_unknown_stage_is_refused(stages: list[dict[str, object]]) -> None:
    with pytest.raises(ConfigurationError, match="method is 'hybrid without taste'"):
        make_method('hybrid without taste')
    assert not set(ablated_methods()[1:]) & set(METHOD_DESCRIPTIONS)
