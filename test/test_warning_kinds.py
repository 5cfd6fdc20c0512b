from __future__ import annotations

import pytest

from rover_obstacle_detection.warning_kinds import WarningCount, count_warnings, kind_of


@pytest.mark.parametrize(
    ('one', 'other'),
    [
        ('2 % match', '13 % match'),
        ('pitch is 0 degrees', 'pitch is -12.5 degrees'),
    ],
)
def test_texts_that_differ_in_numbers_are_of_one_kind(one: str, other: str) -> None:
    assert kind_of(one) == kind_of(other)


def test_texts_that_differ_in_words_are_of_two_kinds() -> None:
    assert kind_of('left image is dark') != kind_of('right image is dark')


def test_warnings_are_counted_by_kind_in_order() -> None:
    frames = [
        (10, ()),
        (20, ('pitch is 1.5', 'blurred')),
        (30, ('pitch is 2', 'pitch is 3')),
        (40, ('blurred',)),
    ]

    assert count_warnings(frames) == (
        WarningCount('pitch is 1.5', 2, 20),
        WarningCount('blurred', 2, 20),
    )
