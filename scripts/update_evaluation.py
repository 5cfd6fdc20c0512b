"""Remake every figure and picture of docs/evaluation.md.

    python scripts/update_evaluation.py                      # the standard suite
    python scripts/update_evaluation.py --bags SCENES        # a folder of labelled bags
    python scripts/update_evaluation.py --only worst causes  # these blocks of the page alone

The suite is rendered where it is not yet (extra sim). Scenes named ``report_*`` make the reported
figures, those named ``tune_*`` the figures to compare them with, and those of the suite `drawn`
figures of rigs that nothing was trained on; the recorded bag that comes with
the project has a table of its own. The text of the page between the blocks stays as it is. The
pair of Middlebury needs the extra data; methods whose library is missing are left out.

What has a time in it is run in this process, one call after another with nothing beside it; all
the rest is shared out among --workers processes.
"""

from __future__ import annotations

import argparse
import fnmatch
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from evaluation_blocks import BLOCKS
from evaluation_results import Results

from rover_obstacle_detection.errors import MissingExtraError, ObstacleDetectionError
from rover_obstacle_detection.evaluation.methods.names import METHOD_DESCRIPTIONS
from rover_obstacle_detection.evaluation.methods.registry import make_method

PAGE = Path(__file__).resolve().parent.parent / 'docs' / 'evaluation.md'


def main() -> None:
    """Evaluate, and write the page."""
    arguments = parsed_arguments()
    started = time.monotonic()
    results = Results(
        scenes(arguments, 'report_*'),
        scenes(arguments, 'tune_*'),
        chosen_methods(arguments.methods),
        arguments.workers,
        drawn(arguments),
    )
    names = arguments.only or list(BLOCKS)
    check_blocks(arguments.page.read_text(encoding='utf-8'), names)
    failed = []
    with results:
        for name in names:
            try:
                content = BLOCKS[name](results, arguments.page.parent)
            except ObstacleDetectionError as error:
                failed.append(f'block {name} stays as it was: {error}')
                continue
            # At once: what took half an hour is not lost with what fails after it.
            text = with_block(arguments.page.read_text(encoding='utf-8'), name, content)
            arguments.page.write_text(text, encoding='utf-8')
    print(f'written: {arguments.page}, in {time.monotonic() - started:.0f} s')
    if failed:
        sys.exit('\n'.join(failed))


def parsed_arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--suite', default='standard', help='suite to render (default: standard)')
    parser.add_argument(
        '--bags', type=Path, metavar='DIR', help='labelled bags instead of a suite'
    )
    parser.add_argument(
        '--scenes', default='*', metavar='PATTERN', help="leave out all others, as in '*_vga_*'"
    )
    parser.add_argument(
        '--method',
        action='append',
        choices=METHOD_DESCRIPTIONS,
        dest='methods',
        help='leave out all others; may be repeated (default: all that are installed)',
    )
    parser.add_argument(
        '--only', nargs='+', choices=BLOCKS, metavar='BLOCK', help=f'of {", ".join(BLOCKS)}'
    )
    parser.add_argument(
        '--workers',
        type=int,
        default=2,
        metavar='N',
        help='processes for what is not timed (default: 2)',
    )
    parser.add_argument('--page', type=Path, default=PAGE, help=f'default: {PAGE}')
    return parser.parse_args()


def scenes(arguments: argparse.Namespace, kind: str) -> list[Path]:
    """Labelled bags whose names match two patterns, rendered if need be."""
    if arguments.bags:
        bags = sorted(path for path in arguments.bags.iterdir() if path.is_dir())
    else:
        bags = rendered(arguments.suite, (kind, arguments.scenes))
    return [
        bag
        for bag in bags
        if fnmatch.fnmatch(bag.name, kind) and fnmatch.fnmatch(bag.name, arguments.scenes)
    ]


def drawn(arguments: argparse.Namespace) -> list[Path]:
    """Labelled bags of the scenes drawn by chance, unless other bags are given."""
    return [] if arguments.bags else rendered('drawn', (arguments.scenes,))


def rendered(suite: str, patterns: tuple[str, ...]) -> list[Path]:
    """Labelled bags of a suite's scenes that match all patterns, out of the user's cache."""
    from rover_obstacle_detection.simulation.cache import cache_folder, simulated_bag
    from rover_obstacle_detection.simulation.suite import load_suite

    bags = []
    for scene in load_suite(suite):
        if all(fnmatch.fnmatch(scene.name, pattern) for pattern in patterns):
            print(f'scene {scene.name}', file=sys.stderr)
            bags.append(simulated_bag(scene, cache_folder()))
    return bags


def chosen_methods(asked: list[str] | None) -> list[str]:
    """Names of the methods that are asked for and can be made here."""
    installed = []
    for name in METHOD_DESCRIPTIONS:
        if asked is not None and name not in asked:
            continue
        try:
            make_method(name)
            installed.append(name)
        except MissingExtraError as error:
            print(f'left out: {error}', file=sys.stderr)
    return installed


def check_blocks(text: str, names: Sequence[str]) -> None:
    """Refuse a page without the marks of a block before the work, not after it."""
    for name in names:
        if f'<!-- begin {name} -->\n' not in text or f'<!-- end {name} -->' not in text:
            sys.exit(f'the page has no block {name}')


def with_block(text: str, name: str, content: str) -> str:
    """Put content between the marks of a block."""
    begin, end = f'<!-- begin {name} -->\n', f'<!-- end {name} -->'
    before, _, rest = text.partition(begin)
    return f'{before}{begin}\n{content}\n{end}{rest.partition(end)[2]}'


if __name__ == '__main__':
    main()
