"""One fault of the tables: what goes wrong, and what the software says."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

START, LIVE, REPLAY = 'start', 'live', 'replay'
BAD_FRAME = 'bad frame'


@dataclass(frozen=True)
class Row:
    """One fault.

    Parameters
    ----------
    kind : str
        `START`, `LIVE` or `REPLAY`.
    fault : str
        What goes wrong, for users.
    says : str
        What the user reads: N stands for a number, … for anything.
    inject : callable or tuple
        How a test brings it about; depends on the kind.
    level : str
        On /diagnostics: WARN or ERROR.
    status : str
        The status on /diagnostics, or `BAD_FRAME`; empty if the program ends with exit status 1.
    logged : str
        The severity in the log, if it is not the level.
    """

    kind: str
    fault: str
    says: str
    inject: Callable[..., Any] | tuple[str, ...]
    level: str = 'ERROR'
    status: str = ''
    logged: str = ''

    def __post_init__(self) -> None:
        object.__setattr__(self, 'logged', self.logged or self.level)

    @property
    def pattern(self) -> str:
        """`says` as a regular expression."""
        pattern = re.escape(self.says).replace('…', '.*')
        return re.sub(r'\bN\b', r'-?\\d+(\\.\\d+)?', pattern)

    @property
    def effect(self) -> str:
        """Level and status for users."""
        if not self.status:
            return 'exit status 1'
        return f'{self.level}, {self.status}' if self.kind == LIVE else self.status
