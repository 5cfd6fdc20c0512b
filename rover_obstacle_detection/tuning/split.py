"""Which recordings parameters are tuned on, and which are kept from it to tell if they hold."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.offline.evaluate import bag_name

HELD_OUT_SHARE = 0.3
TUNE_PREFIXES = ('tune_', 'tuning_')
REPORT_PREFIXES = ('report_', 'reporting_')


@dataclass(frozen=True)
class Split:
    """Recordings to tune on and recordings held out.

    Parameters
    ----------
    tuned, held_out : tuple of Path
        In the order given.
    reason : str
        How the held-out ones were chosen, or why there are none.
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
    """Choose the recordings that are held out.

    Those that are named; else, if a share is given, so many; else, if some are called ``tune_*``
    and others ``report_*``, the latter; else 30 %. Always whole recordings: the next frame of a
    drive shows the same rocks.

    Parameters
    ----------
    bags : sequence of Path
        All of them; they may include those that are held out.
    held_out : sequence of Path
        Those to be held out.
    share : float, optional
        Share of the recordings to hold out: at least one, but not the last. With 0 none.
    seed : int
        Of the choice by share.

    Raises
    ------
    ConfigurationError
        If a recording is given twice, or none is left to tune on.
    """
    _refuse_twice(bags)
    _refuse_twice(held_out)
    if held_out:
        tuned = tuple(bag for bag in bags if not any(_is_same(bag, each) for each in held_out))
        if not tuned:
            msg = 'every bag is held out: none is left to tune on'
            raise ConfigurationError(msg)
        return Split(tuned, tuple(held_out), 'as asked for')
    if share is None:
        reported = [bag for bag in bags if bag_name(bag).startswith(REPORT_PREFIXES)]
        if reported and any(bag_name(bag).startswith(TUNE_PREFIXES) for bag in bags):
            return _split(bags, reported, 'by name: report_*')
    if share == 0:
        return Split(tuple(bags), (), 'as asked for')
    if len(bags) == 1:
        return Split(tuple(bags), (), 'there is one bag only')
    share = HELD_OUT_SHARE if share is None else share
    count = min(max(round(share * len(bags)), 1), len(bags) - 1)
    return _split(bags, shuffled(bags, seed)[:count], f'{count} of {len(bags)}, seed {seed}')


def folds_of(bags: Sequence[Path], count: int, seed: int = 0) -> tuple[tuple[Path, ...], ...]:
    """Share the recordings out among folds, each held out once.

    Raises
    ------
    ConfigurationError
        If a recording is given twice, or there are fewer than folds.
    """
    _refuse_twice(bags)
    if len(bags) < count:
        msg = f'{len(bags)} bags cannot be shared out among {count} folds'
        raise ConfigurationError(msg)
    order = shuffled(bags, seed)
    return tuple(tuple(order[number::count]) for number in range(count))


def shuffled(bags: Sequence[Path], seed: int) -> list[Path]:
    """Put recordings into an order that only their names and the seed decide."""

    def key(bag: Path) -> tuple[str, Path]:
        return hashlib.sha256(f'{seed}:{bag_name(bag)}'.encode()).hexdigest(), bag.resolve()

    return sorted(bags, key=key)


def _split(bags: Sequence[Path], held_out: Sequence[Path], reason: str) -> Split:
    return Split(
        tuple(bag for bag in bags if bag not in held_out),
        tuple(bag for bag in bags if bag in held_out),
        reason,
    )


def _refuse_twice(bags: Sequence[Path]) -> None:
    for index, bag in enumerate(bags):
        if any(_is_same(bag, other) for other in bags[:index]):
            msg = f'{bag} is given twice: tuned on and held out, it would say nothing'
            raise ConfigurationError(msg)


def _is_same(one: Path, other: Path) -> bool:
    """Tell whether two paths are one recording: the same, or a folder and its file."""
    one, other = one.resolve(), other.resolve()
    return one == other or one in other.parents or other in one.parents
