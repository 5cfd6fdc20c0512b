"""Update all generated tables and pictures of the evaluation pages in docs/.

    python scripts/update_evaluation.py                      # the standard suite
    python scripts/update_evaluation.py --bags SCENES        # a folder of labelled bags
    python scripts/update_evaluation.py --only worst causes  # single blocks

Both pages are updated: evaluation.md and its appendix evaluation_tables.md. Text outside the
generated blocks stays. Missing scenes are rendered (extra sim). Scenes named ``report_*`` and
``tune_*`` form the reporting and the tuning suite; the suites ``drawn``, ``hazards`` and
``unseen`` are rendered separately and skipped with --bags. The sample bag in bags/ has a table of
its own. The Middlebury pair needs the extra data; methods whose library is missing are skipped.

Timed results are computed in this process, one at a time. Everything else runs in --workers
processes.
"""

from __future__ import annotations

import argparse
import fnmatch
import sys
import time
from pathlib import Path

from evaluation_blocks import PAGES
from evaluation_results import Results
from generated_blocks import check_block, with_block

from rover_obstacle_detection.errors import MissingExtraError, ObstacleDetectionError
from rover_obstacle_detection.evaluation.methods.names import METHOD_DESCRIPTIONS
from rover_obstacle_detection.evaluation.methods.registry import make_method

DOCS = Path(__file__).resolve().parent.parent / 'docs'
# Suite and scenes, in the order of the arguments of `Results`.
OTHER_SUITES = (
    ('drawn', '*'),
    ('hazards', 'hazard_report_*'),
    ('hazards', 'hazard_tune_*'),
    ('unseen', '*'),
)


def main() -> None:
    """Evaluate, and update the pages block by block."""
    arguments = parsed_arguments()
    started = time.monotonic()
    blocks = [
        (arguments.docs / page, name, make)
        for page, contents in PAGES.items()
        for name, make in contents.items()
        if arguments.only is None or name in arguments.only
    ]
    for page, name, _ in blocks:
        check_block(page, name)
    failed = []
    with Results(
        scenes(arguments, 'report_*'),
        scenes(arguments, 'tune_*'),
        chosen_methods(arguments.methods),
        arguments.workers,
        *(other_suite(arguments, *each) for each in OTHER_SUITES),
    ) as results:
        for page, name, make in blocks:
            try:
                content = make(results, arguments.docs)
            except ObstacleDetectionError as error:
                failed.append(f'block {name} not updated: {error}')
                continue
            # Written at once, so that a later failure costs no finished block.
            text = with_block(page.read_text(encoding='utf-8'), name, content)
            page.write_text(text, encoding='utf-8')
    updated = len(blocks) - len(failed)
    print(f'{arguments.docs}: {updated} blocks updated in {time.monotonic() - started:.0f} s')
    if failed:
        sys.exit('\n'.join(failed))


def parsed_arguments() -> argparse.Namespace:
    """Read the command line."""
    names = [name for contents in PAGES.values() for name in contents]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--suite', default='standard', help='suite to render (default: standard)')
    parser.add_argument(
        '--bags', type=Path, metavar='DIR', help='labelled bags to use instead of the suites'
    )
    parser.add_argument(
        '--scenes', default='*', metavar='PATTERN', help="only matching scenes, as in '*_vga_*'"
    )
    parser.add_argument(
        '--method',
        action='append',
        choices=METHOD_DESCRIPTIONS,
        dest='methods',
        help='only this method; may be repeated (default: all that are installed)',
    )
    parser.add_argument(
        '--only', nargs='+', choices=names, metavar='BLOCK', help=f'of {", ".join(names)}'
    )
    parser.add_argument(
        '--workers',
        type=int,
        default=2,
        metavar='N',
        help='processes for everything that is not timed (default: 2)',
    )
    parser.add_argument(
        '--docs',
        type=Path,
        default=DOCS,
        metavar='DIR',
        help='folder of the pages (default: docs)',
    )
    return parser.parse_args()


def scenes(arguments: argparse.Namespace, kind: str) -> list[Path]:
    """Bags of the suite, or of --bags, whose names match both patterns."""
    if arguments.bags:
        bags = sorted(path for path in arguments.bags.iterdir() if path.is_dir())
    else:
        bags = rendered(arguments.suite, (kind, arguments.scenes))
    return [
        bag
        for bag in bags
        if fnmatch.fnmatch(bag.name, kind) and fnmatch.fnmatch(bag.name, arguments.scenes)
    ]


def other_suite(arguments: argparse.Namespace, suite: str, kind: str) -> list[Path]:
    """Bags of a suite that is rendered separately; none with --bags."""
    return [] if arguments.bags else rendered(suite, (kind, arguments.scenes))


def rendered(suite: str, patterns: tuple[str, ...]) -> list[Path]:
    """Bags of the scenes that match all patterns, rendered into the user's cache."""
    from rover_obstacle_detection.simulation.cache import cache_folder, simulated_bag
    from rover_obstacle_detection.simulation.suite import load_suite

    bags = []
    for scene in load_suite(suite):
        if all(fnmatch.fnmatch(scene.name, pattern) for pattern in patterns):
            print(f'scene {scene.name}', file=sys.stderr)
            bags.append(simulated_bag(scene, cache_folder()))
    return bags


def chosen_methods(only: list[str] | None) -> list[str]:
    """Names of the chosen methods whose library is installed."""
    installed = []
    for name in METHOD_DESCRIPTIONS:
        if only is not None and name not in only:
            continue
        try:
            make_method(name)
            installed.append(name)
        except MissingExtraError as error:
            print(f'skipped: {error}', file=sys.stderr)
    return installed


if __name__ == '__main__':
    main()
