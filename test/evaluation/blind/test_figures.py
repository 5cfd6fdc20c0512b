"""Figures of a fake detector, worked out by hand."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from blind_views import tiny_view

from rover_obstacle_detection.errors import UnjudgeablePairError
from rover_obstacle_detection.evaluation.blind.figures import (
    BlindFigures,
    Strength,
    abridged,
    judged,
    measured,
)
from rover_obstacle_detection.evaluation.blind.tables import (
    HEADER,
    as_json,
    as_markdown,
    blind_tables,
    unnoticed_table,
)


def whole(value, dtype) -> np.ndarray:
    return np.full((2, 10), value, dtype)


@dataclass
class FakeAnswer:
    """Everything free at the true disparity of 2 px, unless changed."""

    mask: np.ndarray = field(default_factory=lambda: whole(0, np.uint8))
    known: np.ndarray = field(default_factory=lambda: whole(True, bool))
    disparity: np.ndarray = field(default_factory=lambda: whole(2, np.float32))
    height: np.ndarray = field(default_factory=lambda: whole(0, np.float32))
    warnings: tuple[str, ...] = ()


def test_shares_of_the_image() -> None:
    answer = FakeAnswer()
    answer.mask[0, :4] = 255
    answer.known[1, :6] = False
    figures = measured(answer, tiny_view())
    assert (figures.free, figures.obstacle, figures.unknown) == (0.5, 0.2, 0.3)
    assert figures.obstacle_called_free == 1.0
    assert figures.blind_called_free is None
    assert figures.wrong_range == 0.0
    # Only the two pixels of rock.
    assert figures.falsely_free == 0.1


def test_obstacle_that_is_not_known_is_an_obstacle() -> None:
    answer = FakeAnswer(mask=whole(255, np.uint8), known=whole(False, bool))
    figures = measured(answer, tiny_view())
    assert (figures.free, figures.obstacle, figures.unknown) == (0.0, 1.0, 0.0)
    assert figures.obstacle_called_free == 0.0
    assert figures.wrong_range is None


def test_blind_pixels_called_free() -> None:
    blind = whole(False, bool)
    blind[1, :4] = True
    answer = FakeAnswer()
    answer.known[1, 1:4] = False
    figures = measured(answer, tiny_view(blind=blind))
    assert figures.blind_called_free == 0.25
    # One blind pixel and the two of the rock.
    assert figures.falsely_free == pytest.approx(0.15)


def test_wrong_ranges_are_shares_of_the_free_points_of_known_range() -> None:
    answer = FakeAnswer()
    # 4 / 2.6 is 23 % short of the true 2 m, 4 / 2.4 is 17 % short, 4 / 1.6 is 25 % long.
    answer.disparity[1, :3] = 2.6, 2.4, 1.6
    answer.disparity[1, 3] = 0
    answer.height[1, 4] = np.nan
    answer.known[1, 5] = False
    view = tiny_view()
    view.depth_m[1, 6:] = np.nan
    figures = measured(answer, view)
    assert figures.wrong_range == pytest.approx(2 / 13)
    assert figures.falsely_free == pytest.approx((2 + 2) / 20)


def test_ranges_follow_from_the_calibration_that_the_detector_was_told() -> None:
    view = tiny_view()
    double = replace(view, camera=replace(view.camera, baseline_m=1.0))
    assert measured(FakeAnswer(), double).wrong_range == 1.0
    assert measured(FakeAnswer(disparity=whole(4, np.float32)), double).wrong_range == 0.0


def test_refusal_and_crash_are_told_apart() -> None:
    def refuse(view):
        raise UnjudgeablePairError('both images are black: expected light')

    def crash(view):
        raise ZeroDivisionError('division by zero')

    refused, crashed = judged(tiny_view(), refuse), judged(tiny_view(), crash)
    assert refused.refusal == 'UnjudgeablePairError: both images are black: expected light'
    assert not refused.crashed
    assert refused.free is None
    assert crashed.refusal == 'crash, ZeroDivisionError: division by zero'
    assert crashed.crashed
    assert judged(tiny_view(), lambda view: FakeAnswer()).free == 1.0


@pytest.mark.parametrize(
    ('message', 'short'),
    [
        ('UnjudgeablePairError: left is black: expected light', 'left is black'),
        ('only 3.5 % of the pair matches; clean the lenses', 'only # % of the pair matches'),
        ('rows are off (by 4 px)', 'rows are off'),
        ('word ' * 30, 'word word word word word word word word word word word wo...'),
    ],
)
def test_messages_are_abridged(message: str, short: str) -> None:
    assert abridged(message) == short


def strength() -> Strength:
    return Strength(
        'Lens',
        'left out of focus',
        'sigma 2 px',
        (
            BlindFigures(refusal='UnjudgeablePairError: only 3 px match: expected more'),
            BlindFigures(refusal='UnjudgeablePairError: only 7 px match: expected more'),
            BlindFigures(refusal='crash, ValueError: no', crashed=True),
            BlindFigures(
                warnings=('blurred',),
                free=0.5,
                obstacle=0.1,
                unknown=0.4,
                wrong_range=0.3,
                falsely_free=0.15,
            ),
            BlindFigures(
                free=0.7,
                obstacle=0.3,
                unknown=0.0,
                wrong_range=0.1,
                falsely_free=0.07,
                obstacle_called_free=0.25,
            ),
        ),
    )


def test_means_are_over_the_judged_views() -> None:
    result = strength()
    assert (result.refused, result.warned, result.crashed) == (2, 1, 1)
    assert result.mean('free') == pytest.approx(0.6)
    assert result.mean('obstacle_called_free') == 0.25
    assert result.mean('blind_called_free') is None
    assert result.words() == ('only # px match', 2)
    assert result.silent.views == (result.views[4],)
    assert Strength('', '', '', ()).words() == ('', 0)


def test_tables_show_the_figures() -> None:
    result = strength()
    (table,) = blind_tables([result])
    assert table.title == 'Lens'
    assert dict(zip(HEADER, table.rows[0], strict=True)) == {
        'condition': 'left out of focus',
        'strength': 'sigma 2 px',
        'refused': '2/5, 1 crashed',
        'warned': '1/5',
        'free': '60 %',
        'obstacle': '20 %',
        'unknown': '20 %',
        'blind pixels free': '-',
        'wrong range': '20 %',
        'obstacles free': '25 %',
        'most frequent message (pairs)': 'only # px match (2)',
    }
    harmless = Strength('Lens', 'dust', 'little', (BlindFigures(free=0.9, falsely_free=0.01),))
    worse = Strength('Lens', 'dust', 'much', (BlindFigures(free=0.9, falsely_free=0.8),))
    noticed = Strength('Lens', 'dust', 'more', (BlindFigures(warnings=('x',), falsely_free=0.8),))
    assert unnoticed_table([harmless, result, noticed, worse]).rows == [
        ('dust', 'much', '1/1', '80 %', '90 %', '-', '-', '-'),
        ('left out of focus', 'sigma 2 px', '1/5', '7 %', '70 %', '-', '10 %', '25 %'),
    ]
    text = as_markdown([harmless])
    assert '### Not noticed\n\n-\n' in text
    assert '| dust | little | 0/1 | 0/1 | 90 % |' in text


def test_json_has_means_and_views() -> None:
    (row,) = json.loads(json.dumps(as_json([strength()])))
    assert row['condition'] == 'left out of focus'
    assert row['free'] == pytest.approx(0.6)
    assert (row['refused'], row['warned'], row['crashed']) == (2, 1, 1)
    assert len(row['views']) == 5
    assert row['views'][3]['warnings'] == ['blurred']
    assert row['views'][4]['obstacle_called_free'] == 0.25
