"""Messages count in the singular and in the plural."""

from __future__ import annotations

import pytest

from rover_obstacle_detection.wording import counted


@pytest.mark.parametrize(
    ('number', 'expected'),
    [(0, '0 bad frames'), (1, '1 bad frame'), (2, '2 bad frames'), (21, '21 bad frames')],
)
def test_one_is_singular_and_all_else_plural(number: int, expected: str) -> None:
    assert counted(number, 'bad frame') == expected


def test_a_plural_without_s_can_be_given() -> None:
    assert counted(1, 'message or pair', 'messages or pairs') == '1 message or pair'
    assert counted(0, 'message or pair', 'messages or pairs') == '0 messages or pairs'
