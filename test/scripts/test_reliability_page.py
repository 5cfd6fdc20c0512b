"""docs/reliability.md shows the faults of the table."""

from __future__ import annotations

import re

import pytest
from fault_row import LIVE, Row
from live_fault_table import LIVE_ROWS
from make_reliability_page import PAGE, ROWS, page, table


def test_page_is_up_to_date() -> None:
    text = PAGE.read_text(encoding='utf-8')

    assert page(text) == text


def test_faults_have_different_names() -> None:
    names = [(row.kind, row.fault) for row in ROWS]

    assert len(set(names)) == len(names)


def test_table_has_a_line_for_each_fault() -> None:
    row = Row(LIVE, 'a fault', 'seen N times', lambda rover: None, 'WARN', 'detection')

    assert table(LIVE, [row]).splitlines()[2:] == [
        '| a fault | `seen N times` | WARN, detection |'
    ]


@pytest.mark.parametrize('row', LIVE_ROWS, ids=lambda row: row.fault)
def test_texts_fit_into_a_table_and_say_something(row: Row) -> None:
    assert not {'|', '`', '\n'} & set(row.says)
    assert len(row.says) > 20


def test_numbers_and_further_words_are_left_open() -> None:
    row = Row(LIVE, 'a fault', 'N of N (…): wait N s, not 20.0 s', lambda rover: None)

    assert re.fullmatch(row.pattern, '3 of 1.5 (a, b): wait -2 s, not 20.0 s')
    assert not re.fullmatch(row.pattern, '3 of 1.5 (a, b): wait 2 s, not 20x0 s')
