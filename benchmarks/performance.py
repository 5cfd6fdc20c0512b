"""Measure every performance target of the project.

    python benchmarks/performance.py                  # print all
    python benchmarks/performance.py --docs docs      # and update docs/performance.md
    python benchmarks/performance.py --quick          # each with the fewest repeats
    python benchmarks/performance.py --only detection clouds

The yardstick, SGBM, is one plain StereoSGBM call on the pair at full size: 3WAY, 64 disparities,
block 5, P1 300, P2 1200, uniqueness 8, speckle size 50 and range 2. It is measured in turns with
the detector, in this process. Scenes: those of bags/, and the reporting scenes of the standard
suite that are in the cache; nothing is rendered. Takes about ten minutes; run it on an otherwise
idle machine. The live part needs ROS 2.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT / 'test' / 'support'), str(ROOT / 'scripts')]

from benchmark_scenes import Scene, default_bags, read_scenes  # noqa: E402
from clouds import cloud_findings  # noqa: E402
from detection_times import detection_findings  # noqa: E402
from effort import FULL, QUICK, Effort  # noqa: E402
from findings import Findings, Line, target_table  # noqa: E402
from generated_blocks import check_block, with_block  # noqa: E402
from growth import growth_findings  # noqa: E402
from live_node import live_findings  # noqa: E402
from machine import described_machine, use_cores  # noqa: E402
from replay_times import replay_findings  # noqa: E402

from rover_obstacle_detection.errors import ObstacleDetectionError  # noqa: E402

PAGE = 'performance.md'
NOT_MEASURED = 'not measured: it failed'
PARTS: dict[str, Callable[[Sequence[Scene], Effort], Findings]] = {
    'detection': detection_findings,
    'live': live_findings,
    'clouds': cloud_findings,
    'growth': growth_findings,
    'replay': replay_findings,
}
BLOCKS = ('machine', 'targets', 'stages', 'curve', 'sizes')


def main() -> None:
    """Measure, print, and update the page."""
    arguments = parsed_arguments()
    page = None if arguments.docs is None else arguments.docs / PAGE
    if page is not None:
        for name in BLOCKS:
            check_block(page, name)
    use_cores(arguments.cores)
    machine = described_machine()
    scenes = read_scenes(arguments.bags or default_bags(), arguments.effort.frames_per_bag)
    print(f'{machine}\n{described(scenes)}\n', flush=True)
    findings = measured(arguments.only or list(PARTS), scenes, arguments.effort)
    if page is not None:
        contents = {
            'machine': f'{machine}. {described(scenes)}\n',
            'targets': target_table(findings.lines).as_markdown(),
            **{name: table.as_markdown() for name, table in findings.tables.items()},
        }
        text = page.read_text(encoding='utf-8')
        for name, content in contents.items():
            text = with_block(text, name, content)
        page.write_text(text, encoding='utf-8')
    failed = [str(line) for line in findings.lines if line.measured == NOT_MEASURED]
    if failed:
        sys.exit('\n'.join(failed))


def measured(parts: Sequence[str], scenes: Sequence[Scene], effort: Effort) -> Findings:
    """Measure parts one after another, and print what each found."""
    lines: tuple[Line, ...] = ()
    tables = {}
    for part in parts:
        print(f'measuring: {part}', file=sys.stderr, flush=True)
        found = attempt(part, scenes, effort)
        for line in found.lines:
            print(line, flush=True)
        for table in found.tables.values():
            print(f'\n{table.title}\n\n{table.as_markdown()}', flush=True)
        lines += found.lines
        tables |= found.tables
    return Findings(lines, tables)


def attempt(part: str, scenes: Sequence[Scene], effort: Effort) -> Findings:
    """Measure a part; if it fails, the others are still worth measuring."""
    try:
        return PARTS[part](scenes, effort)
    except (ObstacleDetectionError, AssertionError):
        traceback.print_exc()
        return Findings((Line(f'all of {part}', NOT_MEASURED),))


def described(scenes: Sequence[Scene]) -> str:
    """Count the scenes by image size."""
    sizes = Counter(scene.size for scene in scenes)
    counts = ', '.join(
        f'{number} of {width} x {height}' for (width, height), number in sizes.items()
    )
    return f'{len(scenes)} scenes: {counts}.'


def parsed_arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        '--bags', nargs='+', type=Path, metavar='BAG', help='these instead of the usual scenes'
    )
    parser.add_argument(
        '--docs', type=Path, metavar='DIR', help=f'update {PAGE} in this folder with all parts'
    )
    parser.add_argument(
        '--only', nargs='+', choices=PARTS, metavar='PART', help=f'of {", ".join(PARTS)}'
    )
    parser.add_argument('--quick', action='store_true', help='the fewest repeats and scenes')
    parser.add_argument(
        '--frames', type=int, help=f'pairs of the long live run (default: {FULL.live_pairs})'
    )
    parser.add_argument('--cores', type=int, default=2, help='cores to use (default: 2)')
    arguments = parser.parse_args()
    if arguments.docs and arguments.only:
        parser.error('--docs needs all parts: leave out --only')
    arguments.effort = QUICK if arguments.quick else FULL
    if arguments.frames:
        arguments.effort = dataclasses.replace(arguments.effort, live_pairs=arguments.frames)
    return arguments


if __name__ == '__main__':
    main()
