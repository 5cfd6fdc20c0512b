"""The script that trains the network that judges the ground."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('torch', reason='needs the extra train')
pytest.importorskip('onnx', reason='needs the extra train')

import torch
import train_hazards
from hazard_training import drawn_ground, examples, export, train
from hazard_training.drawn_ground import drawn_examples
from hazard_training.examples import LABELS, MapExample, pixels_by_label
from hazard_training.export import write_model
from hazard_training.network import HazardNet, cell_logits
from hazard_training.random_ground import Box, random_edges
from hazard_training.train import CROP_CELLS, Sampler, loss_of, mirrored
from relief import PosedCamera, flat

from rover_obstacle_detection.detection.terrain.cell_features import FEATURES
from rover_obstacle_detection.detection.terrain.hazard_model import CLASSES, HazardModel
from rover_obstacle_detection.errors import BagError, ModelError
from rover_obstacle_detection.evaluation.labels import DROP, FREE, ROCK, SLOPE
from rover_obstacle_detection.simulation.suite import load_suite

BAG = Path(__file__).parents[2] / 'bags' / 'simulated_vga_moon'


def example(rows=150, columns=140, hazard=np.s_[60:80, 50:90]):
    generator = np.random.default_rng(0)
    pixels = np.zeros((len(LABELS), rows, columns), np.uint16)
    pixels[LABELS.index(FREE)] = 2
    pixels[LABELS.index(FREE)][hazard] = 0
    pixels[LABELS.index(SLOPE)][hazard] = 3
    features = generator.standard_normal((len(FEATURES), rows, columns), np.float32)
    features[train._TO_THE_LEFT] = pixels[LABELS.index(SLOPE)]
    return MapExample(features.astype(np.float16), pixels)


@pytest.fixture(autouse=True)
def _small_batches(monkeypatch):
    monkeypatch.setattr(train, '_BATCH', 2)


def test_one_command_leads_to_a_file_that_the_detector_reads(tmp_path, capsys):
    path = tmp_path / 'model.onnx'
    train_hazards.main(['--steps', '2', '--bags', str(BAG), '--drawn', '1', '--output', str(path)])
    slope, drop = HazardModel(path.read_bytes()).probability(
        np.zeros((len(FEATURES), 21, 33), np.float32)
    )
    assert slope.shape == drop.shape == (21, 33)
    assert f'written: {path}' in capsys.readouterr().out
    assert [each.name for each in tmp_path.iterdir()] == ['model.onnx']


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [(['--steps', '0'], '--steps is 0'), (['--minutes', '0'], '--minutes is 0')],
)
def test_impossible_options_are_refused(arguments, message, capsys):
    with pytest.raises(SystemExit):
        train_hazards.main(arguments)
    assert message in capsys.readouterr().err


def test_a_file_that_differs_from_the_network_is_not_kept(monkeypatch, tmp_path):
    path = tmp_path / 'model.onnx'
    path.write_bytes(b'former model')
    other = HazardNet()
    data = export.serialised(other, len(FEATURES), export.FEATURES_VERSION)
    monkeypatch.setattr(export, 'serialised', lambda *arguments: data)
    with pytest.raises(ModelError, match='differs from the trained network'):
        write_model(random_weights(HazardNet()), path)
    assert path.read_bytes() == b'former model'


def random_weights(net):
    torch.manual_seed(1)
    with torch.no_grad():
        for parameter in net.parameters():
            parameter.normal_(0, 0.3)
    return net


def test_training_learns_what_the_labels_say():
    # One feature is the label, the others are nothing.
    taught = example()
    taught.features[: train._TO_THE_LEFT] = taught.features[train._TO_THE_LEFT + 1 :] = 0
    net = train.train([taught], 200)
    features = torch.from_numpy(taught.features[:, :144, :128].astype(np.float32))[None]
    with torch.no_grad():
        share = torch.softmax(cell_logits(net, features), 1)[0].numpy()
    slope = share[CLASSES.index('slope')]
    assert slope[62:78, 52:88].mean() > slope[100:140, 20:100].mean() + 0.2


def test_classes_are_in_the_order_of_the_labels():
    assert CLASSES == ('slope', 'drop', 'free')
    assert LABELS == (SLOPE, DROP, FREE)


def test_loss_is_least_where_the_network_is_right_and_sure():
    pixels = torch.zeros(1, 3, 8, 8)
    pixels[0, 2], pixels[0, 0, 2:4] = 5, 0
    pixels[0, :, 2:4] = torch.tensor([7.0, 0, 0])[:, None, None]
    right, wrong = torch.full((2, 1, 3, 8, 8), -10.0)
    right[0, 2], right[0, :, 2:4] = 10, torch.tensor([10.0, -10, -10])[:, None, None]
    wrong[0, 2] = 10
    assert loss_of(right, pixels) < 0.01
    assert loss_of(wrong, pixels) > loss_of(torch.zeros(1, 3, 8, 8), pixels) > 0.5
    # Cells without pixels do not matter.
    pixels[0, :, 6:] = 0
    before = loss_of(right, pixels)
    right[0, :, 6:] = torch.tensor([10.0, -10, -10])[:, None, None]
    assert loss_of(right, pixels) == before


def test_crops_have_one_size_and_show_hazards():
    sampler = Sampler([example(), example(40, 60, np.s_[10:20, 10:20])], np.random.default_rng(0))
    features, pixels = sampler.crops()
    assert features.shape == (2, len(FEATURES), CROP_CELLS, CROP_CELLS)
    assert pixels.shape == (2, len(CLASSES), CROP_CELLS, CROP_CELLS)
    assert pixels[:, CLASSES.index('slope')].any()


def test_maps_without_labels_cannot_be_trained_on():
    nothing = example()
    nothing.pixels[:] = 0
    with pytest.raises(BagError, match='no map has 200 labelled pixels'):
        Sampler([nothing], np.random.default_rng(0))


def test_a_mirrored_map_is_that_of_mirrored_ground():
    features = example().features.astype(np.float32)
    found = mirrored(features)
    np.testing.assert_array_equal(found[0], features[0, :, ::-1])
    np.testing.assert_array_equal(found[train._RISE_RIGHT], -features[train._RISE_RIGHT, :, ::-1])
    heights = np.array([[0.0, 1.0, 3.0, 6.0]])
    to_the_left = np.diff(heights, prepend=heights[:, :1])
    other = np.zeros((len(FEATURES), 1, 4), np.float32)
    other[train._TO_THE_LEFT] = to_the_left
    expected = np.diff(heights[:, ::-1], prepend=heights[:, -1:])
    np.testing.assert_array_equal(mirrored(other)[train._TO_THE_LEFT], expected)


def test_pixels_are_counted_by_cell_and_label():
    posed = PosedCamera()
    terrain, *_ = posed.survey(flat)
    labels = np.zeros(posed.camera.shape, np.uint8) + FREE
    labels[:, :100], labels[:60] = SLOPE, ROCK
    layer = terrain.layers[0]
    counted = pixels_by_label(layer, labels)
    inside = layer.pixels & layer.positions.inside
    for label, grid in zip(LABELS, counted, strict=True):
        assert grid.sum() == np.count_nonzero(labels[layer.rows][inside] == label)
    assert not counted[LABELS.index(DROP)].any()


def test_drawn_ground_is_the_same_each_time_and_differs_by_number():
    one, again, other = drawn_examples(2), drawn_examples(2), drawn_examples(3)
    for first, second in zip(one, again, strict=True):
        np.testing.assert_array_equal(first.features, second.features)
        np.testing.assert_array_equal(first.pixels, second.pixels)
    assert (
        one[0].features.shape != other[0].features.shape
        or (one[0].features != other[0].features).any()
    )
    assert len(one) > 1
    assert one[0].pixels[LABELS.index(FREE)].sum(dtype=float) > 10_000


def test_boxes_have_upright_sides():
    box = Box(2.0, 1.0, 1.0, 0.4, 0.7, math.radians(90))
    x, y = np.array([2.0, 2.15, 2.25, 2.0, 2.0]), np.array([1.0, 1.0, 1.0, 1.45, 1.55])
    np.testing.assert_allclose(box.height(x, y), [0.7, 0.7, 0, 0.7, 0])
    assert box.grown(0.1).height(x, y).all()


def test_edges_follow_each_other():
    camera = {'camera_height_m': 1.0, 'pitch_deg': 30.0}
    for seed in range(20):
        edges = random_edges(camera, np.random.default_rng(seed))
        ahead = [each['ahead_m'] for each in edges]
        assert 1 <= len(edges) <= 4
        assert ahead == sorted(ahead)


def test_training_scenes_are_those_with_edges_or_slopes_and_some_others(monkeypatch):
    monkeypatch.setattr(
        train_hazards,
        'bags_of_suite',
        lambda suite, is_chosen, cached_only: [
            scene.name for scene in load_suite(suite) if is_chosen(scene.name)
        ],
    )
    chosen = train_hazards.training_bags()
    wide = [scene.name for scene in load_suite('training_wide')]
    assert chosen[: len(wide)] == wide
    rest = chosen[len(wide) :]
    assert all(name.startswith('train_') for name in rest)
    assert sum('slope' in name for name in rest) > 50
    assert 10 < sum('slope' not in name and 'crater' not in name for name in rest) < 60


def test_limits_and_labels_vary_together():
    generator = np.random.default_rng(0)
    for _ in range(20):
        config = examples.random_limits(generator)
        assert 0.05 <= config.max_step <= 0.3
        assert 12 <= config.max_slope <= 32
    truth = load_suite('hazards')[0].truth
    changed = examples.limits_of(config, truth)
    assert changed == replace(
        truth,
        clearance_m=config.max_step,
        drop_m=config.max_step,
        slope_limit_deg=config.max_slope,
    )
    assert (
        max(
            scene.seed
            for suite in ('standard', 'hazards', 'unseen', 'drawn')
            for scene in load_suite(suite)
        )
        < drawn_ground.FIRST_SEED
    )
