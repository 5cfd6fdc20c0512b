"""The blocks of docs/evaluation.md: each a function of the results, in the order of the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np
from evaluation_results import CONFIG, DRAWN_METHODS, OWN, REPORT, TUNE, Results
from studies import disparity_study
from studies.fault_tables import (
    ablation_table,
    causes_table,
    losses_table,
)
from studies.gravity_study import gravity_scene_table, gravity_table
from studies.lens_study import lens_table
from studies.reliability import JudgedObstacles, reliability_table

from rover_obstacle_detection.evaluation.results import Evaluation, mean_iou
from rover_obstacle_detection.evaluation.tables import (
    Table,
    condition_ious,
    condition_obstacles,
    condition_table,
    distribution_table,
    method_table,
    range_table,
    scene_table,
)
from rover_obstacle_detection.offline.evaluation_report import summary_lines

PICTURES = 'images'
PICTURE_NAME = 'evaluation_worst_{:02}.jpg'
GROUP_NAMES = {REPORT: 'all reporting scenes', TUNE: 'all tuning scenes'}


class Scene(Protocol):
    """What can be grouped by condition."""

    @property
    def conditions(self) -> tuple[str, ...]:
        """Names of them."""


S = TypeVar('S', bound=Scene)


def markdown(table: Table | None) -> str:
    """Write a table, or a dash where there is nothing to tell."""
    return '-\n' if table is None or not table.rows else table.as_markdown()


def scene_list(evaluation: Evaluation) -> str:
    """Say which scenes the figures are of."""
    results = evaluation.of(OWN)
    frames = sum(len(result.frames) for result in results)
    names = ', '.join(f'`{result.scene}`' for result in results)
    return f'{len(results)} scenes, {frames} frames: {names or "none"}.\n'


def gain_table(evaluation: Evaluation) -> Table:
    """Compare the hybrid with 2D alone and 3D alone, condition by condition."""
    rows = []
    for condition in evaluation.conditions:
        own, image_only, depth_only = (
            mean_iou(evaluation.of(method, condition))
            for method in (OWN, 'image_only', 'depth_only')
        )
        if own is None or image_only is None or depth_only is None:
            continue
        values = (own, image_only, depth_only, own - image_only, own - depth_only)
        rows.append((condition, *(f'{value:.3f}' for value in values)))
    header = ('condition', OWN, '2D only', '3D only', 'gain over 2D', 'gain over 3D')
    return Table('Gain', header, rows)


def clearance_table(evaluation: Evaluation) -> Table:
    """Precision / recall of each method with a clearance, a row a value of it."""
    methods = list(evaluation.curves)
    clearances = sorted({step for curve in evaluation.curves.values() for step in curve})
    rows = []
    for max_step_m in clearances:
        cells = []
        for method in methods:
            figures = evaluation.curves[method][max_step_m]
            known = (figures.precision, figures.recall)
            cells.append(' / '.join('-' if each is None else f'{each:.2f}' for each in known))
        rows.append((f'{max_step_m:g}', *cells))
    return Table('Clearance', ('max_step (m)', *methods), rows)


def terrain(results: Results) -> Table | None:
    """Tabulate roughness and step of the methods that measure them."""
    evaluation = results.timed(*results.installed(OWN, 'study'))
    return distribution_table(evaluation, CONFIG.study_max_roughness, CONFIG.study_max_step)


def worst_frames(evaluation: Evaluation, folder: Path) -> str:
    """Save the worst pictures beside the page, and show each with what went wrong in it."""
    pictures = folder / PICTURES
    pictures.mkdir(parents=True, exist_ok=True)
    for old in pictures.glob('evaluation_worst_*.jpg'):
        old.unlink()
    lines = []
    own = [picture for picture in evaluation.pictures if picture.method == OWN]
    for number, picture in enumerate(own, 1):
        name = PICTURE_NAME.format(number)
        (pictures / name).write_bytes(picture.jpeg)
        first, *others = summary_lines(picture)
        lines.append(f'{number}. {picture.scene}: {first}\n')
        lines += [f'   - {line}' for line in others]
        lines.append(f'\n   ![{picture.scene}]({PICTURES}/{name})\n')
    return '\n'.join(lines)


def by_condition(of: Callable[[str], Sequence[S]]) -> Mapping[str, Sequence[S]]:
    """Group scenes: all of either kind, and the reporting scenes by condition and rig."""
    reporting = of(REPORT)
    groups: dict[str, Sequence[S]] = {GROUP_NAMES[kind]: of(kind) for kind in (REPORT, TUNE)}
    for condition in sorted({name for scene in reporting for name in scene.conditions}):
        groups[condition] = [scene for scene in reporting if condition in scene.conditions]
    return {name: scenes for name, scenes in groups.items() if scenes}


def motorcycle(results: Results) -> Table:
    """Disparity of the Middlebury pair."""
    return disparity_study.pair_table(results.motorcycle)


def reliability(results: Results) -> Table:
    """Confidence of the obstacles of the reporting scenes, and how many are real."""
    judged = JudgedObstacles(np.zeros(0), np.zeros(0, bool))
    for scene in results.reliability(REPORT):
        judged = judged + scene
    return reliability_table('Reliability', judged)


def gains(results: Results) -> Table:
    """Compare the hybrid with what it is made of."""
    return gain_table(results.timed(*results.installed(OWN, 'image_only', 'depth_only')))


Block = Callable[[Results, Path], str]


def tabulated(make: Callable[[Results], Table | None]) -> Block:
    """Turn a table of the results into a block."""
    return lambda results, folder: markdown(make(results))


BLOCKS: dict[str, Block] = {
    'reporting-scenes': lambda results, folder: scene_list(results.timed(OWN)),
    'methods': tabulated(lambda results: method_table(results.timed(*results.methods))),
    'conditions': tabulated(lambda results: condition_table(results.timed(OWN), OWN)),
    'condition-ious': tabulated(lambda results: condition_ious(results.timed(*results.methods))),
    'condition-obstacles': tabulated(
        lambda results: condition_obstacles(results.timed(*results.methods))
    ),
    'gains': tabulated(gains),
    'ablation': tabulated(lambda results: ablation_table(results.ablation(REPORT), OWN)),
    'ablation-tuning': tabulated(lambda results: ablation_table(results.ablation(TUNE), OWN)),
    'gravity': tabulated(lambda results: gravity_table(by_condition(results.gravity))),
    'gravity-scenes': tabulated(lambda results: gravity_scene_table(results.gravity(REPORT))),
    'lenses': tabulated(lambda results: lens_table(results.lenses(REPORT))),
    'clearance': tabulated(lambda results: clearance_table(results.curves)),
    'ranges': tabulated(lambda results: range_table(results.timed(OWN), OWN)),
    'reliability': tabulated(reliability),
    'disparity': tabulated(
        lambda results: disparity_study.scenes_table(by_condition(results.disparity))
    ),
    'motorcycle': tabulated(motorcycle),
    'terrain': tabulated(terrain),
    'scenes': tabulated(lambda results: scene_table(results.timed(OWN), OWN)),
    'losses': tabulated(lambda results: losses_table(results.timed(OWN), OWN)),
    'causes': tabulated(lambda results: causes_table(results.timed(OWN), OWN)),
    'drawn': tabulated(
        lambda results: method_table(
            results.drawn(*results.installed(*DRAWN_METHODS)), with_times=False
        )
    ),
    'drawn-scenes': tabulated(
        lambda results: scene_table(results.drawn(OWN), OWN, with_times=False)
    ),
    'drawn-causes': tabulated(lambda results: causes_table(results.drawn(OWN), OWN)),
    'tuning-scenes': lambda results, folder: scene_list(results.tuned(OWN)),
    'tuning': tabulated(
        lambda results: method_table(results.tuned(*results.methods), with_times=False)
    ),
    'tuning-losses': tabulated(lambda results: losses_table(results.tuned(OWN), OWN)),
    'tuning-causes': tabulated(lambda results: causes_table(results.tuned(OWN), OWN)),
    'sample': tabulated(lambda results: method_table(results.sample(*results.methods))),
    'worst': lambda results, folder: worst_frames(results.timed(OWN), folder),
}
