from __future__ import annotations

from importlib import resources

import numpy as np
import pytest

from rover_obstacle_detection.detection import rocks
from rover_obstacle_detection.detection.network import pixel_network as module
from rover_obstacle_detection.detection.network.pixel_network import PixelNetwork
from rover_obstacle_detection.detection.rocks.outline_features import FEATURES, FEATURES_VERSION
from rover_obstacle_detection.detection.rocks.outline_model import MODEL_FILE


@pytest.fixture(scope='module')
def network():
    """A trained network with one output."""
    data = (resources.files(rocks) / MODEL_FILE).read_bytes()
    return PixelNetwork(
        data, outputs=1, version=FEATURES_VERSION, name='outline', script='train.py'
    )


def random_features(*shape):
    return np.random.default_rng(0).standard_normal((len(FEATURES), *shape), np.float32)


@pytest.mark.parametrize('shape', [(352, 80), (376, 80), (80, 352)])
def test_tall_inputs_give_the_same_in_two_halves(network, monkeypatch, shape):
    inputs = random_features(*shape)
    whole = network.values(inputs)
    monkeypatch.setattr(module, '_MAX_ROWS', 200)
    np.testing.assert_allclose(network.values(inputs), whole, atol=1e-3)


@pytest.mark.parametrize('shape', [(16, 16), (17, 33), (1, 5)])
def test_every_pixel_has_a_value(network, shape):
    assert network.values(random_features(*shape)).shape == (1, *shape)


@pytest.mark.parametrize('side', [2, 4])
@pytest.mark.parametrize('outputs', [1, 3])
def test_values_of_squares_of_pixels_are_put_in_their_places(network, monkeypatch, side, outputs):
    class Squares:
        def run(self, given):
            squares = expected.reshape(outputs, 32 // side, side, 48 // side, side)
            return squares.transpose(0, 2, 4, 1, 3).reshape(-1, 32 // side, 48 // side)

    expected = np.linspace(0.1, 0.9, outputs * 32 * 48).reshape(outputs, 32, 48)
    expected = expected.astype(np.float32)
    monkeypatch.setattr(network, '_inference', Squares())
    monkeypatch.setattr(network, '_outputs', outputs)
    np.testing.assert_array_equal(network.values(random_features(32, 48)), expected)
