from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from rover_obstacle_detection.detection.rocks import outline_model as model_module
from rover_obstacle_detection.detection.rocks.outline_features import PARALLAX_PLANES, PLANES
from rover_obstacle_detection.detection.rocks.outline_model import OutlineModel, outline_model

# About what the planes are limited to.
LEAST = dict(zip(PLANES, (-2, -1, 0, 0, 0, -0.24, -3, 0, 0, *4 * (-3,)), strict=True))
MOST = dict(zip(PLANES, (6, 3, 1, 2, 3, 2.1, 3, 1, 5, *4 * (3,)), strict=True))


def planes(height, width, seed=0):
    generator = np.random.default_rng(seed)
    shape = (height, width)
    made = [generator.uniform(LEAST[name], MOST[name], shape) for name in PLANES]
    return np.stack(made).astype(np.float32)


def test_filter_is_loaded_once():
    assert outline_model() is outline_model()


@pytest.mark.parametrize('shape', [(48, 64), (49, 67), (8, 8), (1, 1), (3, 100)])
def test_every_pixel_has_a_probability(shape):
    found = outline_model().probability(planes(*shape))
    assert found.shape == shape
    assert found.dtype == np.float32
    assert ((found >= 0) & (found <= 1)).all()


@pytest.mark.parametrize('seed', range(8))
def test_extremes_are_no_trouble(seed):
    generator = np.random.default_rng(seed)
    extreme = np.stack(
        [generator.choice([LEAST[name], MOST[name]], (40, 40)) for name in PLANES]
    ).astype(np.float32)
    assert np.isfinite(outline_model().probability(extreme)).all()
    assert np.isfinite(outline_model().probability(extreme[:, :1, :1].repeat(40, 1))).all()


def test_calls_before_leave_no_trace():
    one, other = planes(40, 56), planes(64, 48, seed=1)
    first = outline_model().probability(one)
    copy = first.copy()
    outline_model().probability(other)
    np.testing.assert_array_equal(first, copy)
    np.testing.assert_array_equal(outline_model().probability(one), copy)


def test_planes_stay_as_they_are():
    given = planes(41, 57)
    copy = given.copy()
    outline_model().probability(given)
    np.testing.assert_array_equal(given, copy)


def test_several_threads_may_share_the_filter():
    inputs = [planes(120 + 8 * number, 160, number) for number in range(2)] * 15
    expected = [outline_model().probability(each) for each in inputs[:2]] * 15
    with ThreadPoolExecutor(4) as pool:
        for found, right in zip(
            pool.map(outline_model().probability, inputs), expected, strict=True
        ):
            np.testing.assert_array_equal(found, right)


@pytest.mark.parametrize('rows', [240, 264])
def test_two_halves_are_as_the_whole(monkeypatch, rows):
    inputs = planes(rows, 80)
    whole = outline_model().probability(inputs)
    monkeypatch.setattr(model_module, '_MOST_ROWS', 200)
    np.testing.assert_allclose(outline_model().probability(inputs), whole, atol=1e-5)


def test_a_filter_that_is_very_sure_is_just_sure(monkeypatch):
    def very_sure(self, planes, logit):
        logit[:] = -500
        logit[:8] = 500
        logit[8:16] = 0

    monkeypatch.setattr(OutlineModel, '_run', very_sure)
    found = OutlineModel().probability(planes(32, 40))
    np.testing.assert_array_equal(found[:8], 1)
    np.testing.assert_array_equal(found[8:16], 0.5)
    np.testing.assert_array_equal(found[16:], 0)


def test_flat_ground_is_nothing_and_a_clear_rock_is_one():
    ground = dict.fromkeys(PLANES, 0.0) | {
        'measured': 1,
        'noise over the step': 0.1,
        'disparity noise': 0.5,
        'scale': np.log(20) / 3,
    }
    scene = np.stack([np.full((96, 96), ground[name]) for name in PLANES]).astype(np.float32)
    assert (outline_model().probability(scene) < 0.5).all()
    rock = np.s_[32:64, 32:64]
    for name, value in (
        ('height over the step', 3),
        ('height over its noise', 3),
        ('standing part', 1),
        *((PLANES[number], 1) for number in PARALLAX_PLANES),
    ):
        scene[PLANES.index(name)][rock] = value
    scene[PLANES.index('top of the part over the step'), 25:71, 25:71] = 3
    found = outline_model().probability(scene) > 0.5
    assert found[36:60, 36:60].mean() > 0.95
    found[24:72, 24:72] = False
    assert not found.any()
