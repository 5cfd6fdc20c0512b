"""The script that trains the cascade of boosted features, on hand-made images."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip('sklearn', reason='needs the extra cascade')

import train_cascade
from train_cascade import (
    MIN_OVERLAP,
    PASSING_SHARE,
    View,
    boosted_stage,
    cut_out,
    iou_at,
    joined,
    random_features,
    samples,
    train,
    with_best_score,
)

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.labels import NOT_COUNTED, ROCK
from rover_obstacle_detection.evaluation.methods.cascade import (
    GREY,
    PATTERNS,
    WHOLE,
    WINDOW,
    Cascade,
    all_windows,
    overlaps,
    windows_of,
)

CAMERA = StereoCamera(160, 120, 100.0, 100.0, 79.5, 59.5, 0.1)


def view(seed=0, rocks=((30, 40), (110, 80))):
    """A view of rocks of 32 x 24 pixels, bright above and dark below, on noisy ground."""
    generator = np.random.default_rng(seed)
    image = generator.normal(120, 12, CAMERA.shape)
    labels = np.zeros(CAMERA.shape, np.uint8)
    instances = np.zeros(CAMERA.shape, np.uint16)
    for number, (column, row) in enumerate(rocks, 1):
        image[row - 12 : row, column - 16 : column + 16] += 70
        image[row : row + 12, column - 16 : column + 16] -= 70
        rock = np.s_[row - 12 : row + 12, column - 16 : column + 16]
        labels[rock], instances[rock] = ROCK, number
    labels[:10] = NOT_COUNTED
    grey = np.clip(image, 0, 255).astype(np.uint8)
    return View(grey, LabelledFrame(0, CAMERA, grey, grey, labels, instances))


def test_boxes_of_rocks_leave_out_small_ones():
    shown = view()
    np.testing.assert_array_equal(shown.rock_boxes(), [(14, 28, 32, 24), (94, 68, 32, 24)])
    shown.frame.labels[40:, 14:46] = 0
    shown.frame.labels[28:34, 14:46] = 0
    np.testing.assert_array_equal(shown.rock_boxes(), [(94, 68, 32, 24)])
    assert view(rocks=()).rock_boxes().shape == (0, 4)


def test_windows_are_on_rocks_or_on_free_ground_or_neither():
    shown = view()
    for windows in all_windows(shown.grey):
        on_rock, on_ground = shown.rock_and_ground(windows)
        best = overlaps(windows.boxes, shown.rock_boxes()).max(axis=1)
        np.testing.assert_array_equal(on_rock, best >= MIN_OVERLAP)
        assert not (on_rock & on_ground).any()
        for column, row, width, height in windows.boxes[on_ground]:
            box = np.s_[round(row) : round(row + height), round(column) : round(column + width)]
            assert (shown.frame.labels[box] == 0).mean() >= 0.7
    windows = windows_of(shown.grey)
    _, on_ground = shown.rock_and_ground(windows)
    above = windows.boxes[:, 1] + windows.boxes[:, 3] <= 12
    assert not on_ground[above].any(), 'what is not counted is no ground'
    assert on_ground[windows.boxes[:, 1] > 100].all()


def test_random_features_differ_and_lie_in_the_window():
    drawn = random_features(500, np.random.default_rng(0))
    assert len(set(drawn)) == 500
    assert {feature.pattern for feature in drawn} == set(range(len(PATTERNS)))
    for feature in drawn:
        rows, columns = PATTERNS[feature.pattern].shape
        assert 0 <= feature.row <= WINDOW[0] - rows * feature.height
        assert 0 <= feature.column <= WINDOW[1] - columns * feature.width
        assert feature.height > 0 < feature.width
        assert feature.pattern != WHOLE or feature.channel != GREY
    assert drawn == random_features(500, np.random.default_rng(0))


def test_windows_that_were_cut_out_have_the_same_features():
    first, second = windows_of(view().grey), windows_of(view(1).grey, 2.0)
    chosen = np.array([5, 900, 17]), np.array([1000])
    together = joined([cut_out(first, chosen[0]), cut_out(second, chosen[1])])
    for feature in random_features(30, np.random.default_rng(0)):
        expected = [first.values(feature, chosen[0]), second.values(feature, chosen[1])]
        np.testing.assert_allclose(
            together.values(feature, np.arange(4)), np.concatenate(expected), atol=1e-9
        )
    np.testing.assert_array_equal(together.boxes[3], second.boxes[1000])


def test_samples_are_rocks_and_ground_up_to_the_most(monkeypatch):
    monkeypatch.setattr(train_cascade, 'GROUND_WINDOWS', 50)
    monkeypatch.setattr(train_cascade, 'ROCK_WINDOWS', 20)
    windows, is_rock = samples([view(), view(1)], Cascade([]), np.random.default_rng(0))
    assert is_rock.sum() == 2 * 20
    assert (~is_rock).sum() == 2 * 50
    best = overlaps(windows.boxes, view().rock_boxes()).max(axis=1)
    np.testing.assert_array_equal(best >= MIN_OVERLAP, is_rock)


def test_a_stage_lets_most_rocks_pass_and_little_else():
    windows, is_rock = samples([view(), view(1)], Cascade([]), np.random.default_rng(0))
    pool = random_features(60, np.random.default_rng(0))
    numbers = np.arange(len(is_rock))
    values = np.array([windows.values(feature, numbers) for feature in pool], np.float32).T
    stage = boosted_stage(values, is_rock, pool, 5, 0)
    assert 1 <= len(stage.features) <= 5
    passes = stage.scores(windows, numbers) >= stage.min_score
    assert passes[is_rock].mean() >= PASSING_SHARE
    assert passes[~is_rock].mean() < 0.1


def test_training_finds_rocks_and_repeats_itself():
    def trained(seed):
        return train([view(), view(1), view(2)], seed, stumps=(2, 4, 8), features=80)

    model = trained(0)
    assert model == trained(0)
    assert model != trained(1)
    assert len(model.stages) < 3, 'no ground was left to train the last stage on'
    unseen = view(7, rocks=((60, 50), (120, 90)))
    chosen, mean_iou = with_best_score(model, [view(8), view(9, rocks=())])
    assert mean_iou > 0.35
    assert iou_at(unseen, *chosen.detect(unseen.grey), -np.inf) > 0.35
    assert chosen.stages[:-1] == model.stages[:-1]
    assert chosen.stages[-1].min_score >= model.stages[-1].min_score


def test_the_score_with_the_best_iou_is_chosen():
    boxes = np.array([(14, 28, 32, 24), (94, 68, 32, 24), (60, 0, 80, 50)], np.float64)
    scores = np.array([3.0, 2.0, 1.0])
    assert iou_at(view(), boxes, scores, 2.0) == 1
    assert iou_at(view(), boxes, scores, 2.5) == 0.5
    assert iou_at(view(), boxes, scores, 1.0) < 0.5
    assert iou_at(view(rocks=()), boxes, scores, 1.0) is None


def test_one_command_trains_and_writes(monkeypatch, tmp_path, capsys):
    given = {'training': [view(), view(1)], 'standard': [view(2)]}
    monkeypatch.setattr(train_cascade, 'views', lambda suite, *_: given[suite])
    monkeypatch.setattr(train_cascade, 'train', lambda views, seed: train(views, seed, (2, 4), 60))
    output = tmp_path / 'model.json'
    train_cascade.main(['--output', str(output)])
    model = Cascade.from_json(output.read_text(encoding='utf-8'))
    assert [len(stage.features) <= most for stage, most in zip(model.stages, (2, 4), strict=True)]
    assert f'written: {output}' in (shown := capsys.readouterr().out)
    assert 'mean IoU, tuning scenes: 0.' in shown


def test_only_training_and_tuning_scenes_are_read(monkeypatch):
    monkeypatch.setattr(train_cascade, 'simulated_bag', lambda scene, folder: scene.name)
    monkeypatch.setattr(train_cascade, 'views_of_bag', lambda name: [name])
    assert train_cascade.views('training', '', 2) == [
        'train_01_study_low_sun_away',
        'train_02_navcam_dense_rocks',
    ]
    tuning = train_cascade.views('standard', 'tune_')
    assert len(tuning) == 26
    assert all(name.startswith('tune_') for name in tuning)


def test_an_output_that_cannot_be_written_is_refused_before_the_training(tmp_path):
    with pytest.raises(SystemExit, match='cannot write'):
        train_cascade.main(['--output', str(tmp_path / 'no such folder' / 'model.json')])


def test_no_scene_at_all_is_refused(capsys):
    with pytest.raises(SystemExit, match='2'):
        train_cascade.main(['--scenes', '0'])
    assert 'expected at least 1' in capsys.readouterr().err
