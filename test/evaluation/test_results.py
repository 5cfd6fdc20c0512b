"""Figures by distance, distributions, results and tables against values worked out by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rover_obstacle_detection.evaluation.distributions import (
    EDGES_M,
    Distribution,
    TerrainDistributions,
)
from rover_obstacle_detection.evaluation.faults import Fault, find_faults
from rover_obstacle_detection.evaluation.figures import Figures, score
from rover_obstacle_detection.evaluation.ranges import score_by_range, span_names
from rover_obstacle_detection.evaluation.results import (
    Evaluation,
    FrameResult,
    Picture,
    SceneResult,
    mean_iou,
    merged,
    total,
    worst,
    worst_condition,
)
from rover_obstacle_detection.evaluation.tables import (
    condition_ious,
    condition_obstacles,
    condition_table,
    distribution_table,
    method_table,
    range_table,
    scene_table,
)

HALF_RIGHT = Figures(frames=1, true_positives=50, false_negatives=50, rocks=2, rocks_found=1)
RIGHT = Figures(frames=1, true_positives=100, rocks=2, rocks_found=2)
NO_TRUTH = Figures(frames=1, false_positives=300, true_negatives=700, false_alarms=2)


def scene(
    name: str, figures: Figures, *conditions: str, method: str = 'hybrid', seconds: float = 0.2
) -> SceneResult:
    return SceneResult(method, name, conditions, (FrameResult(0, figures, seconds, 0.1),))


def picture(name: str, figures: Figures, *faults: Fault, method: str = 'hybrid') -> Picture:
    return Picture(method, name, FrameResult(0, figures, 0.2, 0.1, faults=faults), b'')


def evaluation() -> Evaluation:
    return Evaluation(
        scenes=(
            scene('one', HALF_RIGHT, 'noon', 'rig study'),
            scene('two', RIGHT, 'moon', 'rig study'),
            scene('three', NO_TRUTH, 'pebbles', 'rig vga'),
            scene('one', RIGHT, 'noon', 'rig study', method='study', seconds=0.4),
        )
    )


def test_figures_are_divided_by_distance() -> None:
    labels = np.zeros((40, 60), np.uint8)
    instances = np.zeros((40, 60), np.uint16)
    labels[5:25, 5:15], instances[5:25, 5:15] = 1, 1
    labels[5:25, 40:50], instances[5:25, 40:50] = 1, 2
    depth_m = np.full((40, 60), 1.2, np.float32)
    depth_m[:, 30:] = 5.0
    depth_m[0] = np.nan
    mask = np.zeros((40, 60), np.uint8)
    mask[5:25, 5:15] = 255
    mask[28:40, 45:55] = 255
    known = np.zeros((40, 60), bool)
    known[:, 45:] = True
    scored = score_by_range(mask, labels, instances, depth_m, known)
    spans = dict(zip(span_names(), scored, strict=True))
    assert spans['1-1.5 m'] == Figures(
        frames=1,
        true_positives=200,
        true_negatives=39 * 30 - 200,
        rocks=1,
        rocks_found=1,
        checked_obstacle_pixels=200,
        checked_free_pixels=39 * 30 - 200,
    )
    assert spans['4-6 m'] == Figures(
        frames=1,
        false_negatives=200,
        false_positives=120,
        true_negatives=39 * 30 - 320,
        rocks=1,
        false_alarms=1,
        called_free=100,
        checked_obstacle_pixels=200,
        confirmed_free=39 * 15 - 100 - 120,
        checked_free_pixels=39 * 30 - 200,
    )
    assert spans['over 15 m'] == Figures()
    together = total(spans.values())
    whole = score(mask, labels, instances)
    assert together.false_alarms == whole.false_alarms
    assert together.true_positives == whole.true_positives
    assert whole.true_negatives - together.true_negatives == 60, 'the row without depth'


def test_area_counts_at_its_median_distance() -> None:
    labels = np.full((50, 60), 2, np.uint8)
    depth_m = np.full((50, 60), 2.5, np.float32)
    depth_m[:10] = 9.0
    spans = score_by_range(
        np.full((50, 60), 255, np.uint8), labels, np.zeros((50, 60), np.uint16), depth_m
    )
    found = {
        name: (figures.areas, figures.areas_found)
        for name, figures in zip(span_names(), spans, strict=True)
        if figures.areas
    }
    assert found == {'2-3 m': (1, 1)}


def test_distribution_separates_free_ground_from_obstacles() -> None:
    labels = np.array([[0, 0, 1, 2, 255, 0]], np.uint8)
    values = np.array([[0.001, 0.002, 0.02, 0.05, 9.0, np.nan]], np.float32)
    distribution = Distribution.of(values, labels)
    assert distribution.free.sum() == 2
    assert distribution.obstacle.sum() == 2
    assert distribution.separation == 1.0
    assert distribution.share_over(0.0101) == (0.0, 1.0)
    assert distribution.share_over(0.03) == (0.0, 0.5)
    median = distribution.quantile(distribution.free, 0.5)
    assert median == pytest.approx(0.001, rel=0.13)


def test_equal_distributions_have_separation_one_half() -> None:
    labels = np.array([[0, 1, 0, 1]], np.uint8)
    values = np.array([[0.01, 0.01, 0.2, 0.2]], np.float32)
    assert Distribution.of(values, labels).separation == pytest.approx(0.5)


def test_distribution_without_obstacles_has_no_separation() -> None:
    distribution = Distribution.of(np.ones((2, 2), np.float32), np.zeros((2, 2), np.uint8))
    assert distribution.separation is None
    assert distribution.share_over(0.5) == (1.0, None)
    assert distribution.quantile(distribution.obstacle, 0.5) is None


def test_values_off_the_scale_are_counted() -> None:
    values = np.array([[0.0, 1e-9, 5.0]], np.float32)
    assert Distribution.of(values, np.zeros((1, 3), np.uint8)).free.sum() == 3


def test_mean_iou_is_over_scenes_with_obstacles() -> None:
    assert mean_iou(evaluation().of('hybrid')) == pytest.approx(0.75)
    assert mean_iou(evaluation().of('hybrid', 'pebbles')) is None


def test_worst_condition_has_the_lowest_iou() -> None:
    assert worst_condition(evaluation(), 'hybrid') == ('noon', 0.5)
    assert worst_condition(Evaluation(), 'hybrid') is None


def test_scene_counts_under_each_of_its_conditions() -> None:
    assert evaluation().conditions == ('moon', 'noon', 'pebbles', 'rig study', 'rig vga')
    assert [each.scene for each in evaluation().of('hybrid', 'rig study')] == ['one', 'two']


def test_times_are_relative_to_plain_stereo() -> None:
    frames = tuple(FrameResult(0, RIGHT, seconds, 0.1) for seconds in (0.1, 0.3, 9.0))
    result = SceneResult('hybrid', 'one', (), frames)
    assert result.median_seconds == 0.3
    assert result.times_plain == pytest.approx(3.0)


def test_merging_adds_curves_and_distributions_and_keeps_the_worst_pictures() -> None:
    counts = np.zeros(len(EDGES_M) - 1, np.intp)
    counts[3] = 5
    both = TerrainDistributions(Distribution(counts, counts), Distribution(counts, counts))
    parts = [
        Evaluation(
            scenes=(scene(name, RIGHT, 'noon'),),
            curves={'hybrid': {0.1: RIGHT}},
            distributions={'hybrid': both},
            pictures=(picture(name, figures),),
            problems=(f'{name} is bad',),
        )
        for name, figures in (('good', RIGHT), ('bad', HALF_RIGHT))
    ]
    whole = merged(parts, 1)
    assert whole.curves['hybrid'][0.1].rocks == 4
    assert whole.distributions['hybrid'].step.free[3] == 10
    assert [picture.scene for picture in whole.pictures] == ['bad']
    assert whole.problems == ('good is bad', 'bad is bad')


def test_missed_and_invented_obstacles_are_worse_than_a_poor_outline() -> None:
    outline = Figures(frames=1, true_positives=60, false_negatives=40, rocks=2, rocks_found=2)
    missed, alarm = Fault('missed rock', 300, 2.0), Fault('false alarm', 200, None)
    pictures = [
        picture('outline', outline),
        picture('alarms', NO_TRUTH, alarm, alarm),
        picture('missed', HALF_RIGHT, missed),
        picture('other', RIGHT, method='study'),
    ]
    kept = worst(pictures, 2)
    assert [picture.scene for picture in kept] == ['alarms', 'missed', 'other']


def test_faults_are_named_with_size_and_distance() -> None:
    labels = np.zeros((60, 60), np.uint8)
    instances = np.zeros((60, 60), np.uint16)
    labels[:20, :20], instances[:20, :20] = 1, 4
    labels[:20, 40:], instances[:20, 40:] = 1, 5
    depth_m = np.full((60, 60), 3.0, np.float32)
    depth_m[40:] = 1.5
    mask = np.zeros((60, 60), np.uint8)
    mask[:20, :20] = mask[45:55, 10:40] = 255
    faults = [str(fault) for fault in find_faults(mask, labels, instances, depth_m)]
    assert faults == ['missed rock of 400 px at 3.0 m', 'false alarm of 300 px at 1.5 m']
    without_depth = find_faults(mask, labels, instances)
    assert str(without_depth[0]) == 'missed rock of 400 px'
    slope = find_faults(mask, np.full((60, 60), 2, np.uint8), instances, depth_m)
    assert [fault.kind for fault in slope] == ['missed slope or drop']


def test_method_table() -> None:
    table = method_table(evaluation())
    assert table.rows[0] == (
        'hybrid', '0.750', '0.333', '0.750', '0.462', '3/4', '0.67', '-', '0.500', '200', '2.00',
    )  # fmt: skip
    assert table.rows[1][0] == 'study'
    assert len(table.header) == len(table.rows[0])
    assert table.header[-2:] == ('ms', 'x SGBM')
    without_times = method_table(evaluation(), with_times=False)
    assert without_times.header == table.header[:-2]
    assert without_times.rows[0] == table.rows[0][:-2]


def test_undefined_ratio_is_a_dash() -> None:
    rows = {row[0]: row for row in condition_table(evaluation(), 'hybrid').rows}
    assert rows['pebbles'] == ('pebbles', '1', '-', '0.000', '-', '0.000', '0/0', '2.00', '-')


def test_methods_side_by_side() -> None:
    ious = {row[0]: row[1:] for row in condition_ious(evaluation()).rows}
    assert ious['noon'] == ('0.500', '1.000')
    assert ious['moon'] == ('1.000', '-')
    found = {row[0]: row[1:] for row in condition_obstacles(evaluation()).rows}
    assert found['noon'] == ('1/2, 0.0', '2/2, 0.0')


def test_scene_table() -> None:
    rows = scene_table(evaluation(), 'study').rows
    assert rows == [
        ('one', '1', '1.000', '1.000', '1.000', '1.000', '2/2', '0.00', '-', '400', '4.00')
    ]


def test_range_table_needs_depth() -> None:
    assert range_table(evaluation(), 'hybrid') is None
    near = replace(RIGHT, called_free=1, checked_obstacle_pixels=40)
    spans = (Figures(), near, *(Figures() for _ in span_names()[2:]))
    known = SceneResult('hybrid', 'one', (), (FrameResult(0, RIGHT, 0.1, 0.1),), spans)
    table = range_table(Evaluation(scenes=(known,)), 'hybrid')
    assert table is not None
    assert table.rows == [('1-1.5 m', '1.000', '1.000', '1.000', '2/2', '0', '2.5 %')]


def test_distribution_table_shows_shares_above_the_thresholds() -> None:
    labels = np.array([[0, 0, 1, 1]], np.uint8)
    distribution = Distribution.of(np.array([[0.001, 0.001, 0.001, 0.02]], np.float32), labels)
    known = Evaluation(distributions={'study': TerrainDistributions(distribution, distribution)})
    table = distribution_table(known, 0.0005, 0.005)
    assert table is not None
    roughness, step = table.rows
    assert roughness[-3:] == ('0.5 mm', '100 %', '100 %')
    assert step[-3:] == ('5 mm', '0 %', '50 %')
    assert step[3] == '0.750'
    assert distribution_table(Evaluation(), 0.0005, 0.005) is None


def test_table_in_markdown() -> None:
    lines = condition_ious(evaluation()).as_markdown().splitlines()
    assert lines[:2] == ['| condition | hybrid | study |', '| --- | ---: | ---: |']
    assert lines[3] == '| noon | 0.500 | 1.000 |'
