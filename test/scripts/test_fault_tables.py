"""Tables of faults, losses and ablations."""

from __future__ import annotations

from studies.fault_tables import ablation_table, causes_table, losses_table

from rover_obstacle_detection.evaluation.causes import Cause
from rover_obstacle_detection.evaluation.faults import Fault
from rover_obstacle_detection.evaluation.figures import Figures
from rover_obstacle_detection.evaluation.losses import Losses
from rover_obstacle_detection.evaluation.results import Evaluation, FrameResult, SceneResult

FAR = Cause('beyond the detection range', 'max_range 20 m')


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
            result('hybrid without slope', 'noon', 70, rocks_found=2),
            result('hybrid without slope', 'moon', 50),
        )
    )


def test_ablation_shows_what_each_stage_contributes() -> None:
    assert ablation_table(evaluation(), 'hybrid').rows == [
        ('hybrid', '0.700', '+0.000', '3/8', '0.50', 'in moon: 0.600'),
        ('hybrid without slope', '0.600', '-0.100', '2/8', '0.00', 'in moon: 0.500'),
    ]


def test_faults_are_counted_by_cause() -> None:
    assert causes_table(evaluation(), 'hybrid').rows == [
        ('missed rock', 'beyond the detection range', '3', '800'),
        ('false alarm', '-', '1', '900'),
    ]


def test_losses_by_scene() -> None:
    nothing = SceneResult('hybrid', 'flat', (), (FrameResult(0, Figures(frames=1), 0.2, 0.1),))
    known = Evaluation(scenes=(*evaluation().scenes, nothing))
    assert losses_table(known, 'hybrid').rows == [
        ('noon', '0.800', '0.000', '0.000', '0.200 (2.0 px)', '0.000 (0.0 px)'),
        ('moon', '0.600', '0.200', '0.000', '0.200 (2.0 px)', '0.000 (0.0 px)'),
    ]
