"""Blocks between markers in the pages of docs/, whose content scripts replace."""

from __future__ import annotations

import sys
from pathlib import Path


def check_block(page: Path, name: str) -> None:
    """Exit if a page lacks the markers of a block."""
    text = page.read_text(encoding='utf-8')
    if f'<!-- begin {name} -->\n' not in text or f'<!-- end {name} -->' not in text:
        sys.exit(f'{page} has no block {name}')


def with_block(text: str, name: str, content: str) -> str:
    """Replace the content between the markers of a block."""
    begin, end = f'<!-- begin {name} -->\n', f'<!-- end {name} -->'
    before, _, rest = text.partition(begin)
    return f'{before}{begin}\n{content}\n{end}{rest.partition(end)[2]}'
