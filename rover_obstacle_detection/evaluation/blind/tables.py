"""Tables and plain data of the figures under each condition."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rover_obstacle_detection.evaluation.blind.figures import SHARES, Strength
from rover_obstacle_detection.evaluation.tables import NONE, Table, percent

MIN_FALSELY_FREE = 0.02
"""Conditions with less falsely free ground than this share of the image count as harmless."""

COLUMNS = {
    'free': 'free',
    'obstacle': 'obstacle',
    'unknown': 'unknown',
    'blind_called_free': 'blind pixels free',
    'wrong_range': 'wrong range',
    'obstacle_called_free': 'obstacles free',
}
"""Shares of `BlindFigures` in the tables of all conditions, with their headings."""

UNNOTICED_COLUMNS = {
    'falsely_free': 'falsely free',
    'free': 'free',
    'blind_called_free': COLUMNS['blind_called_free'],
    'wrong_range': COLUMNS['wrong_range'],
    'obstacle_called_free': COLUMNS['obstacle_called_free'],
}
"""The same for the table of what was not noticed."""

HEADER = (
    'condition',
    'strength',
    'refused',
    'warned',
    *COLUMNS.values(),
    'most frequent message (pairs)',
)


def blind_tables(results: Sequence[Strength]) -> list[Table]:
    """Tabulate results, one table for each group and one row for each strength."""
    groups = dict.fromkeys(result.group for result in results)
    return [
        Table(group, HEADER, [_row(result) for result in results if result.group == group])
        for group in groups
    ]


def unnoticed_table(results: Sequence[Strength]) -> Table:
    """Tabulate where much is falsely called free without refusal or warning, worst first.

    All shares are means over the views that were judged without a warning.
    """
    listed = [
        (false, result)
        for result in results
        if (false := result.silent.mean('falsely_free') or 0.0) >= MIN_FALSELY_FREE
    ]
    listed.sort(key=lambda each: -each[0])
    rows = [
        (
            result.condition,
            result.strength,
            f'{len(result.silent.views)}/{len(result.views)}',
            *(percent(result.silent.mean(share)) for share in UNNOTICED_COLUMNS),
        )
        for _, result in listed
    ]
    header = ('condition', 'strength', 'unnoticed', *UNNOTICED_COLUMNS.values())
    return Table('Not noticed', header, rows)


def as_markdown(results: Sequence[Strength]) -> str:
    """Format all tables under their headings."""
    tables = [unnoticed_table(results), *blind_tables(results)]
    return '\n'.join(
        f'### {table.title}\n\n{table.as_markdown() if table.rows else NONE}' for table in tables
    )


def as_json(results: Sequence[Strength]) -> list[dict[str, Any]]:
    """Convert results to plain data, with the figures of each view."""
    return [
        {
            'group': result.group,
            'condition': result.condition,
            'strength': result.strength,
            'refused': result.refused,
            'warned': result.warned,
            'crashed': result.crashed,
            **{share: result.mean(share) for share in SHARES},
            'words': result.words()[0],
            'views': [asdict(view) for view in result.views],
        }
        for result in results
    ]


def _row(result: Strength) -> tuple[str, ...]:
    number = len(result.views)
    refused = f'{result.refused}/{number}'
    if result.crashed:
        refused += f', {result.crashed} crashed'
    words, pairs = result.words()
    return (
        result.condition,
        result.strength,
        refused,
        f'{result.warned}/{number}',
        *(percent(result.mean(share)) for share in COLUMNS),
        f'{words} ({pairs})'.replace('|', '/') if words else NONE,
    )
