"""Any camera, images and parameters give a well-formed detection or a known error."""

from __future__ import annotations

import pytest
from any_input import Case, cases, ends, outcome, plain_case
from hypothesis import HealthCheck, given, settings

from rover_obstacle_detection import DetectorConfig
from rover_obstacle_detection.detection.config import METHODS


@settings(
    max_examples=30,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
@given(cases())
def test_any_input_is_judged_or_refused(case: Case) -> None:
    outcome(case)


@pytest.mark.parametrize('method', METHODS)
def test_parameters_at_the_ends_of_their_ranges(method: str) -> None:
    assert outcome(plain_case({'method': method})) == 'judged'
    for parameter in DetectorConfig.parameters():
        for value in ends(parameter):
            config = {'method': method, parameter.name: value}
            try:
                outcome(plain_case(config))
            except Exception as error:
                raise AssertionError(f'{parameter.name} {value}: {error!r}') from error
