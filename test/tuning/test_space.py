"""Parameters to tune are numbers with two ends, by default those that decide."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection import DetectorConfig
from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.tuning import space as tuning_space
from rover_obstacle_detection.tuning.space import (
    ROVER_LIMITS,
    TUNED_BY_DEFAULT,
    SearchRange,
    search_range,
    search_ranges,
)

DESCRIPTIONS = {each.name: each for each in DetectorConfig.parameters()}


@pytest.mark.parametrize('name', TUNED_BY_DEFAULT)
def test_what_is_tuned_by_default_is_a_parameter_within_its_range(name: str) -> None:
    chosen = search_range(name)
    assert DESCRIPTIONS[name].minimum <= chosen.low < chosen.high <= DESCRIPTIONS[name].maximum
    assert chosen.contains(chosen.value_in(DetectorConfig()))


def test_what_the_rover_can_do_is_not_tuned_by_default() -> None:
    assert set(DESCRIPTIONS) >= ROVER_LIMITS
    assert not ROVER_LIMITS & set(TUNED_BY_DEFAULT)
    assert not {'camera_pitch', 'camera_roll', 'camera_height'} & set(TUNED_BY_DEFAULT)


def test_the_default_list_is_taken_where_none_is_given() -> None:
    assert [each.name for each in search_ranges()] == list(TUNED_BY_DEFAULT)


def test_named_parameters_are_taken_once_and_in_order() -> None:
    chosen = search_ranges(['speckle_range', 'study_max_step', 'speckle_range'])
    assert [each.name for each in chosen] == ['speckle_range', 'study_max_step']
    assert (chosen[1].low, chosen[1].high) == (0.0, 1.0)


def test_bounds_that_are_given_are_taken() -> None:
    (chosen,) = search_ranges(['dark_grey_level'], {'dark_grey_level': (10.0, 80.0)})
    assert chosen == SearchRange('dark_grey_level', 10, 80, is_whole=True)
    assert isinstance(chosen.low, int)


@pytest.mark.parametrize(
    ('low', 'high', 'step', 'is_log'),
    [(1, 10, None, True), (1, 9, None, False), (0, 1000, None, False), (3, 31, 2, False)],
)
def test_ratios_count_where_a_range_spans_a_decade(low, high, step, is_log) -> None:
    assert SearchRange('x', low, high, step=step).is_log is is_log


@pytest.mark.parametrize(
    ('name', 'bounds', 'words'),
    [
        ('uniqueness_rato', None, 'is not a parameter of the detector: did you mean uniqueness'),
        ('zzz', None, 'is not a parameter of the detector: expected one of method'),
        ('method', None, 'method is not a number'),
        ('equalize_histogram', None, 'equalize_histogram is not a number'),
        ('dark_grey_level', (10, 300), 'dark_grey_level is 300: expected 0 to 255'),
        ('dark_grey_level', (10.5, 30), 'dark_grey_level is 10.5: expected a whole number'),
        ('dark_grey_level', (30, 30), 'from 30 to 30 leaves nothing to choose'),
        ('window_size', (4, 31), 'window_size is 4: expected 3 plus a multiple of 2'),
        ('P1', (math.nan, 5.0), 'no smallest and largest value'),
        ('P1', (1.0, math.inf), 'no smallest and largest value'),
    ],
)
def test_what_cannot_be_tuned_is_refused(name, bounds, words) -> None:
    with pytest.raises(ConfigurationError, match=words):
        search_range(name, bounds)


def test_a_parameter_without_ends_needs_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    endless = tuning_space.ParameterDescription('gain', 1.0, 'No ends.', minimum=0.0)
    config = type('Config', (), {'parameters': staticmethod(lambda: (endless,))})
    monkeypatch.setattr(tuning_space, 'DetectorConfig', config)
    with pytest.raises(ConfigurationError, match=r'give --range gain=LOW:HIGH'):
        search_range('gain')
    assert search_range('gain', (1.0, 2.0)).high == 2.0


def test_bounds_of_what_is_not_tuned_are_refused() -> None:
    with pytest.raises(ConfigurationError, match='add --parameter speckle_range'):
        search_ranges(['P1'], {'speckle_range': (1, 2)})


@given(st.floats(0.1, 2.0))
def test_values_are_rounded_within_the_range(value: float) -> None:
    chosen = SearchRange('x', 0.1, 2.0)
    rounded = chosen.rounded(value)
    assert chosen.contains(rounded)
    assert rounded == pytest.approx(value, rel=1e-3)
    assert len(f'{rounded:g}') <= 6


def test_whole_values_stay_whole() -> None:
    value = SearchRange('x', 1, 1_000_000, is_whole=True).rounded(123_457)
    assert value == 123_457
    assert isinstance(value, int)
