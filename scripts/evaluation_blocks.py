"""The generated blocks of docs/evaluation.md and docs/evaluation_tables.md, in page order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np
from evaluation_results import (
    CONFIG,
    DRAWN,
    DRAWN_METHODS,
    HAZARD_REPORT,
    HAZARD_TUNE,
    OWN,
    REPORT,
    SAMPLE,
    TUNE,
    UNSEEN,
    Results,
)
from studies.disparity_study import pair_table, scenes_table
from studies.fault_tables import ablation_table, causes_table, losses_table
from studies.gravity_study import gravity_scene_table, gravity_table
from studies.lens_study import lens_table
from studies.reliability import JudgedObstacles, reliability_table
from studies.summary_tables import (
    Suites,
    failures_table,
    stages_table,
    suites_table,
    summary_table,
)

from rover_obstacle_detection.evaluation.methods.names import METHOD_DESCRIPTIONS
from rover_obstacle_detection.evaluation.results import Evaluation, mean_iou
from rover_obstacle_detection.evaluation.tables import (
    Table,
    condition_ious,
    condition_obstacles,
    condition_table,
    distribution_table,
    method_table,
    number,
    range_table,
    scene_table,
)
from rover_obstacle_detection.offline.evaluation_report import summary_lines

PICTURES = 'images'
PICTURE_NAME = 'evaluation_worst_{:02}.jpg'
SUITE_NAMES = {
    REPORT: 'reporting',
    TUNE: 'tuning',
    DRAWN: 'drawn',
    HAZARD_REPORT: 'hazards, reporting',
    HAZARD_TUNE: 'hazards, tuning',
    UNSEEN: 'unseen',
}


class Scene(Protocol):
    """A result that can be grouped by condition."""

    @property
    def conditions(self) -> tuple[str, ...]:
        """Names of the conditions."""


S = TypeVar('S', bound=Scene)


def markdown(table: Table | None) -> str:
    """Format a table; a dash if it is empty."""
    return '-\n' if table is None or not table.rows else table.as_markdown()


def scene_list(evaluation: Evaluation) -> str:
    """List the scenes of an evaluation."""
    results = evaluation.of(OWN)
    frames = sum(len(result.frames) for result in results)
    names = ', '.join(f'`{result.scene}`' for result in results)
    return f'{len(results)} scenes, {frames} frames: {names or "none"}.\n'


def gain_table(evaluation: Evaluation) -> Table:
    """Compare the hybrid with 2D only and 3D only, one row per condition."""
    rows = []
    for condition in evaluation.conditions:
        own, image_only, depth_only = (
            mean_iou(evaluation.of(method, condition))
            for method in (OWN, 'image_only', 'depth_only')
        )
        if own is None or image_only is None or depth_only is None:
            continue
        values = (own, image_only, depth_only, own - image_only, own - depth_only)
        rows.append((condition, *map(number, values)))
    header = ('condition', OWN, '2D only', '3D only', 'gain over 2D', 'gain over 3D')
    return Table('Gain', header, rows)


def clearance_table(evaluation: Evaluation) -> Table:
    """Tabulate precision / recall, one row per clearance and one column per method."""
    clearances = sorted({step for curve in evaluation.curves.values() for step in curve})
    rows = []
    for max_step_m in clearances:
        figures = [curve[max_step_m] for curve in evaluation.curves.values()]
        cells = (f'{number(each.precision, 2)} / {number(each.recall, 2)}' for each in figures)
        rows.append((f'{max_step_m:g}', *cells))
    return Table('Clearance', ('max_step (m)', *evaluation.curves), rows)


def worst_frames(evaluation: Evaluation, folder: Path) -> str:
    """Save the worst pictures next to the page, and list them with their faults."""
    pictures = folder / PICTURES
    pictures.mkdir(parents=True, exist_ok=True)
    for old in pictures.glob('evaluation_worst_*.jpg'):
        old.unlink()
    lines = []
    own = [picture for picture in evaluation.pictures if picture.method == OWN]
    for position, picture in enumerate(own, 1):
        name = PICTURE_NAME.format(position)
        (pictures / name).write_bytes(picture.jpeg)
        first, *others = summary_lines(picture)
        lines.append(f'{position}. {picture.scene}: {first}\n')
        lines += [f'   - {line}' for line in others]
        lines.append(f'\n   ![{picture.scene}]({PICTURES}/{name})\n')
    return '\n'.join(lines)


def by_condition(of: Callable[[str], Sequence[S]]) -> Mapping[str, Sequence[S]]:
    """Group scenes by suite, and the reporting scenes also by condition."""
    reporting = of(REPORT)
    groups: dict[str, Sequence[S]] = {
        f'all {SUITE_NAMES[suite]} scenes': of(suite) for suite in (REPORT, TUNE)
    }
    for condition in sorted({name for scene in reporting for name in scene.conditions}):
        groups[condition] = [scene for scene in reporting if condition in scene.conditions]
    return {name: scenes for name, scenes in groups.items() if scenes}


def reliability(results: Results) -> Table:
    """Tabulate confidence against the share of real obstacles in the reporting scenes."""
    nothing = JudgedObstacles(np.zeros(0), np.zeros(0, bool))
    return reliability_table('Reliability', sum(results.reliability(REPORT), nothing))


def suites(results: Results) -> Suites:
    """Results of the hybrid by suite."""
    return {name: results.of(suite, OWN).of(OWN) for suite, name in SUITE_NAMES.items()}


def stages(results: Results) -> Table:
    """Tabulate the stages that matter most."""
    ablations = {SUITE_NAMES[suite]: results.ablation(suite) for suite in (REPORT, TUNE)}
    return stages_table(ablations, OWN)


def descriptions(results: Results) -> Table:
    """Tabulate what each method is."""
    rows = [(name, METHOD_DESCRIPTIONS[name]) for name in results.methods]
    return Table('Methods', ('method', 'description'), rows)


def terrain(results: Results) -> Table | None:
    """Tabulate roughness and step of the methods that measure them."""
    evaluation = results.of(REPORT, *results.installed(OWN, 'study'))
    return distribution_table(evaluation, CONFIG.study_max_roughness, CONFIG.study_max_step)


Block = Callable[[Results, Path], str]


def tabulated(make: Callable[[Results], Table | None]) -> Block:
    """Turn a table of the results into a block."""
    return lambda results, folder: markdown(make(results))


SUMMARY_BLOCKS: dict[str, Block] = {
    'summary': tabulated(lambda results: summary_table(results.of(REPORT, *results.methods))),
    'suites': tabulated(lambda results: suites_table(suites(results))),
    'stages': tabulated(stages),
    'failures': tabulated(lambda results: failures_table(suites(results))),
}

TABLE_BLOCKS: dict[str, Block] = {
    'descriptions': tabulated(descriptions),
    'reporting-scenes': lambda results, folder: scene_list(results.of(REPORT, OWN)),
    'methods': tabulated(lambda results: method_table(results.of(REPORT, *results.methods))),
    'conditions': tabulated(lambda results: condition_table(results.of(REPORT, OWN), OWN)),
    'condition-ious': tabulated(
        lambda results: condition_ious(results.of(REPORT, *results.methods))
    ),
    'condition-obstacles': tabulated(
        lambda results: condition_obstacles(results.of(REPORT, *results.methods))
    ),
    'gains': tabulated(
        lambda results: gain_table(
            results.of(REPORT, *results.installed(OWN, 'image_only', 'depth_only'))
        )
    ),
    'scenes': tabulated(lambda results: scene_table(results.of(REPORT, OWN), OWN)),
    'losses': tabulated(lambda results: losses_table(results.of(REPORT, OWN), OWN)),
    'causes': tabulated(lambda results: causes_table(results.of(REPORT, OWN), OWN)),
    'ranges': tabulated(lambda results: range_table(results.of(REPORT, OWN), OWN)),
    'clearance': tabulated(lambda results: clearance_table(results.curves)),
    'ablation': tabulated(lambda results: ablation_table(results.ablation(REPORT), OWN)),
    'ablation-tuning': tabulated(lambda results: ablation_table(results.ablation(TUNE), OWN)),
    'gravity': tabulated(lambda results: gravity_table(by_condition(results.gravity))),
    'gravity-scenes': tabulated(lambda results: gravity_scene_table(results.gravity(REPORT))),
    'lenses': tabulated(lambda results: lens_table(results.lenses(REPORT))),
    'reliability': tabulated(reliability),
    'disparity': tabulated(lambda results: scenes_table(by_condition(results.disparity))),
    'motorcycle': tabulated(lambda results: pair_table(results.motorcycle)),
    'terrain': tabulated(terrain),
    'drawn': tabulated(
        lambda results: method_table(
            results.of(DRAWN, *results.installed(*DRAWN_METHODS)), with_times=False
        )
    ),
    'drawn-scenes': tabulated(
        lambda results: scene_table(results.of(DRAWN, OWN), OWN, with_times=False)
    ),
    'drawn-causes': tabulated(lambda results: causes_table(results.of(DRAWN, OWN), OWN)),
    'tuning-scenes': lambda results, folder: scene_list(results.of(TUNE, OWN)),
    'tuning': tabulated(
        lambda results: method_table(results.of(TUNE, *results.methods), with_times=False)
    ),
    'tuning-losses': tabulated(lambda results: losses_table(results.of(TUNE, OWN), OWN)),
    'tuning-causes': tabulated(lambda results: causes_table(results.of(TUNE, OWN), OWN)),
    'sample': tabulated(lambda results: method_table(results.of(SAMPLE, *results.methods))),
    'worst': lambda results, folder: worst_frames(results.of(REPORT, OWN), folder),
}

PAGES: dict[str, dict[str, Block]] = {
    'evaluation.md': SUMMARY_BLOCKS,
    'evaluation_tables.md': TABLE_BLOCKS,
}
"""Blocks of each page in docs/, by name."""
