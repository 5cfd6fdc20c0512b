from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from importlib import resources

import numpy as np
import pytest

from rover_obstacle_detection.detection.network.pixel_network import VERSION_KEY, PixelNetwork
from rover_obstacle_detection.detection.rocks import outline_model as model_module
from rover_obstacle_detection.detection.rocks.outline_features import (
    FEATURES,
    FEATURES_VERSION,
    PARALLAX_FEATURES,
)
from rover_obstacle_detection.detection.rocks.outline_model import (
    MODEL_FILE,
    OutlineModel,
    outline_model,
)
from rover_obstacle_detection.errors import ModelError

# About the limits of the features.
LEAST = dict(zip(FEATURES, (-2, -1, 0, 0, 0, -0.24, -3, 0, 0, *4 * (-3,)), strict=True))
MOST = dict(zip(FEATURES, (6, 3, 1, 2, 3, 2.1, 3, 1, 5, *4 * (3,)), strict=True))


def random_features(height, width, seed=0):
    generator = np.random.default_rng(seed)
    shape = (height, width)
    made = [generator.uniform(LEAST[name], MOST[name], shape) for name in FEATURES]
    return np.stack(made).astype(np.float32)


def test_model_is_loaded_once():
    assert outline_model() is outline_model()


@pytest.mark.parametrize('shape', [(48, 64), (49, 67), (8, 8), (1, 1), (3, 100)])
def test_every_pixel_has_a_probability(shape):
    found = outline_model().probability(random_features(*shape))
    assert found.shape == shape
    assert found.dtype == np.float32
    assert ((found >= 0) & (found <= 1)).all()


@pytest.mark.parametrize('seed', range(8))
def test_extreme_features_give_finite_probabilities(seed):
    generator = np.random.default_rng(seed)
    extreme = np.stack(
        [generator.choice([LEAST[name], MOST[name]], (40, 40)) for name in FEATURES]
    ).astype(np.float32)
    assert np.isfinite(outline_model().probability(extreme)).all()
    assert np.isfinite(outline_model().probability(extreme[:, :1, :1].repeat(40, 1))).all()


def test_model_is_stateless():
    one, other = random_features(40, 56), random_features(64, 48, seed=1)
    first = outline_model().probability(one)
    copy = first.copy()
    outline_model().probability(other)
    np.testing.assert_array_equal(first, copy)
    np.testing.assert_array_equal(outline_model().probability(one), copy)


def test_features_are_not_modified():
    given = random_features(41, 57)
    copy = given.copy()
    outline_model().probability(given)
    np.testing.assert_array_equal(given, copy)


def test_threads_may_share_the_model():
    inputs = [random_features(120 + 8 * number, 160, number) for number in range(2)] * 15
    expected = [outline_model().probability(each) for each in inputs[:2]] * 15
    with ThreadPoolExecutor(4) as pool:
        for found, right in zip(
            pool.map(outline_model().probability, inputs), expected, strict=True
        ):
            np.testing.assert_array_equal(found, right)


def test_logits_become_probabilities(monkeypatch):
    def large(self, features):
        logit = np.full((1, *features.shape[1:]), -500, np.float32)
        logit[:, :8] = 500
        logit[:, 8:16] = 0
        logit[:, 8:16, :20] = np.log(3)
        return logit

    monkeypatch.setattr(PixelNetwork, 'values', large)
    found = OutlineModel().probability(random_features(32, 40))
    np.testing.assert_array_equal(found[:8], 1)
    np.testing.assert_array_equal(found[8:16, 20:], 0.5)
    np.testing.assert_allclose(found[8:16, :20], 0.75, rtol=1e-6)
    np.testing.assert_array_equal(found[16:], 0)


def test_rock_is_outlined_and_flat_ground_is_not():
    ground = dict.fromkeys(FEATURES, 0.0) | {
        'measured': 1,
        'noise over the step': 0.1,
        'disparity noise': 0.5,
        'scale': np.log(20) / 3,
    }
    scene = np.stack([np.full((96, 96), ground[name]) for name in FEATURES]).astype(np.float32)
    assert (outline_model().probability(scene) < 0.5).all()
    rock = np.s_[32:64, 32:64]
    for name, value in (
        ('height over the step', 3),
        ('height over its noise', 3),
        ('standing part', 1),
        *((FEATURES[number], 1) for number in PARALLAX_FEATURES),
    ):
        scene[FEATURES.index(name)][rock] = value
    scene[FEATURES.index('top of the part over the step'), 25:71, 25:71] = 3
    found = outline_model().probability(scene) > 0.5
    assert found[36:60, 36:60].mean() > 0.95
    found[24:72, 24:72] = False
    assert not found.any()


def test_model_for_another_version_of_the_features_is_refused():
    packaged = (resources.files(model_module.__package__) / MODEL_FILE).read_bytes()
    entry = VERSION_KEY.encode() + b'\x12\x01' + FEATURES_VERSION.encode()
    assert packaged.count(entry) == 1
    other = packaged.replace(entry, entry[:-1] + b'0')
    with pytest.raises(ModelError, match=f'features of version 0: expected {FEATURES_VERSION}'):
        OutlineModel(other)
    assert OutlineModel(packaged).probability(random_features(8, 8)).shape == (8, 8)


def test_model_without_a_version_is_refused():
    with pytest.raises(ModelError, match=r'version None.*scripts/train_outlines\.py'):
        OutlineModel(b'')
