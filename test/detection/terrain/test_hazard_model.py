from __future__ import annotations

from importlib import resources

import numpy as np
import pytest

from rover_obstacle_detection.detection import terrain
from rover_obstacle_detection.detection.network.pixel_network import VERSION_KEY
from rover_obstacle_detection.detection.terrain.cell_features import FEATURES, FEATURES_VERSION
from rover_obstacle_detection.detection.terrain.hazard_model import (
    MODEL_FILE,
    HazardModel,
    hazard_model,
)
from rover_obstacle_detection.errors import ModelError


def random_features(*shape, scale=1.0):
    made = np.random.default_rng(0).standard_normal((len(FEATURES), *shape), np.float32)
    return made * np.float32(scale)


def test_model_is_loaded_once():
    assert hazard_model() is hazard_model()


@pytest.mark.parametrize('shape', [(48, 64), (17, 33), (1, 1)])
def test_every_cell_has_the_probabilities_of_both_hazards(shape):
    slope, drop = hazard_model().probability(random_features(*shape))
    assert slope.shape == drop.shape == shape
    assert (slope >= 0).all()
    assert (drop >= 0).all()
    assert (slope + drop <= 1 + 1e-6).all()


def test_extreme_features_give_finite_probabilities():
    for probability in hazard_model().probability(random_features(40, 40, scale=1000)):
        assert np.isfinite(probability).all()


def test_model_for_another_version_of_the_features_is_refused():
    packaged = (resources.files(terrain) / MODEL_FILE).read_bytes()
    entry = VERSION_KEY.encode() + b'\x12\x01' + FEATURES_VERSION.encode()
    assert packaged.count(entry) == 1
    other = packaged.replace(entry, entry[:-1] + b'0')
    with pytest.raises(ModelError, match=r'hazard model .* version 0: expected .*train_hazards'):
        HazardModel(other)
