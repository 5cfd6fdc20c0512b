"""What a part of the benchmark found: a line for each target, and tables."""

from __future__ import annotations

from dataclasses import dataclass, field

from rover_obstacle_detection.evaluation.tables import Table

HEADER = ('', 'goal', 'measured', 'met')
VERDICTS = {True: 'yes', False: 'no', None: '-'}


@dataclass(frozen=True)
class Line:
    """One figure, and its goal if it has one.

    Parameters
    ----------
    what : str
    measured : str
    goal : str, optional
    met : bool, optional
        None without a goal, or if it could not be measured.
    """

    what: str
    measured: str
    goal: str = '-'
    met: bool | None = None

    def __str__(self) -> str:
        goal = '' if self.goal == '-' else f' (goal: {self.goal}; met: {VERDICTS[self.met]})'
        return f'{self.what}: {self.measured}{goal}'

    @property
    def cells(self) -> tuple[str, ...]:
        """The row of the table of targets."""
        return self.what, self.goal, self.measured, VERDICTS[self.met]


@dataclass(frozen=True)
class Findings:
    """Lines in order, and the tables by the name of their block on the page."""

    lines: tuple[Line, ...] = ()
    tables: dict[str, Table] = field(default_factory=dict)


def at_most(what: str, value: float, limit: float, text: str = '{:.2f} x SGBM') -> Line:
    """Make a line whose goal is an upper limit; both are formatted with `text`."""
    return Line(what, text.format(value), f'at most {text.format(limit)}', value <= limit)


def at_least(what: str, value: float, limit: float, text: str) -> Line:
    """Make a line whose goal is a lower limit; both are formatted with `text`."""
    return Line(what, text.format(value), f'at least {text.format(limit)}', value >= limit)


def target_table(lines: tuple[Line, ...]) -> Table:
    """Tabulate all targets."""
    return Table('Targets', HEADER, [line.cells for line in lines])
