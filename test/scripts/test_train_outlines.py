"""The script that trains the network that outlines obstacles."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip('torch', reason='needs the extra train')
pytest.importorskip('onnx', reason='needs the extra train')

import onnx
import torch
import train_outlines
import training_bags
import training_loop
from outline_training import crops, examples, export, train
from outline_training.crops import CROP_PX, GREY, HEIGHT, MEASURED, SCALE, random_crop
from outline_training.examples import Example, even_places, examples_of_bags
from outline_training.export import read_network, write_model
from outline_training.network import OutlineNet
from outline_training.score import mean_iou
from outline_training.train import Batch, loss_of, pixel_logits
from training_bags import straightened_labels

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.network.onnx_metadata import read_metadata
from rover_obstacle_detection.detection.network.pixel_network import VERSION_KEY
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.rectification.correction import Correction
from rover_obstacle_detection.detection.rectification.lens_distortion import LensDistortion, Lenses
from rover_obstacle_detection.detection.rocks.outline_features import (
    FEATURES,
    FEATURES_VERSION,
    PARALLAX_FEATURES,
)
from rover_obstacle_detection.detection.rocks.outline_model import OutlineModel
from rover_obstacle_detection.errors import ModelError, UnjudgeablePairError
from rover_obstacle_detection.evaluation.labels import NOT_COUNTED, ROCK

BAG = Path(__file__).parents[2] / 'bags' / 'simulated_vga_moon'


def random_weights(net, seed=0):
    """Give all weights values other than zero, which corrections begin with."""
    torch.manual_seed(seed)
    with torch.no_grad():
        for parameter in net.parameters():
            parameter.normal_(0, 0.1)
    return net


def random_features(*shape):
    generator = np.random.default_rng(0)
    return generator.standard_normal((len(FEATURES), *shape), np.float32)


def example(height=200, width=240, rock=np.s_[80:120, 100:150]):
    rocks = np.zeros((height, width), bool)
    rocks[rock] = True
    features = random_features(height, width)
    features[MEASURED] = 1
    return Example(
        torch.from_numpy(features.astype(np.float16)),
        torch.from_numpy(rocks),
        torch.ones(height, width, dtype=torch.bool),
        even_places(rocks),
    )


def probabilities(net, features):
    with torch.no_grad():
        return torch.sigmoid(pixel_logits(net, torch.from_numpy(features)[None]))[0].numpy()


@pytest.fixture(scope='module', autouse=True)
def _small_batches():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(train, '_BATCH', 2)
        yield


@pytest.fixture(scope='module')
def trained(tmp_path_factory):
    """The file that two steps on one bag lead to."""
    path = tmp_path_factory.mktemp('trained') / 'model.onnx'
    train_outlines.main(['--steps', '2', '--bags', str(BAG), '--output', str(path)])
    return path


def test_one_command_leads_to_a_file_that_the_detector_reads(trained):
    onnx.checker.check_model(onnx.load(str(trained)), full_check=True)
    data = trained.read_bytes()
    assert read_metadata(data)[VERSION_KEY] == FEATURES_VERSION
    found = OutlineModel(data).probability(random_features(61, 90))
    assert found.shape == (61, 90)
    assert found.std() > 0
    assert [path.name for path in trained.parent.iterdir()] == ['model.onnx']


def test_the_same_seed_leads_to_the_same_network_in_onnx_as_in_torch(trained):
    net = train.train(examples_of_bags([BAG]), 2)
    features = random_features(64, 96)
    found = OutlineModel(trained.read_bytes()).probability(features)
    np.testing.assert_allclose(found, probabilities(net, features), atol=1e-3)


def test_a_file_that_differs_from_the_network_is_not_kept(monkeypatch, tmp_path):
    path = tmp_path / 'model.onnx'
    path.write_bytes(b'former model')
    other = export.onnx_model(random_weights(OutlineNet(), seed=1))
    monkeypatch.setattr(export, 'onnx_model', lambda net: other)
    with pytest.raises(ModelError, match='differs from the trained network'):
        write_model(random_weights(OutlineNet()), path)
    assert path.read_bytes() == b'former model'
    assert list(tmp_path.iterdir()) == [path]


def test_a_written_network_is_read_again(tmp_path):
    net = random_weights(OutlineNet())
    write_model(net, tmp_path / 'model.onnx')
    read = read_network(tmp_path / 'model.onnx')
    for name, weights in net.state_dict().items():
        torch.testing.assert_close(read.state_dict()[name], weights, rtol=0, atol=0)


def test_a_file_of_another_network_cannot_be_improved(tmp_path):
    path = tmp_path / 'model.onnx'
    path.write_bytes(b'no network')
    with pytest.raises(ModelError, match=r'model\.onnx: not a network that this script'):
        read_network(path)
    other = onnx.helper.make_model(onnx.helper.make_graph([], 'other', [], []))
    path.write_bytes(other.SerializeToString())
    with pytest.raises(ModelError, match=r'model\.onnx: not a network that this script'):
        read_network(path)


def test_training_may_start_from_a_network(monkeypatch):
    start = random_weights(OutlineNet())
    before = {name: weights.clone() for name, weights in start.state_dict().items()}
    net = train.train([example()], 1, start=start)
    changed = [
        (net.state_dict()[name] - weights).abs().max().item() for name, weights in before.items()
    ]
    assert 0 < max(changed) <= 2 * train._LATER_PEAK_RATE


def test_training_ends_when_its_time_is_over():
    net = train.train([example()], steps=10**6, minutes=0.02)
    assert net.out.weight.isfinite().all()


def test_the_learning_rate_falls_to_nearly_nothing():
    rates = [training_loop.learning_rate(step, step / 1000) for step in range(1000)]
    assert rates[0] == pytest.approx(training_loop._LEAST_RATE)
    assert max(rates) == pytest.approx(training_loop.PEAK_RATE, rel=0.05)
    assert rates[-1] < 2 * training_loop._LEAST_RATE


def test_what_is_not_counted_does_not_matter():
    logits = torch.from_numpy(random_features(20, 20)[:2])
    rock = (logits > 1).float()
    counted = torch.ones_like(rock)
    counted[:, 5:10] = 0
    batch = Batch(logits, rock, counted)
    changed = torch.where(counted > 0, logits, -7 * logits)
    torch.testing.assert_close(loss_of(changed, batch), loss_of(logits, batch))
    assert loss_of(40 * (rock - 0.5), batch) < 1e-3
    assert loss_of(40 * (0.5 - rock), batch) > 1


def test_where_labels_do_not_count_only_the_teacher_does():
    logits = torch.from_numpy(random_features(20, 20)[:2])
    rock, counted = (logits > 1).float(), torch.zeros_like(logits)
    taught = torch.sigmoid(torch.from_numpy(random_features(20, 20)[2:4]))
    batch, other = Batch(logits, rock, counted, taught), Batch(logits, 1 - rock, counted, taught)
    torch.testing.assert_close(loss_of(logits, batch), loss_of(logits, other))
    assert loss_of(torch.logit(taught), batch) < loss_of(logits, batch)


def test_where_labels_count_the_best_answer_is_between_them_and_the_teacher(monkeypatch):
    monkeypatch.setattr(train, '_IOU_WEIGHT', 0)
    one = torch.ones(1, 1, 1)
    batch = Batch(one, one, one, 0.2 * one)
    best = 1 - train._TEACHER_WEIGHT * 0.8
    losses = {
        share: loss_of(torch.logit(share * one), batch).item()
        for share in (0.2, best - 0.05, best, best + 0.05, 0.999)
    }
    assert min(losses, key=losses.__getitem__) == best


def test_a_teacher_is_asked_about_the_very_crops_of_the_batch():
    class Teacher:
        def probability(self, features):
            return features[GREY]

    batch = train.random_batch([example()], np.random.default_rng(0), Teacher())
    torch.testing.assert_close(batch.taught, batch.features[:, GREY])
    assert train.random_batch([example()], np.random.default_rng(0)).taught is None


def test_a_pair_that_cannot_be_judged_is_skipped_and_named(monkeypatch, capsys):
    def refuse(frame, parameters):
        raise UnjudgeablePairError('nothing to see')

    monkeypatch.setattr(examples, 'measure', refuse)
    assert examples_of_bags([BAG]) == []
    assert 'skipped' in (shown := capsys.readouterr().err)
    assert 'nothing to see' in shown


def test_labels_have_the_resolution_at_which_the_pair_was_judged(monkeypatch):
    config = DetectorConfig(working_scale=0.5)
    monkeypatch.setattr(examples, 'DetectorConfig', lambda: config)
    (made,) = examples_of_bags([BAG])
    assert made.rock.shape == made.counted.shape == made.features.shape[1:] == (150, 200)
    # The labels lie where the features show something that stands up.
    height = made.features[HEIGHT].float()
    assert height[made.rock].mean() > height[made.counted & ~made.rock].mean() + 0.3


def test_features_have_the_resolution_of_the_outlines(monkeypatch):
    default = DetectorParameters.from_config(DetectorConfig())
    measured = replace(default.resolution, step_px=0.1, min_pixels=200 * 150)
    changed = replace(default, resolution=measured)
    monkeypatch.setattr(DetectorParameters, 'from_config', lambda config: changed)
    (made,) = examples_of_bags([BAG])
    assert made.rock.shape == made.features.shape[1:] == (300, 400)


@pytest.mark.parametrize('shape', [(200, 240), (90, 300)])
def test_crops_have_one_size_and_show_the_rock(shape):
    generator = np.random.default_rng(0)
    made = example(*shape, np.s_[50:70, 100:130])
    shown = 0
    for _ in range(20):
        features, rock, counted = random_crop(made, generator)
        assert features.shape == (len(FEATURES), CROP_PX, CROP_PX)
        assert rock.shape == counted.shape == (CROP_PX, CROP_PX)
        assert set(features[MEASURED].unique().tolist()) <= {0, 1}
        assert set(rock.unique().tolist()) <= {0, 1}
        assert counted.all()
        shown += bool(rock.any())
    assert shown > 12


def test_an_enlarged_crop_has_more_pixels_per_step(monkeypatch):
    monkeypatch.setattr(crops, '_RESIZED', 1)
    monkeypatch.setattr(crops, '_WITHOUT_3D_ON_A_SIDE', 0)
    monkeypatch.setattr(crops, '_SMALLEST', 1.25)
    monkeypatch.setattr(crops, '_LARGEST', 1.25)
    made = example()
    made.features[SCALE] = 1
    features, _, _ = random_crop(made, np.random.default_rng(0))
    assert features[SCALE].mean().item() == pytest.approx(1 + np.log(1.25) / 3, abs=1e-3)


def test_a_hidden_side_has_no_3d_but_an_image():
    features = torch.from_numpy(random_features(CROP_PX, CROP_PX)[None])
    features[:, MEASURED] = 1
    before = features.clone()
    crops.hide_a_side(features, np.random.default_rng(0))
    hidden = features[0, MEASURED] == 0
    assert 0.05 < hidden.float().mean() < 0.95
    assert (hidden[:, :-1].int() >= hidden[:, 1:].int()).all()
    assert (features[0, PARALLAX_FEATURES, :, :] * hidden == 0).all()
    assert not torch.equal(features[0, HEIGHT][hidden], before[0, HEIGHT][hidden])
    torch.testing.assert_close(features[0, GREY], before[0, GREY])
    torch.testing.assert_close(features[0][:, ~hidden], before[0][:, ~hidden])


def test_shade_changes_the_grey_level_alone():
    rock = torch.zeros(CROP_PX, CROP_PX)
    for seed in range(10):
        features = torch.zeros(1, len(FEATURES), CROP_PX, CROP_PX)
        crops.shade(features, rock, np.random.default_rng(seed))
        assert features[0, GREY].abs().max() > 0.1
        features[0, GREY] = 0
        assert not features.any()


def test_small_parts_are_looked_at_as_often_as_large_ones():
    where = np.zeros((100, 100), bool)
    where[5:12, 5:12] = True
    where[40:100, 40:100] = True
    where[0, 99] = True
    rows, columns = even_places(where).T
    assert where[rows, columns].all()
    assert np.count_nonzero(rows < 20) == 40 + 1
    assert np.count_nonzero(rows >= 40) == 40


def test_labels_are_straightened_with_the_image():
    camera = StereoCamera(
        width=160, height=120, fx=80.0, fy=80.0, cx=80.0, cy=60.0, baseline_m=0.1
    )
    labels = np.zeros(camera.shape, np.uint8)
    cv2.circle(labels, (130, 90), 8, ROCK, cv2.FILLED)
    np.testing.assert_array_equal(straightened_labels(labels, camera, Correction()), labels)
    half = straightened_labels(labels, camera.resized(80, 60), Correction())
    np.testing.assert_array_equal(np.unique(half), [0, ROCK])
    assert np.argwhere(half == ROCK).mean(axis=0) == pytest.approx([45, 65], abs=0.5)
    barrel = LensDistortion(k1=-0.08)
    correction = Correction(lenses=Lenses(barrel, barrel))
    found = straightened_labels(labels, camera, correction)
    rows, columns = np.nonzero(found == ROCK)
    # The lens shows the point at a smaller radius than a straight image does.
    radius = np.hypot(130 - 80, 90 - 60) / 80
    straight = np.hypot(columns.mean() - 80, rows.mean() - 60) / 80
    assert straight + barrel.k1 * straight**3 == pytest.approx(radius, abs=0.02)
    pincushion = Lenses(LensDistortion(k1=0.08), LensDistortion(k1=0.08))
    found = straightened_labels(labels, camera, Correction(lenses=pincushion))
    assert found[0, 0] == NOT_COUNTED
    assert found[60, 80] == 0


def test_iou_counts_frames_with_rocks_and_counted_pixels():
    class Model:
        def probability(self, features):
            return features[0]

    full = example()
    full.features[0] = full.rock.half()
    half = example()
    half.features[0] = half.rock.half()
    half.features[0, 80:100] = 0
    half.features[0, 150:] = 1
    half.counted[150:] = False
    bare = example(rock=np.s_[:0])
    assert mean_iou(Model(), [full, half, bare]) == pytest.approx((1 + 0.5) / 2)
    assert np.isnan(mean_iou(Model(), [bare]))


@pytest.fixture
def named_bags(monkeypatch):
    """Each bag stands for its own example; nothing is rendered."""
    monkeypatch.setattr(training_bags, 'simulated_bag', lambda scene, folder: scene.name)
    monkeypatch.setattr(train_outlines, 'examples_of_bags', lambda paths: [*paths])


def test_the_suites_share_no_scene(named_bags):
    training, unseen = train_outlines.suites()
    held_out = unseen['held-out scenes of training']
    wide = unseen['held-out scenes of training_wide']
    assert (len(held_out), len(wide)) == (35, 12)
    assert len(training) > 400
    assert not set(training) & {*held_out, *wide}
    assert {name.partition('_')[0] for name in training} == {'train', 'wide'}
    tuning = unseen['tuning scenes']
    assert tuning
    assert all(name.startswith('tune_') for name in tuning)


def test_scenes_that_the_cache_does_not_have_can_be_left_out(named_bags, monkeypatch, tmp_path):
    for name in ('train_04_vga_slope_up_26', 'train_10_navcam_noon'):
        (tmp_path / name).mkdir()
    monkeypatch.setattr(training_bags, 'cached_bag', lambda scene, folder: tmp_path / scene.name)
    training, unseen = train_outlines.suites(cached_only=True)
    assert training == ['train_04_vga_slope_up_26']
    assert list(unseen.values()) == [['train_10_navcam_noon'], [], []]


def test_each_tenth_bag_is_held_out(named_bags):
    assert train_outlines.given_bags(list('abc')) == (list('abc'), {})
    training, unseen = train_outlines.given_bags(list('abcdefghijklmnopqrstu'))
    assert unseen == {'held-out bags': ['j', 't']}
    assert training == list('abcdefghiklmnopqrsu')


def test_what_cannot_be_read_is_named_and_nothing_is_written(tmp_path):
    output = tmp_path / 'model.onnx'
    with pytest.raises(SystemExit, match='nowhere'):
        train_outlines.main(['--bags', str(tmp_path / 'nowhere'), '--output', str(output)])
    assert not output.exists()


def test_an_output_that_cannot_be_written_is_refused_before_the_training(tmp_path):
    output = tmp_path / 'no such folder' / 'model.onnx'
    with pytest.raises(SystemExit, match='cannot write'):
        train_outlines.main(['--bags', str(BAG), '--output', str(output)])


@pytest.mark.parametrize(('option', 'least'), [('--steps', 'at least 1'), ('--minutes', 'more')])
def test_no_training_at_all_is_refused(capsys, option, least):
    with pytest.raises(SystemExit) as exited:
        train_outlines.main([option, '0'])
    assert exited.value.code == 2
    assert f'expected {least}' in capsys.readouterr().err
