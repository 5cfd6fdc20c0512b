"""Console output of the subcommands: errors, warnings, progress bars and tables."""

from __future__ import annotations

import contextlib
import logging
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

from rover_obstacle_detection.cli.progress_lines import ProgressLines

if TYPE_CHECKING:
    from rover_obstacle_detection.evaluation.tables import Table

OnTaskProgress = Callable[[int, int, int], None]
"""Called with the task's index and the number of steps done and expected."""


def report_error(message: str) -> None:
    """Print an error on one line of stderr."""
    print(f'rover-obstacles: error: {" ".join(message.split())}', file=sys.stderr)


def report_interruption(message: str) -> None:
    """Print on one line of stderr what an interruption has left."""
    print(f'rover-obstacles: interrupted: {" ".join(message.split())}', file=sys.stderr)


def report_failures(failed: int, bags: int) -> None:
    """Print how many of several bags have failed."""
    if failed and bags > 1:
        report_error(f'{failed} of {bags} bags failed')


@contextlib.contextmanager
def warnings_on_stderr() -> Iterator[None]:
    """Print the warnings of the package's loggers on stderr, one line each."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter('rover-obstacles: %(levelname)s: %(message)s'))
    logger = logging.getLogger('rover_obstacle_detection')
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)


@contextlib.contextmanager
def progress_bars(tasks: Sequence[str], unit: str) -> Iterator[OnTaskProgress]:
    """Show a progress bar for each task on stderr; lines now and then if that is no terminal."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    console = Console(stderr=True)
    if not console.is_terminal:
        yield ProgressLines(tasks, unit).update
        return
    progress = Progress(
        TextColumn('{task.description}', markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn(unit),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
    )
    with progress:
        identifiers = [progress.add_task(task, total=None) for task in tasks]

        def update(index: int, done: int, expected: int) -> None:
            progress.update(identifiers[index], completed=done, total=expected)

        yield update


def print_table(table: Table) -> None:
    """Print a table; a narrow terminal wraps the first column but never the figures."""
    from rich.console import Console
    from rich.table import Table as RichTable

    drawn = RichTable(title=table.title, title_justify='left', box=None, padding=(0, 1, 0, 0))
    for index, name in enumerate(table.header):
        drawn.add_column(
            name.replace(' ', '\n', 1),
            justify='right' if index else 'left',
            no_wrap=index > 0,
            overflow='fold',
            min_width=8 if index == 0 else None,
        )
    for row in table.rows:
        drawn.add_row(*row)
    console = Console(highlight=False)
    console.print(drawn)
    console.print()
