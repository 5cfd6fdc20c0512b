"""Split recordings into a tuning set and a held-out set."""

from __future__ import annotations

import hashlib
from collections.abc import Container, Sequence
from dataclasses import dataclass
from pathlib import Path

from rover_obstacle_detection.bags.reader import bag_name
from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.wording import counted

HELD_OUT_SHARE = 0.3
TUNE_PREFIXES = ('tune_', 'tuning_')
REPORT_PREFIXES = ('report_', 'reporting_')


@dataclass(frozen=True)
class Split:
    """A tuning set and a held-out set.

    Parameters
    ----------
    tuned, held_out : tuple of Path
        In the order given.
    reason : str
        How the held-out set was chosen, or why it is empty.
    """

    tuned: tuple[Path, ...]
    held_out: tuple[Path, ...]
    reason: str


def split_bags(
    bags: Sequence[Path],
    held_out: Sequence[Path] = (),
    share: float | None = None,
    seed: int = 0,
) -> Split:
    """Choose the held-out recordings.

    In order of precedence: `held_out`; `share` of the recordings; those named ``report_*`` if
    others are named ``tune_*``; 30 %. Recordings are never divided, because consecutive frames
    show the same rocks.

    Parameters
    ----------
    bags : sequence of Path
        May include those of `held_out`.
    held_out : sequence of Path
    share : float, optional
        At least one recording is held out and at least one is kept. 0 holds out none.
    seed : int
        Seed of the choice by share.

    Raises
    ------
    ConfigurationError
        If a recording is given twice, or none is left to tune on.
    """
    _refuse_duplicates(bags)
    _refuse_duplicates(held_out)
    if held_out:
        tuned = tuple(bag for bag in bags if not any(_is_same(bag, each) for each in held_out))
        if not tuned:
            msg = 'every bag is held out: none is left to tune on'
            raise ConfigurationError(msg)
        return Split(tuned, tuple(held_out), 'as requested')
    if share is None:
        reported = [bag for bag in bags if bag_name(bag).startswith(REPORT_PREFIXES)]
        if reported and any(bag_name(bag).startswith(TUNE_PREFIXES) for bag in bags):
            return _split(bags, reported, 'by name: report_*')
        share = HELD_OUT_SHARE
    if share == 0:
        return _split(bags, (), 'as requested')
    if len(bags) == 1:
        return _split(bags, (), 'only one bag given')
    count = min(max(round(share * len(bags)), 1), len(bags) - 1)
    return _split(bags, shuffled(bags, seed)[:count], f'{count} of {len(bags)}, seed {seed}')


def folds_of(bags: Sequence[Path], count: int, seed: int = 0) -> tuple[tuple[Path, ...], ...]:
    """Divide the recordings into folds for cross-validation.

    Raises
    ------
    ConfigurationError
        If a recording is given twice, or there are fewer recordings than folds.
    """
    _refuse_duplicates(bags)
    if len(bags) < count:
        msg = f'{counted(len(bags), "bag")} cannot be divided into {count} folds'
        raise ConfigurationError(msg)
    order = shuffled(bags, seed)
    return tuple(tuple(order[number::count]) for number in range(count))


def shuffled(bags: Sequence[Path], seed: int) -> list[Path]:
    """Return the recordings in an order that depends only on their names and the seed."""

    def key(bag: Path) -> tuple[str, Path]:
        return hashlib.sha256(f'{seed}:{bag_name(bag)}'.encode()).hexdigest(), bag.resolve()

    return sorted(bags, key=key)


def _split(bags: Sequence[Path], held_out: Container[Path], reason: str) -> Split:
    return Split(
        tuple(bag for bag in bags if bag not in held_out),
        tuple(bag for bag in bags if bag in held_out),
        reason,
    )


def _refuse_duplicates(bags: Sequence[Path]) -> None:
    for index, bag in enumerate(bags):
        if any(_is_same(bag, other) for other in bags[:index]):
            msg = f'{bag} is given twice'
            raise ConfigurationError(msg)


def _is_same(one: Path, other: Path) -> bool:
    """Whether two paths name one recording: equal, or a folder and its file."""
    one, other = one.resolve(), other.resolve()
    return one == other or one in other.parents or other in one.parents
