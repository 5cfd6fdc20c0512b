"""Whole recordings are held out: those named, those called report_*, or a share of them."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.tuning.split import folds_of, shuffled, split_bags

THREE = [Path('bags/day1'), Path('bags/day2'), Path('bags/day3')]


def days(count: int) -> list[Path]:
    return [Path(f'bags/day{number}') for number in range(count)]


def test_those_named_are_held_out_also_if_they_are_among_the_others() -> None:
    split = split_bags(THREE, held_out=[Path('bags/../bags/day2'), Path('other')])
    assert split.tuned == (THREE[0], THREE[2])
    assert split.held_out == (Path('bags/../bags/day2'), Path('other'))


def test_scenes_named_for_reporting_are_held_out() -> None:
    bags = [Path('tune_noon'), Path('report_moon.mcap'), Path('drive'), Path('reporting_dusk')]
    split = split_bags(bags)
    assert split.tuned == (bags[0], bags[2])
    assert split.held_out == (bags[1], bags[3])
    assert 'report_' in split.reason


def test_names_decide_only_where_there_are_both() -> None:
    assert len(split_bags([Path('report_a'), Path('report_b'), Path('report_c')]).held_out) == 1


def test_of_three_bags_one_is_held_out() -> None:
    split = split_bags(THREE)
    assert len(split.held_out) == 1
    assert set(split.tuned) | set(split.held_out) == set(THREE)
    assert split.reason == '1 of 3, seed 0'


def test_a_share_comes_before_the_names() -> None:
    bags = [Path('tune_a'), Path('tune_b'), Path('report_a'), Path('report_b')]
    assert len(split_bags(bags, share=0.75).held_out) == 3


def test_with_one_bag_nothing_is_held_out_and_the_reason_is_given() -> None:
    split = split_bags(THREE[:1])
    assert split.held_out == ()
    assert split.reason == 'there is one bag only'


def test_none_is_held_out_on_request() -> None:
    assert split_bags(THREE, share=0.0).held_out == ()


@given(st.integers(2, 12), st.floats(0.01, 0.99), st.integers(0, 5), st.randoms())
def test_a_share_is_the_same_in_any_order(count, share, seed, random) -> None:
    bags = days(count)
    split = split_bags(bags, share=share, seed=seed)
    random.shuffle(bags)
    again = split_bags(bags, share=share, seed=seed)
    assert set(again.held_out) == set(split.held_out)
    assert 1 <= len(split.held_out) < count
    assert not set(split.held_out) & set(split.tuned)


def test_another_seed_is_another_choice() -> None:
    assert len({tuple(shuffled(days(9), seed)) for seed in range(8)}) > 4


@given(st.integers(2, 12), st.integers(2, 12), st.integers(0, 5))
def test_every_bag_is_in_one_fold(bags, count, seed) -> None:
    if bags < count:
        with pytest.raises(ConfigurationError, match='cannot be shared out'):
            folds_of(days(bags), count, seed)
        return
    folds = folds_of(days(bags), count, seed)
    assert sorted(bag for fold in folds for bag in fold) == sorted(days(bags))
    assert max(map(len, folds)) - min(map(len, folds)) <= 1


def test_a_bag_is_not_taken_twice(tmp_path: Path) -> None:
    folder = tmp_path / 'day1'
    folder.mkdir()
    for twice in (folder, folder / 'day1_0.mcap', tmp_path / 'x' / '..' / 'day1'):
        with pytest.raises(ConfigurationError, match='given twice'):
            split_bags([folder, tmp_path / 'day2', twice])
    # Nor is a file tuned on whose folder is held out.
    split = split_bags([folder / 'day1_0.mcap', tmp_path / 'day2'], held_out=[folder])
    assert split.tuned == (tmp_path / 'day2',)


def test_a_bag_must_be_left_to_tune_on() -> None:
    with pytest.raises(ConfigurationError, match='none is left'):
        split_bags(THREE, held_out=THREE)
