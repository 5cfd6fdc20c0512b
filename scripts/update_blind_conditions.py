"""Update the tables of docs/blind_conditions.md.

    python scripts/update_blind_conditions.py                       # all pairs of bags/
    python scripts/update_blind_conditions.py --frames 1            # the first pair of each
    python scripts/update_blind_conditions.py --bags BAG... --print # other recordings
    python scripts/update_blind_conditions.py --frames 1 --conditions '*focus*' 'both*' --print

The recordings need no labels. With --print or --json, the page is left alone. One pair of each bag
takes about 4 minutes; progress is on stderr.
"""

from __future__ import annotations

import argparse
import fnmatch
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from generated_blocks import check_block, with_block
from studies.blind_views import detector, views

from rover_obstacle_detection.detection.config import METHODS, DetectorConfig
from rover_obstacle_detection.errors import ObstacleDetectionError
from rover_obstacle_detection.evaluation.blind.conditions import CONDITIONS, Condition
from rover_obstacle_detection.evaluation.blind.figures import Judge, Strength, judged
from rover_obstacle_detection.evaluation.blind.tables import as_json, as_markdown
from rover_obstacle_detection.evaluation.blind.view import View

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / 'docs' / 'blind_conditions.md'
BLOCK = 'blind-conditions'


def main() -> None:
    """Judge every view under every condition, and update the page."""
    arguments = parsed_arguments()
    bags = arguments.bags or sorted(path for path in (ROOT / 'bags').iterdir() if path.is_dir())
    conditions = chosen(arguments.conditions)
    if not conditions:
        sys.exit(f'no condition matches {" ".join(arguments.conditions)}')
    to_page = not (arguments.print or arguments.json)
    if to_page:
        check_block(arguments.page, BLOCK)
    judge = detector(DetectorConfig(method=arguments.method))
    try:
        given = views(bags, judge, arguments.frames)
    except ObstacleDetectionError as error:
        sys.exit(str(error))
    results = under_all(conditions, given, judge)
    names = ', '.join(f'`{bag.name}`' for bag in bags)
    count = f'{len(given)} pair{"s" if len(given) > 1 else ""}'
    content = f'{count} of {names}.\n\n{as_markdown(results)}'
    if arguments.print:
        print(content)
    if arguments.json:
        arguments.json.write_text(json.dumps(as_json(results), indent=1), encoding='utf-8')
    if to_page:
        text = with_block(arguments.page.read_text(encoding='utf-8'), BLOCK, content)
        arguments.page.write_text(text, encoding='utf-8')


def parsed_arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        '--bags', nargs='+', type=Path, metavar='BAG', help='recordings (default: those of bags/)'
    )
    parser.add_argument(
        '--frames', type=int, metavar='N', help='first N pairs of each recording (default: all)'
    )
    parser.add_argument(
        '--conditions',
        nargs='+',
        default=['*'],
        metavar='PATTERN',
        help="only conditions or groups that match, as in 'both*'",
    )
    parser.add_argument('--method', choices=METHODS, default='hybrid')
    parser.add_argument('--print', action='store_true', help='print the tables')
    parser.add_argument('--json', type=Path, metavar='FILE', help='write all figures')
    parser.add_argument('--page', type=Path, default=PAGE, help='page with the block to update')
    return parser.parse_args()


def chosen(patterns: Sequence[str]) -> list[Condition]:
    """Conditions whose name or group matches one of the patterns, in any case."""
    return [
        condition
        for condition in CONDITIONS
        if any(
            fnmatch.fnmatch(name.lower(), pattern.lower())
            for name in (condition.name, condition.group)
            for pattern in patterns
        )
    ]


def under_all(
    conditions: Sequence[Condition], given: Sequence[View], judge: Judge
) -> list[Strength]:
    """Judge the views under each condition; those that do not allow one are left out."""
    results = []
    for condition in conditions:
        started = time.monotonic()
        for name, change in condition.strengths.items():
            changed = [damaged for view in given if (damaged := change(view)) is not None]
            figures = tuple(judged(view, judge) for view in changed)
            results.append(Strength(condition.group, condition.name, name, figures))
        seconds = time.monotonic() - started
        print(f'{condition.name}: {seconds:.0f} s', file=sys.stderr, flush=True)
    return results


if __name__ == '__main__':
    main()
