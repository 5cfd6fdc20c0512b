"""Messages count in the singular and in the plural."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from rover_obstacle_detection.wording import counted, printable


@pytest.mark.parametrize(
    ('number', 'expected'),
    [(0, '0 bad frames'), (1, '1 bad frame'), (2, '2 bad frames'), (21, '21 bad frames')],
)
def test_one_is_singular_and_all_else_plural(number: int, expected: str) -> None:
    assert counted(number, 'bad frame') == expected


def test_a_plural_without_s_can_be_given() -> None:
    assert counted(1, 'message or pair', 'messages or pairs') == '1 message or pair'
    assert counted(0, 'message or pair', 'messages or pairs') == '0 messages or pairs'


def test_names_that_are_no_text_can_be_printed() -> None:
    assert printable(Path(os.fsdecode(b'a/\xff.png'))) == r'a/\xff.png'
    assert printable('/stereo/links/grün') == '/stereo/links/grün'
