"""Which recordings are held out from tuning."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection.errors import ConfigurationError

pytest.importorskip('optuna', reason='needs the extra tune')
from rover_obstacle_detection.tuning.split import folds_of, shuffled, split_bags

THREE = [Path('bags/day1'), Path('bags/day2'), Path('bags/day3')]


def days(count: int) -> list[Path]:
    return [Path(f'bags/day{number}') for number in range(count)]


def test_named_bags_are_held_out_even_if_listed_for_tuning() -> None:
    split = split_bags(THREE, held_out=[Path('bags/../bags/day2'), Path('other')])
    assert split.tuned == (THREE[0], THREE[2])
    assert split.held_out == (Path('bags/../bags/day2'), Path('other'))


def test_report_scenes_are_held_out() -> None:
    bags = [Path('tune_noon'), Path('report_moon.mcap'), Path('drive'), Path('reporting_dusk')]
    split = split_bags(bags)
    assert split.tuned == (bags[0], bags[2])
    assert split.held_out == (bags[1], bags[3])
    assert 'report_' in split.reason


def test_report_names_need_tune_names_beside_them() -> None:
    assert len(split_bags([Path('report_a'), Path('report_b'), Path('report_c')]).held_out) == 1


def test_by_default_one_of_three_bags_is_held_out() -> None:
    split = split_bags(THREE)
    assert len(split.held_out) == 1
    assert set(split.tuned) | set(split.held_out) == set(THREE)
    assert split.reason == '1 of 3, seed 0'


def test_share_overrides_names() -> None:
    bags = [Path('tune_a'), Path('tune_b'), Path('report_a'), Path('report_b')]
    assert len(split_bags(bags, share=0.75).held_out) == 3


def test_one_bag_is_not_held_out() -> None:
    split = split_bags(THREE[:1])
    assert split.held_out == ()
    assert split.reason == 'only one bag given'


def test_share_zero_holds_out_nothing() -> None:
    assert split_bags(THREE, share=0.0).held_out == ()


@given(st.integers(2, 12), st.floats(0.01, 0.99), st.integers(0, 5), st.randoms())
def test_choice_by_share_ignores_the_order_of_bags(count, share, seed, random) -> None:
    bags = days(count)
    split = split_bags(bags, share=share, seed=seed)
    random.shuffle(bags)
    again = split_bags(bags, share=share, seed=seed)
    assert set(again.held_out) == set(split.held_out)
    assert 1 <= len(split.held_out) < count
    assert not set(split.held_out) & set(split.tuned)


def test_seed_changes_the_choice() -> None:
    assert len({tuple(shuffled(days(9), seed)) for seed in range(8)}) > 4


@given(st.integers(2, 12), st.integers(2, 12), st.integers(0, 5))
def test_every_bag_is_in_exactly_one_fold(bags, count, seed) -> None:
    if bags < count:
        with pytest.raises(ConfigurationError, match='cannot be divided'):
            folds_of(days(bags), count, seed)
        return
    folds = folds_of(days(bags), count, seed)
    assert sorted(bag for fold in folds for bag in fold) == sorted(days(bags))
    assert max(map(len, folds)) - min(map(len, folds)) <= 1


def test_duplicate_bags_are_refused(tmp_path: Path) -> None:
    folder = tmp_path / 'day1'
    folder.mkdir()
    for duplicate in (folder, folder / 'day1_0.mcap', tmp_path / 'x' / '..' / 'day1'):
        with pytest.raises(ConfigurationError, match='given twice'):
            split_bags([folder, tmp_path / 'day2', duplicate])
    # A file inside a held-out folder is not tuned on either.
    split = split_bags([folder / 'day1_0.mcap', tmp_path / 'day2'], held_out=[folder])
    assert split.tuned == (tmp_path / 'day2',)


def test_holding_out_every_bag_is_refused() -> None:
    with pytest.raises(ConfigurationError, match='none is left'):
        split_bags(THREE, held_out=THREE)
