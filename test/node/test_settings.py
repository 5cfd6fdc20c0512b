from __future__ import annotations

from typing import Any

import pytest

from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.node.settings import (
    NO_LIMIT_NS,
    NODE_PARAMETERS,
    Settings,
    all_parameters,
)
from rover_obstacle_detection.node.watchdog import WatchdogLimits


def test_parameters_are_unique_and_their_defaults_valid() -> None:
    names = [each.name for each in all_parameters()]

    assert len(set(names)) == len(names)
    for each in NODE_PARAMETERS:
        each.check(each.default)


@pytest.mark.parametrize(
    ('values', 'tolerance_ns'),
    [
        ({}, None),
        ({'approximate_sync_tolerance_seconds': 0.02}, None),
        ({'approximate_sync': True, 'approximate_sync_tolerance_seconds': 0.02}, 20_000_000),
        ({'approximate_sync': True}, NO_LIMIT_NS),
    ],
)
def test_pairing_tolerance(values: dict[str, Any], tolerance_ns: int | None) -> None:
    assert Settings.from_values(values).tolerance_ns == tolerance_ns


def test_watchdog_can_be_configured_and_turned_off() -> None:
    values = {'frozen_after': 5, 'stale_after': 3.0, 'max_image_age': 0.5}

    assert Settings.from_values(values).watchdog == WatchdogLimits(5, 3.0, 0.5)
    assert Settings.from_values(values | {'watchdog': False}).watchdog is None


@pytest.mark.parametrize(
    ('values', 'reason'),
    [
        ({'queue_size': 0}, 'queue_size is 0: expected 1 to 100'),
        ({'image_transport': 'theora'}, 'expected one of raw, compressed'),
        ({'base_frame': ''}, 'base_frame'),
        ({'imu_roll': 200.0}, 'imu_roll is 200.0: expected -180 to 180'),
        ({'max_step': 0.0}, 'max_step is 0.0: expected 0.01 to 2'),
        ({'rover_polygon': 'none'}, 'rover_polygon'),
        ({'frozen_after': 0}, 'frozen_after is 0: expected 1 to 10000'),
        ({'stale_after': 0.0}, 'stale_after is 0.0: expected 0.1 to 3600'),
    ],
)
def test_invalid_value_is_refused(values: dict[str, Any], reason: str) -> None:
    with pytest.raises(ConfigurationError) as refusal:
        Settings.from_values(values)

    assert reason in str(refusal.value)
