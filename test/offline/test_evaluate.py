"""Evaluate methods on labelled recordings."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from labelled import ROCK, SHAPE, labels, truth, write_labelled
from recordings import START_NS, image, stereo_messages, write_ros2

from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.errors import BagError, NothingDoneError, UnjudgeablePairError
from rover_obstacle_detection.evaluation.figures import Figures
from rover_obstacle_detection.evaluation.methods import registry
from rover_obstacle_detection.evaluation.methods.detector_method import DetectorMethod
from rover_obstacle_detection.evaluation.results import Evaluation
from rover_obstacle_detection.evaluation.runner import CURVE_FACTORS, RunOptions
from rover_obstacle_detection.offline.evaluate import (
    BagOptions,
    condition_in,
    evaluate_bag,
    evaluate_bags,
    scene_names,
)
from rover_obstacle_detection.offline.labelled_bag import find_truth_topics

OPTIONS = RunOptions(['hybrid'], DetectorConfig())


@pytest.fixture(autouse=True)
def hand_made_methods(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace the methods: hybrid flags the upper half of the rock, study nothing."""

    def half(camera, left, right):
        assert left.shape == right.shape == camera.shape
        mask = np.zeros(SHAPE, np.uint8)
        mask[4:12, 2:18] = 255
        return mask

    monkeypatch.setitem(registry.METHODS, 'hybrid', lambda config: half)
    monkeypatch.setitem(
        registry.METHODS, 'study', lambda config: lambda *_: np.zeros(SHAPE, np.uint8)
    )


def evaluated(path: Path, options: RunOptions = OPTIONS, **bag_options) -> Evaluation:
    return evaluate_bag(path, options, BagOptions(**bag_options), lambda done, expected: None)


def test_figures_of_a_small_recording(tmp_path: Path) -> None:
    evaluation = evaluated(write_labelled(tmp_path / 'report_03_noon'))
    (result,) = evaluation.scenes
    assert (result.method, result.scene, result.conditions) == (
        'hybrid',
        'report_03_noon',
        ('noon',),
    )
    one = Figures(
        frames=1,
        true_positives=128,
        false_negatives=128,
        true_negatives=23 * 32 - 256,
        rocks=1,
        rocks_found=1,
    )
    assert [frame.figures for frame in result.frames] == [one, one]
    assert result.frames[0].stamp_ns == START_NS
    assert result.figures.iou == 0.5
    assert evaluation.problems == ()
    assert evaluation.by_range('hybrid')[3] == one + one, 'all at 2.5 m'


def test_every_method_runs_on_every_frame(tmp_path: Path) -> None:
    options = RunOptions(['hybrid', 'study'], DetectorConfig())
    evaluation = evaluated(write_labelled(tmp_path / 'bag', frames=3), options)
    assert evaluation.methods == ('hybrid', 'study')
    assert [len(result.frames) for result in evaluation.scenes] == [3, 3]
    assert evaluation.scenes[1].figures.recall == 0.0
    assert all(frame.seconds > 0 for frame in evaluation.scenes[0].frames)


def test_pair_that_cannot_be_judged_is_all_unknown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Blind(DetectorMethod):
        def detect(self, camera, left, right):
            raise UnjudgeablePairError('both images are black')

    monkeypatch.setitem(registry.METHODS, 'hybrid', Blind)

    (result,) = evaluated(write_labelled(tmp_path / 'bag')).scenes

    assert len(result.frames) == 2
    assert (result.figures.rocks, result.figures.rocks_found) == (2, 0)
    assert (result.figures.called_free, result.figures.checked_obstacle_pixels) == (0, 512)


def test_only_every_nth_frame_is_evaluated(tmp_path: Path) -> None:
    evaluation = evaluated(write_labelled(tmp_path / 'bag', frames=3), every=2)
    assert len(evaluation.scenes[0].frames) == 2


def test_the_curve_covers_methods_with_a_clearance_only(tmp_path: Path) -> None:
    seen = []
    registry.METHODS['hybrid'] = lambda config: (
        seen.append(config.max_step) or (lambda *_: np.zeros(SHAPE, np.uint8))
    )
    options = RunOptions(['hybrid', 'study'], DetectorConfig(max_step=0.2), curve=True)
    evaluation = evaluated(write_labelled(tmp_path / 'bag'), options)
    assert list(evaluation.curves) == ['hybrid']
    assert sorted(evaluation.curves['hybrid']) == [
        pytest.approx(0.2 * factor) for factor in CURVE_FACTORS
    ]
    assert evaluation.curves['hybrid'][0.2].frames == 2


def test_pictures_are_kept_of_the_worst_frames(tmp_path: Path) -> None:
    options = RunOptions(['hybrid', 'study'], DetectorConfig(), worst_pictures=1)
    pictures = evaluated(write_labelled(tmp_path / 'bag'), options).pictures
    assert [picture.method for picture in pictures] == ['hybrid', 'study']
    hybrid, study = (picture.frame for picture in pictures)
    assert (hybrid.faults, hybrid.losses.too_narrow) == ((), 128)
    assert [str(fault) for fault in study.faults] == ['missed rock of 256 px at 2.5 m']
    assert study.losses.missed == 256
    decoded = cv2.imdecode(np.frombuffer(pictures[0].jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert decoded.shape == (*SHAPE, 3)


def test_without_instances_connected_rock_is_one_rock(tmp_path: Path) -> None:
    evaluation = evaluated(write_labelled(tmp_path / 'bag', instances=None))
    assert evaluation.scenes[0].figures.rocks == 2, 'one in each frame'


def test_figures_by_distance_need_depth(tmp_path: Path) -> None:
    evaluation = evaluated(write_labelled(tmp_path / 'bag', depth=None))
    assert evaluation.by_range('hybrid') == ()


def test_conditions_and_rig_come_from_the_recording_unless_given(tmp_path: Path) -> None:
    scene = {'name': 'x', 'rig': 'navcam', 'conditions': ['moon', 'dust_spots']}
    bag = write_labelled(tmp_path / 'bag', scene=scene)
    assert evaluated(bag).conditions == ('dust_spots', 'moon', 'rig navcam')
    given = evaluated(bag, conditions=['dusk'])
    assert given.conditions == ('dusk',)


@pytest.mark.parametrize('text', ['no JSON', '[1, 2]', '{"conditions": 5}'])
def test_an_invalid_scene_topic_is_ignored(tmp_path: Path, text: str) -> None:
    bag = write_labelled(tmp_path / 'tune_dunes', scene=text)
    assert evaluated(bag).conditions == ('dunes',)


@pytest.mark.parametrize(
    ('name', 'condition'),
    [
        ('report_03_low_sun', 'low_sun'),
        ('tune_study_noon', 'study_noon'),
        ('traverse', 'traverse'),
        ('07_', '07_'),
        ('reports', 'reports'),
    ],
)
def test_the_condition_is_the_name_without_prefixes(name: str, condition: str) -> None:
    assert condition_in(name) == condition


def test_recordings_of_the_same_name_get_distinct_scene_names() -> None:
    paths = [Path('/data/monday/bag'), Path('/data/tuesday/bag'), Path('/data/other.mcap')]
    assert scene_names(paths) == ['monday/bag', 'tuesday/bag', 'other']


def test_ground_truth_is_found_in_any_namespace(tmp_path: Path) -> None:
    bag = write_labelled(tmp_path / 'bag', namespace='/rover/truth')
    with open_bag(bag) as reader:
        topics = find_truth_topics(reader)
    assert topics.labels == '/rover/truth/labels'
    assert topics.depth == '/rover/truth/depth'
    assert evaluated(bag).scenes[0].figures.rocks_found == 2


def test_the_labels_topic_can_be_given(tmp_path: Path) -> None:
    messages = stereo_messages(1)
    messages.append(truth('/annotation/mask', labels(), 0, 'mono8'))
    bag = write_ros2(tmp_path / 'bag', messages)
    with pytest.raises(BagError, match=r'no topic truth/labels: the recording has .*annotation'):
        evaluated(bag)
    chosen = evaluated(bag, labels_topic='/annotation/mask')
    assert chosen.scenes[0].figures.true_positives == 128
    with pytest.raises(BagError, match=r'topic /nowhere is missing'):
        evaluated(bag, labels_topic='/nowhere')
    with pytest.raises(BagError, match=r'camera_info is sensor_msgs/msg/CameraInfo: expected'):
        evaluated(bag, labels_topic='/stereo/left/camera_info')


def test_a_pair_without_labels_is_reported(tmp_path: Path) -> None:
    messages = stereo_messages(2)
    messages.append(truth('/truth/labels', labels(), 1, 'mono8'))
    evaluation = evaluated(write_ros2(tmp_path / 'bag', messages))
    assert len(evaluation.scenes[0].frames) == 1
    (problem,) = evaluation.problems
    assert 'no labels with the stamp of the pair' in problem


@pytest.mark.parametrize(
    ('array', 'encoding', 'message'),
    [
        (np.full(SHAPE, 7, np.uint8), 'mono8', 'has the value 7: expected mono8 with 0, 1, 2'),
        (np.zeros(SHAPE, np.uint16), 'mono16', 'has type uint16'),
        (np.zeros((5, 6), np.uint8), 'mono8', '6 x 5, the left image 32 x 24'),
        (np.zeros((*SHAPE, 3), np.uint8), 'bgr8', '32 x 24 x 3, the left image 32 x 24'),
    ],
)
def test_invalid_labels_are_an_error(
    tmp_path: Path, array: np.ndarray, encoding: str, message: str
) -> None:
    messages = [*stereo_messages(1), truth('/truth/labels', array, 0, encoding)]
    with pytest.raises(BagError, match='no labelled frame.*truth/labels.*' + message):
        evaluated(write_ros2(tmp_path / 'bag', messages))


def test_recordings_are_evaluated_although_others_fail(tmp_path: Path) -> None:
    good = write_labelled(tmp_path / 'good')
    bad = write_ros2(tmp_path / 'bad', stereo_messages(1))
    progress = []
    evaluation, errors = evaluate_bags(
        [bad, tmp_path / 'nowhere', good],
        OPTIONS,
        BagOptions(),
        lambda index, done, expected: progress.append((index, done, expected)),
    )
    assert [result.scene for result in evaluation.scenes] == ['good']
    assert len(errors) == 2
    assert 'truth/labels' in str(errors[0])
    assert 'nowhere' in str(errors[1])
    assert progress == [(2, 1, 2), (2, 2, 2)]


def test_recordings_that_are_done_are_kept_when_stopped(tmp_path: Path) -> None:
    paths = [write_labelled(tmp_path / name) for name in ('first', 'second')]
    # Not opened: that it is not there would be another error.
    paths.append(tmp_path / 'nowhere')
    progress = []
    evaluation, errors = evaluate_bags(
        paths,
        OPTIONS,
        BagOptions(),
        lambda index, done, expected: progress.append((index, done)),
        lambda: (1, 1) in progress,
    )
    assert [result.scene for result in evaluation.scenes] == ['first']
    assert [str(error) for error in errors] == [f'{path} is not evaluated' for path in paths[1:]]
    assert all(isinstance(error, NothingDoneError) for error in errors)


def test_colour_pairs_are_evaluated(tmp_path: Path) -> None:
    colour = np.repeat(np.zeros(SHAPE, np.uint8)[..., np.newaxis], 3, axis=2)
    messages = [
        each._replace(message=image(colour, START_NS, encoding='bgr8'))
        if each.topic.endswith('image_rect')
        else each
        for each in stereo_messages(1)
    ]

    def fixed(camera, left, right):
        assert left.shape == (*SHAPE, 3)
        mask = np.zeros(SHAPE, np.uint8)
        mask[ROCK] = 255
        return mask

    registry.METHODS['hybrid'] = lambda config: fixed
    messages.append(truth('/truth/labels', labels(), 0, 'mono8'))
    options = RunOptions(['hybrid'], DetectorConfig(), worst_pictures=1)
    evaluation = evaluated(write_ros2(tmp_path / 'bag', messages), options)
    assert evaluation.scenes[0].figures.f1 == 1.0
