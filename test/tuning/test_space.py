"""Search space: which parameters are tuned, over which ranges."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection import DetectorConfig
from rover_obstacle_detection.errors import ConfigurationError

pytest.importorskip('optuna', reason='needs the extra tune')
from optuna.distributions import FloatDistribution, IntDistribution

from rover_obstacle_detection.tuning import space
from rover_obstacle_detection.tuning.space import (
    ROVER_LIMITS,
    TUNED_BY_DEFAULT,
    check_read_by,
    range_text,
    rounded,
    search_range,
    search_ranges,
    start_value,
)

DESCRIPTIONS = {each.name: each for each in DetectorConfig.parameters()}


@pytest.mark.parametrize('name', TUNED_BY_DEFAULT)
def test_default_range_is_allowed_and_contains_the_default(name: str) -> None:
    chosen = search_range(name)
    assert DESCRIPTIONS[name].minimum <= chosen.low < chosen.high <= DESCRIPTIONS[name].maximum
    assert chosen.low <= start_value(DetectorConfig(), name) <= chosen.high


def test_rover_limits_and_camera_pose_are_not_tuned_by_default() -> None:
    assert set(DESCRIPTIONS) >= ROVER_LIMITS
    assert not ROVER_LIMITS & set(TUNED_BY_DEFAULT)
    assert not {'camera_pitch', 'camera_roll', 'camera_height'} & set(TUNED_BY_DEFAULT)


def test_named_parameters_replace_the_default_list() -> None:
    assert list(search_ranges()) == list(TUNED_BY_DEFAULT)
    chosen = search_ranges(['speckle_range', 'study_max_step', 'speckle_range'])
    assert list(chosen) == ['speckle_range', 'study_max_step']
    assert chosen['study_max_step'] == FloatDistribution(0.0, 1.0)


@pytest.mark.parametrize(
    ('name', 'bounds', 'distribution', 'text'),
    [
        ('dark_grey_level', (10.0, 80.0), IntDistribution(10, 80), '10 to 80'),
        ('speckle_size', (1, 10), IntDistribution(1, 10, log=True), '1 to 10, log'),
        ('speckle_size', (1, 9), IntDistribution(1, 9), '1 to 9'),
        ('speckle_size', (0, 1000), IntDistribution(0, 1000), '0 to 1000'),
        ('window_size', (3, 31), IntDistribution(3, 31, step=2), '3 to 31, steps of 2'),
        ('smoothness', (0.1, 1.0), FloatDistribution(0.1, 1.0, log=True), '0.1 to 1, log'),
    ],
)
def test_bounds_give_a_distribution(name, bounds, distribution, text) -> None:
    chosen = search_range(name, bounds)
    assert chosen == distribution
    assert range_text(chosen) == text


@pytest.mark.parametrize(
    ('name', 'bounds', 'words'),
    [
        ('uniqueness_rato', None, 'is not a detector parameter: did you mean uniqueness'),
        ('zzz', None, 'is not a detector parameter: expected one of method'),
        ('method', None, 'method is not a number'),
        ('equalize_histogram', None, 'equalize_histogram is not a number'),
        ('dark_grey_level', (10, 300), 'dark_grey_level is 300: expected 0 to 255'),
        ('dark_grey_level', (10.5, 30), 'dark_grey_level is 10.5: expected a whole number'),
        ('dark_grey_level', (30, 30), 'from 30 to 30 leaves nothing to choose'),
        ('window_size', (4, 31), 'window_size is 4: expected 3 plus a multiple of 2'),
        ('P1', (math.nan, 5.0), 'no finite range'),
        ('P1', (1.0, math.inf), 'no finite range'),
    ],
)
def test_invalid_range_is_refused(name, bounds, words) -> None:
    with pytest.raises(ConfigurationError, match=words):
        search_range(name, bounds)


def test_unbounded_parameter_needs_a_range(monkeypatch: pytest.MonkeyPatch) -> None:
    unbounded = space.ParameterDescription('gain', 1.0, 'Unbounded.', minimum=0.0)
    config = type('Config', (), {'parameters': staticmethod(lambda: (unbounded,))})
    monkeypatch.setattr(space, 'DetectorConfig', config)
    with pytest.raises(ConfigurationError, match=r'give --range gain=LOW:HIGH'):
        search_range('gain')
    assert search_range('gain', (1.0, 2.0)).high == 2.0


def test_range_of_a_parameter_that_is_not_tuned_is_refused() -> None:
    with pytest.raises(ConfigurationError, match='add --parameter speckle_range'):
        search_ranges(['P1'], {'speckle_range': (1, 2)})


def test_parameters_of_the_other_method_are_refused() -> None:
    for method in ('hybrid', 'study'):
        check_read_by(method, ['max_step', 'speckle_size', 'P1'])
    check_read_by('hybrid', TUNED_BY_DEFAULT)
    check_read_by('study', ['study_max_step', 'min_seed_points'])
    for method, name in (('hybrid', 'min_seed_points'), ('study', 'outline_probability')):
        with pytest.raises(ConfigurationError, match=f'method {method} does not read {name}'):
            check_read_by(method, ['max_step', name])


@given(st.floats(0.1, 2.0))
def test_values_are_rounded_within_the_range(value: float) -> None:
    short = rounded(value, FloatDistribution(0.1, 2.0))
    assert 0.1 <= short <= 2.0
    assert short == pytest.approx(value, rel=1e-3)
    assert len(f'{short:g}') <= 6


def test_whole_values_are_not_rounded() -> None:
    value = rounded(123_457, IntDistribution(1, 1_000_000))
    assert value == 123_457
    assert isinstance(value, int)
