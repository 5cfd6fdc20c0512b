"""Remake every figure and picture of docs/evaluation.md.

    python scripts/update_evaluation.py                  # the standard suite, rendered if need be
    python scripts/update_evaluation.py --bags SCENES    # a folder of labelled bags

Scenes named ``report_*`` make the reported figures, those named ``tune_*`` the figures to compare
them with; the recorded bag that comes with the project has a table of its own. The text of the
page between the blocks stays as it is. Rendering the suite needs the extra sim; methods whose
library is missing are left out.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.errors import MissingExtraError
from rover_obstacle_detection.evaluation.methods.names import METHOD_DESCRIPTIONS
from rover_obstacle_detection.evaluation.methods.registry import make_method
from rover_obstacle_detection.evaluation.results import Evaluation, mean_iou
from rover_obstacle_detection.evaluation.runner import RunOptions
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
from rover_obstacle_detection.offline.evaluate import BagOptions, evaluate_bags
from rover_obstacle_detection.offline.evaluation_report import summary_of

ROOT = Path(__file__).resolve().parent.parent
SAMPLE = ROOT / 'bags' / 'mars_yard'
PAGE = ROOT / 'docs' / 'evaluation.md'
PICTURES = ROOT / 'docs' / 'images'
PICTURE_NAME = 'evaluation_worst_{:02}.jpg'
OWN = 'hybrid'
WORST = 10


def main() -> None:
    """Evaluate, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--suite', default='standard', help='suite to render (default: standard)')
    parser.add_argument(
        '--bags', type=Path, metavar='DIR', help='labelled bags instead of a suite'
    )
    parser.add_argument(
        '--method',
        action='append',
        choices=METHOD_DESCRIPTIONS,
        dest='methods',
        help='leave out all others; may be repeated (default: all that are installed)',
    )
    arguments = parser.parse_args()
    bags = sorted(arguments.bags.iterdir()) if arguments.bags else rendered(arguments.suite)
    reporting = [bag for bag in bags if bag.name.startswith('report')]
    tuning = [bag for bag in bags if bag.name.startswith('tun')]
    if not reporting:
        parser.error('no scene is named report_*')
    methods = [
        name
        for name in installed_methods()
        if arguments.methods is None or name in arguments.methods
    ]
    reported = evaluated(reporting, methods, curve=True)
    tuned = evaluated(tuning, methods, curve=False)
    sample = evaluated([SAMPLE], methods, curve=False)
    text = PAGE.read_text(encoding='utf-8')
    for name, content in blocks(reported, tuned, sample).items():
        text = with_block(text, name, content)
    PAGE.write_text(text, encoding='utf-8')
    print(f'written: {PAGE}')


def rendered(suite: str) -> list[Path]:
    """Labelled bags of a suite, out of the user's cache."""
    from rover_obstacle_detection.simulation.cache import cache_folder, simulated_bag
    from rover_obstacle_detection.simulation.suite import load_suite

    bags = []
    for scene in load_suite(suite):
        print(f'scene {scene.name}', file=sys.stderr)
        bags.append(simulated_bag(scene, cache_folder()))
    return bags


def installed_methods() -> list[str]:
    """Names of the methods that can be made here."""
    installed = []
    for name in METHOD_DESCRIPTIONS:
        try:
            make_method(name)
            installed.append(name)
        except MissingExtraError as error:
            print(f'left out: {error}', file=sys.stderr)
    return installed


def evaluated(bags: Sequence[Path], methods: Sequence[str], *, curve: bool) -> Evaluation:
    """Run the methods over the bags; what cannot be used is an error here."""
    config = DetectorConfig()
    options = RunOptions(methods, config, curve=curve, worst_pictures=WORST)
    evaluation, errors = evaluate_bags(
        bags,
        options,
        BagOptions(),
        lambda index, done, expected: print(bags[index].name, done, expected, file=sys.stderr),
    )
    if errors or evaluation.problems:
        sys.exit('\n'.join((*errors, *evaluation.problems)))
    return evaluation


def blocks(reported: Evaluation, tuned: Evaluation, sample: Evaluation) -> dict[str, str]:
    """Content of each block of the page."""
    config = DetectorConfig()
    tables = {
        'methods': method_table(reported),
        'conditions': condition_table(reported, OWN),
        'condition-ious': condition_ious(reported),
        'condition-obstacles': condition_obstacles(reported),
        'gains': gain_table(reported),
        'scenes': scene_table(reported, OWN),
        'ranges': range_table(reported, OWN),
        'terrain': distribution_table(reported, config.study_max_roughness, config.study_max_step),
        'clearance': clearance_table(reported),
        'tuning': method_table(tuned) if tuned.scenes else None,
        'sample': method_table(sample),
    }
    content = {
        name: '-\n' if table is None else table.as_markdown() for name, table in tables.items()
    }
    content['reporting-scenes'] = scene_list(reported)
    content['tuning-scenes'] = scene_list(tuned)
    content['worst'] = worst_frames(reported)
    return content


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
    clearances = sorted(evaluation.curves[OWN])
    rows = []
    for max_step_m in clearances:
        cells = []
        for method in methods:
            figures = evaluation.curves[method][max_step_m]
            known = (figures.precision, figures.recall)
            cells.append(' / '.join('-' if each is None else f'{each:.2f}' for each in known))
        rows.append((f'{max_step_m:g}', *cells))
    return Table('Clearance', ('max_step (m)', *methods), rows)


def worst_frames(evaluation: Evaluation) -> str:
    """Save the worst pictures, and show each with its faults."""
    for old in PICTURES.glob('evaluation_worst_*.jpg'):
        old.unlink()
    PICTURES.mkdir(parents=True, exist_ok=True)
    lines = []
    own = [picture for picture in evaluation.pictures if picture.method == OWN]
    for number, picture in enumerate(own, 1):
        name = PICTURE_NAME.format(number)
        (PICTURES / name).write_bytes(picture.jpeg)
        lines.append(f'{number}. {picture.scene}: {summary_of(picture)}\n')
        lines.append(f'   ![{picture.scene}](images/{name})\n')
    return '\n'.join(lines)


def with_block(text: str, name: str, content: str) -> str:
    """Put content between the marks of a block."""
    begin, end = f'<!-- begin {name} -->\n', f'<!-- end {name} -->'
    before, found, rest = text.partition(begin)
    _, found_end, after = rest.partition(end)
    if not (found and found_end):
        sys.exit(f'{PAGE}: no block {name}')
    return f'{before}{begin}\n{content}\n{end}{after}'


if __name__ == '__main__':
    main()
