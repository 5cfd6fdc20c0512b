"""Update the tables of docs/reliability.md after a fault was added to the tables in test/support/.

python scripts/make_reliability_page.py
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / 'docs' / 'reliability.md'
sys.path.insert(0, str(ROOT / 'test' / 'support'))

from fault_row import LIVE, REPLAY, START, Row  # noqa: E402
from generated_blocks import with_block  # noqa: E402
from live_fault_table import LIVE_ROWS, START_ROWS  # noqa: E402
from replay_fault_table import REPLAY_ROWS  # noqa: E402

ROWS = (*START_ROWS, *LIVE_ROWS, *REPLAY_ROWS)
SAYS = {START: 'what the node says', LIVE: 'what the node says', REPLAY: 'what the replay says'}


def main() -> None:
    """Write the tables into the page."""
    PAGE.write_text(page(PAGE.read_text(encoding='utf-8')), encoding='utf-8')


def page(text: str) -> str:
    """Return the page with the tables of today."""
    for kind in SAYS:
        if rows := [row for row in ROWS if row.kind == kind]:
            text = with_block(text, kind, table(kind, rows))
    return text


def table(kind: str, rows: Sequence[Row]) -> str:
    """Return a table of faults in Markdown."""
    lines = [f'| what goes wrong | {SAYS[kind]} | status |', '|---|---|---|']
    lines += [f'| {row.fault} | `{row.says}` | {row.effect} |' for row in rows]
    return '\n'.join(lines)


if __name__ == '__main__':
    main()
