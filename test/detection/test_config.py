from __future__ import annotations

import dataclasses
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.errors import ConfigurationError

PARAMETERS = {each.name: each for each in DetectorConfig.parameters()}
NUMBERS = {name: each for name, each in PARAMETERS.items() if type(each.default) in (int, float)}
RANGED = [(each, edge) for each in NUMBERS.values() for edge in (each.minimum, each.maximum)]
# The ranges must not contradict each other.
COMPANIONS = {'max_range': {'min_range': 0.01}, 'min_range': {'max_range': 1000.0}}


def refusal(**values):
    with pytest.raises(ConfigurationError) as caught:
        DetectorConfig(**values)
    return str(caught.value)


def test_every_field_is_listed_with_its_meaning():
    assert list(PARAMETERS) == [each.name for each in dataclasses.fields(DetectorConfig)]
    for each in PARAMETERS.values():
        assert each.default == getattr(DetectorConfig(), each.name)
        assert each.description.endswith('.')
        assert len(each.description) > 10
        each.check(each.default)


def test_every_number_has_a_range():
    for each in NUMBERS.values():
        assert each.minimum < each.maximum
        assert each.minimum <= each.default <= each.maximum


def test_configuration_is_immutable():
    with pytest.raises(dataclasses.FrozenInstanceError):
        DetectorConfig().max_step = 0.2


@pytest.mark.parametrize(('each', 'edge'), RANGED, ids=lambda each: getattr(each, 'name', each))
def test_edge_of_each_range_is_allowed(each, edge):
    value = type(each.default)(edge)
    if each.step:
        value = int(each.minimum) + (value - int(each.minimum)) // each.step * each.step
    config = DetectorConfig(**{each.name: value, **COMPANIONS.get(each.name, {})})
    assert getattr(config, each.name) == value


@pytest.mark.parametrize(('each', 'edge'), RANGED, ids=lambda each: getattr(each, 'name', each))
def test_values_beyond_each_range_are_refused(each, edge):
    outward = math.inf if edge == each.maximum else -math.inf
    step = each.step or 1
    value = edge + math.copysign(step, outward)
    if isinstance(each.default, float):
        value = math.nextafter(edge, outward)
    message = refusal(**{each.name: type(each.default)(value)})
    assert message.startswith(f'{each.name} is ')
    assert f'expected {each.minimum:g} to {each.maximum:g}' in message


@pytest.mark.parametrize('each', NUMBERS.values(), ids=lambda each: each.name)
@pytest.mark.parametrize('value', [True, '1', None, [1], 1j])
def test_other_types_are_refused_for_numbers(each, value):
    message = refusal(**{each.name: value})
    kind = 'a whole number' if isinstance(each.default, int) else 'a number'
    assert message == f'{each.name} is {value!r}: expected {kind}'


@pytest.mark.parametrize(
    'each', [each for each in NUMBERS.values() if isinstance(each.default, int)]
)
def test_fractions_are_refused_for_whole_numbers(each):
    value = float(each.default)
    assert refusal(**{each.name: value}) == f'{each.name} is {value!r}: expected a whole number'


@pytest.mark.parametrize(
    'each',
    [each for each in NUMBERS.values() if isinstance(each.default, float)],
    ids=lambda each: each.name,
)
@pytest.mark.parametrize('value', [math.nan, math.inf, -math.inf])
def test_numbers_must_be_finite(each, value):
    assert refusal(**{each.name: value}).startswith(f'{each.name} is {value}: expected ')


def test_whole_numbers_are_numbers():
    assert DetectorConfig(max_slope=15).max_slope == 15


@pytest.mark.parametrize('value', [1, 0, 'true', None])
def test_switches_are_true_or_false(value):
    message = refusal(equalize_histogram=value)
    assert message == f'equalize_histogram is {value!r}: expected true or false'


@pytest.mark.parametrize(
    ('name', 'choices'),
    [('method', 'hybrid, study'), ('gravity_source', 'estimate, parameters, imu, tf')],
)
def test_choices_are_listed(name, choices):
    assert refusal(**{name: 'magic'}) == f"{name} is 'magic': expected one of {choices}"
    assert refusal(**{name: 3}) == f'{name} is 3: expected a string'


@pytest.mark.parametrize(
    'name', ['correlation_window_size', 'window_size', 'morphology_size', 'disparity_range']
)
def test_values_between_steps_are_refused(name):
    each = PARAMETERS[name]
    value = int(each.minimum) + each.step + 1
    message = refusal(**{name: value})
    assert message == (
        f'{name} is {value}: expected {each.minimum:g} plus a multiple of {each.step}'
    )
    assert getattr(DetectorConfig(**{name: value - 1}), name) == value - 1


@pytest.mark.parametrize(('method', 'own'), [('hybrid', 3), ('study', 5)])
def test_each_method_has_its_own_block_size(method, own):
    assert DetectorConfig(method=method).block_size == own
    assert DetectorConfig(method=method, correlation_window_size=7).block_size == 7


@given(st.integers(-50, 50))
def test_block_size_is_odd_and_within_range(value):
    if -1 <= value <= 21 and value % 2:
        config = DetectorConfig(correlation_window_size=value)
        assert config.block_size == (value if value > 0 else 3)
    else:
        assert refusal(correlation_window_size=value).startswith('correlation_window_size is')


@given(st.floats(allow_nan=True, allow_infinity=True))
def test_max_step_is_within_range(value):
    if 0.01 <= value <= 2.0:
        assert DetectorConfig(max_step=value).max_step == value
    else:
        assert refusal(max_step=value).startswith('max_step is')


@given(near=st.floats(0.01, 100), far=st.floats(0.1, 1000))
def test_max_range_is_beyond_min_range(near, far):
    if far > near:
        assert DetectorConfig(min_range=near, max_range=far).max_range == far
    else:
        message = refusal(min_range=near, max_range=far)
        assert message == f'max_range is {far}: expected more than min_range, {near}'


def test_grid_has_a_bounded_number_of_cells():
    message = refusal(grid_extent=60.0, grid_cell=0.05)
    assert message == 'grid_extent is 60.0: expected at most 1000 times grid_cell, 0.05'
    assert DetectorConfig(grid_extent=50.0, grid_cell=0.05).grid_extent == 50


def test_second_penalty_is_larger_than_the_first():
    assert refusal(P1=300.0, P2=300.0) == 'P2 is 300.0: expected more than P1, 300.0'
    assert DetectorConfig(P1=300.0).P2 == 0
    assert DetectorConfig(P2=100.0).P1 == 0


def test_unknown_parameter_is_refused():
    with pytest.raises(TypeError, match='max_stepp'):
        DetectorConfig(max_stepp=0.1)


@pytest.mark.parametrize('name', ['camera_height', 'ground_cell', 'working_scale', 'P1'])
def test_a_tiny_value_is_neither_unset_nor_meant(name):
    assert getattr(DetectorConfig(**{name: 0.0}), name) == 0
    with pytest.raises(ConfigurationError, match=f'{name} is 1e-09: expected 0, or'):
        DetectorConfig(**{name: 1e-9})


@pytest.mark.parametrize(
    ('values', 'names'),
    [
        ({'camera_pitch': 30.0}, 'camera_pitch will'),
        ({'camera_roll': -2.0, 'gravity_source': 'imu'}, 'camera_roll will'),
        ({'camera_pitch': 30.0, 'camera_roll': 2.0}, 'camera_pitch and camera_roll will'),
    ],
)
def test_angles_without_effect_are_named(values, names):
    message = DetectorConfig(**values).without_effect
    assert message.startswith(names)
    assert f'gravity_source is {values.get("gravity_source", "estimate")!r}' in message
    assert DetectorConfig(**values | {'gravity_source': 'parameters'}).without_effect is None


def test_other_parameters_have_an_effect():
    assert DetectorConfig().without_effect is None
    assert DetectorConfig(camera_height=1.2, max_camera_pitch=30.0).without_effect is None
