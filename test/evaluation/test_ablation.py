"""The hybrid without a stage, and the tables of what goes wrong."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from studies.fault_tables import (
    ablation_table,
    causes_table,
    losses_table,
)

from rover_obstacle_detection.detection import hybrid
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.evaluation.causes import Cause
from rover_obstacle_detection.evaluation.faults import Fault
from rover_obstacle_detection.evaluation.figures import Figures
from rover_obstacle_detection.evaluation.losses import Losses
from rover_obstacle_detection.evaluation.methods import detector_method
from rover_obstacle_detection.evaluation.methods.ablation import ablated_methods, left_out_stage
from rover_obstacle_detection.evaluation.methods.names import METHOD_DESCRIPTIONS
from rover_obstacle_detection.evaluation.methods.registry import make_method
from rover_obstacle_detection.evaluation.results import Evaluation, FrameResult, SceneResult
from rover_obstacle_detection.evaluation.tables import method_table

FAR = Cause('outside the judged range', 'max_range is 20 m')


@pytest.fixture
def stages(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, object]]:
    """Two optional stages, and a detector that only keeps what it was made with."""
    made = []

    def detector(camera, config, **changes):
        made.append({'method': config.method, **changes})
        blank = SimpleNamespace(mask=np.zeros((2, 2), np.uint8))
        return SimpleNamespace(camera=camera, detect=lambda left, right: blank)

    monkeypatch.setattr(hybrid, 'OPTIONAL_STAGES', ('regions', 'outlines'), raising=False)
    monkeypatch.setattr(detector_method, 'Detector', detector)
    return made


def test_a_stage_is_left_out_by_name(stages: list[dict[str, object]]) -> None:
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


def test_stages_that_cannot_be_left_out_are_no_methods(stages: list[dict[str, object]]) -> None:
    with pytest.raises(ConfigurationError, match="method is 'hybrid without taste'"):
        make_method('hybrid without taste')
    assert not set(ablated_methods()[1:]) & set(METHOD_DESCRIPTIONS)


def result(method: str, scene: str, hits: int, *faults: Fault, **figures: int) -> SceneResult:
    counts = Figures(frames=1, true_positives=hits, false_negatives=100 - hits, rocks=4, **figures)
    losses = Losses(hit=hits, missed=80 - hits, too_wide=20, outline=10)
    frame = FrameResult(0, counts, 0.2, 0.1, losses, faults)
    return SceneResult(method, scene, (f'in {scene}',), (frame,))


def evaluation() -> Evaluation:
    far = [Fault('missed rock', pixels, 21.0, FAR) for pixels in (300, 200)]
    return Evaluation(
        scenes=(
            result('hybrid', 'noon', 80, *far, rocks_found=3),
            result('hybrid', 'moon', 60, Fault('false alarm', 900, 2.0), far[0], false_alarms=1),
            result('hybrid without regions', 'noon', 70, rocks_found=2),
            result('hybrid without regions', 'moon', 50),
        )
    )


def test_what_a_stage_is_good_for() -> None:
    assert ablation_table(evaluation(), 'hybrid').rows == [
        ('hybrid', '0.700', '+0.000', '3/8', '0.50', 'in moon: 0.600'),
        ('hybrid without regions', '0.600', '-0.100', '2/8', '0.00', 'in moon: 0.500'),
    ]


def test_faults_are_counted_by_cause() -> None:
    assert causes_table(evaluation(), 'hybrid').rows == [
        ('missed rock', 'outside the judged range', '3', '800'),
        ('false alarm', '-', '1', '900'),
    ]


def test_what_the_overlap_lost() -> None:
    nothing = SceneResult('hybrid', 'flat', (), (FrameResult(0, Figures(frames=1), 0.2, 0.1),))
    known = Evaluation(scenes=(*evaluation().scenes, nothing))
    assert losses_table(known, 'hybrid').rows == [
        ('noon', '0.800', '0.000', '0.000', '0.200 (2.0 px)', '0.000 (0.0 px)'),
        ('moon', '0.600', '0.200', '0.000', '0.200 (2.0 px)', '0.000 (0.0 px)'),
    ]


def test_times_can_be_left_out_of_the_method_table() -> None:
    with_times, without = method_table(evaluation()), method_table(evaluation(), with_times=False)
    assert with_times.header[-2:] == ('ms', 'x SGBM')
    assert without.header == with_times.header[:-2]
    assert without.rows[0] == with_times.rows[0][:-2]
