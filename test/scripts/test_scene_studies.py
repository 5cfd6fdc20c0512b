"""Studies of labelled scenes: disparity, gravity and reliability."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from labelled import labelled_view, write_labelled
from studies.disparity_error import DisparityErrors
from studies.disparity_study import (
    SceneDisparity,
    frame_errors,
    pair_table,
    scenes_table,
    summed,
)
from studies.gravity_study import (
    GravityFrame,
    SceneGravity,
    compare_gravity,
    gravity_scene_table,
    gravity_table,
)
from studies.scene_studies import (
    evaluate_scene,
    study_disparity,
    study_gravity,
    study_reliability,
)
from synthetic import Plane

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.errors import BagError
from rover_obstacle_detection.evaluation.figures import Figures
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.runner import RunOptions
from rover_obstacle_detection.evaluation.vertical import angle_between_deg, angles_deg

BAGS = Path(__file__).parents[2] / 'bags'
CONFIG = DetectorConfig()


def test_both_matchers_are_close_to_the_truth() -> None:
    errors = frame_errors(labelled_view(), CONFIG)
    assert set(errors) == {
        (part, matcher) for part in ('ground', 'rocks') for matcher in ('hybrid', 'plain SGBM')
    }
    for found in errors.values():
        assert found.median_px < 0.3
        assert found.density > 0.7
    twice = summed([errors, errors])
    key = ('rocks', 'hybrid')
    assert twice[key].matched == 2 * errors[key].matched


def test_frame_without_ground_truth_is_not_compared() -> None:
    frame = labelled_view()
    bare = LabelledFrame(1, frame.camera, frame.left, frame.right, frame.labels, frame.instances)
    assert frame_errors(bare, CONFIG) == {}
    assert compare_gravity(bare, CONFIG) is None


def test_disparity_tables() -> None:
    exact = DisparityErrors.of(
        np.array([[5.0, 6.0, 0.0]], np.float32),
        np.array([[5.0, 5.0, 5.0]], np.float32),
        np.ones((1, 3), bool),
    )
    table = pair_table({('all', 'hybrid'): exact})
    assert table.rows == [
        ('all', 'hybrid', '66.7 %', '50.0 %', '50.0 %', '0.0 %', '0.02', '0.50'),
    ]
    scene = SceneDisparity('one', (), {('ground', 'hybrid'): exact})
    assert scenes_table({'noon': [scene, scene], 'moon': []}).rows == [
        ('noon', '2', '0.02 / 0.50, 66.7 %', '-', '-', '-'),
        ('moon', '0', '-', '-', '-', '-'),
    ]


@pytest.mark.parametrize(('pitch', 'roll'), [(46.0, 0.0), (-10.0, 7.0), (0.0, -3.0)])
def test_pitch_and_roll_of_a_vertical(pitch: float, roll: float) -> None:
    gravity = Gravity.from_angles(pitch, roll)
    assert angles_deg(gravity.up) == pytest.approx((pitch, roll))
    assert angle_between_deg(gravity, gravity.up) == pytest.approx(0.0, abs=1e-5)


def test_angle_between_verticals() -> None:
    level = Gravity.from_angles(10.0)
    assert angle_between_deg(level, Gravity.from_angles(13.0).up) == pytest.approx(3.0)


def test_slope_that_fills_the_view_is_found_only_with_known_gravity() -> None:
    frame = labelled_view(planes=(Plane.uphill(26.0),), solids=())
    labels = np.full(frame.labels.shape, 2, np.uint8)
    frame = LabelledFrame(
        **{**vars(frame), 'labels': labels, 'instances': np.zeros(labels.shape, np.uint16)}
    )
    compared = compare_gravity(frame, CONFIG, 1.0)
    assert compared is not None
    assert compared.pitch_deg == pytest.approx(frame_pitch(frame))
    assert compared.pitch_error_deg == pytest.approx(26.0, abs=2.0)
    assert compared.roll_error_deg == pytest.approx(0.0, abs=1.0)
    assert compared.known.recall > 0.6
    assert compared.estimated.recall < 0.1


def frame_pitch(frame: LabelledFrame) -> float:
    return angles_deg(frame.gravity.up)[0]


def compared(known: int, estimated: int, error_deg: float) -> GravityFrame:
    figures = (
        Figures(frames=1, true_positives=hits, false_negatives=10 - hits, rocks=1)
        for hits in (known, estimated)
    )
    return GravityFrame(*figures, 20.0, 1.0, error_deg, -0.5)


def test_gravity_tables() -> None:
    one = SceneGravity('one', ('noon',), (compared(8, 4, -2.0),))
    two = SceneGravity('two', ('noon',), (compared(6, 6, 1.0), compared(6, 6, 3.0)))
    none = SceneGravity('three', ('moon',), ())
    rows = gravity_table({'noon': [one, two], 'moon': [none]}).rows
    assert rows[0] == (
        'noon', '2', '0.700', '0.500', '+0.200', '0/3', '0.00', '0/3', '0.00', '2.0',
    )  # fmt: skip
    assert rows[1][2:5] == ('-', '-', '-')
    by_scene = gravity_scene_table([one, two, none])
    assert len(by_scene.header) == len(by_scene.rows[0])
    assert by_scene.rows[0][-4:] == ('20.0', '-2.0', '1.0', '-0.5')
    assert [row[0] for row in by_scene.rows] == ['one', 'two']
    assert by_scene.rows[1][-3] == '+3.0', 'error of the worst frame'


def test_gravity_of_a_simulated_bag() -> None:
    scene = study_gravity(BAGS / 'simulated_study_noon', CONFIG)
    assert scene.scene == 'simulated_study_noon'
    assert scene.conditions == ('noon', 'rig study')
    (frame,) = scene.frames
    assert frame.pitch_deg == pytest.approx(46.0, abs=3.0)
    assert abs(frame.pitch_error_deg) < 5.0
    assert frame.known.frames == frame.estimated.frames == 1


def test_disparity_of_a_simulated_bag() -> None:
    scene = study_disparity(BAGS / 'simulated_vga_moon', CONFIG)
    assert 'moon' in scene.conditions
    assert scene.errors['ground', 'hybrid'].density > 0.8
    assert scene.errors['ground', 'hybrid'].median_px < 0.4


def test_bag_without_a_pose_has_no_gravity_frames() -> None:
    assert study_gravity(BAGS / 'mars_yard', CONFIG).frames == ()


def test_unusable_frame_is_an_error(tmp_path: Path) -> None:
    labels = np.full((24, 32), 9, np.uint8)
    bag = write_labelled(tmp_path / 'bag', labels=labels)
    for study in (study_disparity, study_gravity):
        with pytest.raises(BagError, match='has the value 9'):
            study(bag, CONFIG)
    with pytest.raises(BagError, match='has the value 9'):
        evaluate_scene(bag, RunOptions(['hybrid'], CONFIG))


def test_reliability_of_a_simulated_bag() -> None:
    judged = study_reliability(BAGS / 'simulated_study_noon', CONFIG)
    assert len(judged.real) == len(judged.confidence) > 2
    assert judged.real.mean() > 0.5
