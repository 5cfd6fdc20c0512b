"""``rover-obstacles simulate``: render scenes with ground truth as labelled bags."""

from __future__ import annotations

import argparse
import contextlib
import fnmatch
import functools
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rover_obstacle_detection.cli.arguments import positive_int
from rover_obstacle_detection.cli.console import progress_bars

if TYPE_CHECKING:
    from rover_obstacle_detection.simulation.description import Scene

DESCRIPTION = """\
Render planetary stereo scenes with ground truth, as labelled bags (rosbag2, mcap).

Render one scene from named conditions; later conditions override earlier ones:
  rover-obstacles simulate crater low_sun_across --rig vga --output scenes
Or render every scene of a suite into the user's cache:
  rover-obstacles simulate --suite standard

A labelled bag holds the four camera topics under /stereo. /truth/labels, /truth/instances,
/truth/depth, /truth/pose and /tf have the same stamps. /truth/scene holds all scene parameters.
"""
EPILOG = """\
examples:
  rover-obstacles simulate noon --rig study --seed 7 --width 512 --output scenes
  rover-obstacles simulate dunes --rig navcam --frames 20 --set drive.step_m=0.25 --output drive
  rover-obstacles simulate --suite standard --only 'tune_*' --output tuning
  rover-obstacles simulate --list
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        'simulate',
        help='render labelled bags (extra sim)',
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('conditions', nargs='*', metavar='CONDITION', help='see --list')
    one = parser.add_argument_group('one scene')
    one.add_argument('--rig', metavar='RIG', help='stereo camera (default: study)')
    one.add_argument('--seed', metavar='N', type=int, help='random seed of the scene (default: 1)')
    one.add_argument(
        '--width', metavar='PX', type=positive_int, help='image width (default: that of the rig)'
    )
    one.add_argument(
        '--frames', metavar='N', type=positive_int, help='number of stereo pairs (default: 1)'
    )
    one.add_argument(
        '--set',
        metavar='NAME=VALUE',
        type=_setting,
        action='append',
        default=[],
        dest='settings',
        help='scene parameter, such as light.sun_elevation_deg=20; may be repeated',
    )
    one.add_argument('--name', help='name of the bag (default: rig, conditions and seed)')
    suite = parser.add_argument_group('a suite')
    suite.add_argument(
        '--suite',
        metavar='NAME',
        help='standard, hazards, drawn, unseen, training, training_wide, samples, or a YAML file',
    )
    suite.add_argument(
        '--only',
        metavar='PATTERN',
        help="render only scenes with matching names, such as 'report_*'",
    )
    parser.add_argument(
        '--list', action='store_true', help='list rigs, conditions and parameters, then exit'
    )
    parser.add_argument(
        '-o',
        '--output',
        metavar='DIR',
        type=Path,
        help="write each bag to DIR/<scene> (default: the user's cache)",
    )
    parser.add_argument('--force', action='store_true', help='replace existing bags')
    parser.set_defaults(run=run)


def _setting(text: str) -> tuple[str, Any]:
    """Parse ``name=value``, the value as YAML."""
    name, equals, value = text.partition('=')
    if not equals or not name:
        msg = f'{text!r}: expected name=value, such as light.sun_elevation_deg=20'
        raise argparse.ArgumentTypeError(msg)
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        return name, YAML(typ='safe').load(value)
    except YAMLError as error:
        msg = f'{text!r}: {value!r} is not valid YAML'
        raise argparse.ArgumentTypeError(msg) from error


def run(arguments: argparse.Namespace) -> int:
    """Render the scenes and print the paths of their bags.

    Raises
    ------
    ObstacleDetectionError
        If a condition, rig, suite or parameter is unknown, the renderer is not installed, or a
        bag cannot be written.
    """
    _check(arguments)
    if arguments.list:
        _print_list()
        return 0
    from rover_obstacle_detection.simulation.cache import cache_folder, render_bag, simulated_bag

    scenes = _scenes(arguments)
    targets = _targets(arguments, scenes)
    with progress_bars([scene.name for scene in scenes], 'steps') as update:
        for index, scene in enumerate(scenes):
            progress = functools.partial(update, index)
            target = targets.get(scene.name)
            if target is None:
                path = simulated_bag(scene, cache_folder(), progress)
            else:
                with _put_in_place(target) as path:
                    if arguments.suite:
                        shutil.copytree(simulated_bag(scene, cache_folder(), progress), path)
                    else:
                        render_bag(scene, path, progress)
            print(target or path, flush=True)
    return 0


@contextlib.contextmanager
def _put_in_place(target: Path) -> Iterator[Path]:
    """Yield a temporary path, and move it to the target when the block completes."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f'.{target.name}-', dir=target.parent) as folder:
        path = Path(folder) / target.name
        yield path
        if target.exists():
            shutil.rmtree(target)
        path.rename(target)


def _check(arguments: argparse.Namespace) -> None:
    one_scene = ('conditions', 'rig', 'seed', 'width', 'frames', 'settings', 'name')
    given = [name for name in one_scene if getattr(arguments, name) not in (None, [])]
    if arguments.suite and given:
        option = {'conditions': 'conditions', 'settings': '--set'}.get(given[0], f'--{given[0]}')
        msg = f'--suite cannot be combined with {option}'
        raise argparse.ArgumentTypeError(msg)
    if arguments.only and not arguments.suite:
        msg = '--only needs --suite'
        raise argparse.ArgumentTypeError(msg)
    if not (arguments.suite or arguments.conditions or arguments.list):
        msg = 'nothing to render: give conditions (see --list) or --suite standard'
        raise argparse.ArgumentTypeError(msg)


def _scenes(arguments: argparse.Namespace) -> list[Scene]:
    from rover_obstacle_detection.errors import ConfigurationError
    from rover_obstacle_detection.simulation.presets import overlay, scene_of
    from rover_obstacle_detection.simulation.suite import load_suite

    if arguments.suite:
        scenes = load_suite(arguments.suite)
        pattern = arguments.only or '*'
        chosen = [scene for scene in scenes if fnmatch.fnmatchcase(scene.name, pattern)]
        if not chosen:
            names = ', '.join(scene.name for scene in scenes)
            msg = f'no scene of suite {arguments.suite} matches {pattern!r}: it has {names}'
            raise ConfigurationError(msg)
        return chosen
    rig = arguments.rig or 'study'
    seed = 1 if arguments.seed is None else arguments.seed
    name = arguments.name or '_'.join([rig, *arguments.conditions, str(seed)])
    parameters: dict[str, Any] = {}
    for dotted, value in arguments.settings:
        for name_part in reversed(dotted.split('.')):
            value = {name_part: value}
        parameters = overlay(parameters, value)
    if arguments.width:
        parameters['width'] = arguments.width
    if arguments.frames:
        parameters = overlay(parameters, {'drive': {'frames': arguments.frames}})
    return [scene_of(name, seed, arguments.conditions, rig, parameters)]


def _targets(arguments: argparse.Namespace, scenes: list[Scene]) -> dict[str, Path]:
    """Return the output path of each scene, empty for the cache; check them before rendering."""
    from rover_obstacle_detection.errors import OutputError

    if arguments.output is None:
        return {}
    targets = {scene.name: arguments.output / scene.name for scene in scenes}
    for target in targets.values():
        if target.exists() and not arguments.force:
            msg = f'{target} already exists: give --force to replace it'
            raise OutputError(msg)
        if target.exists() and not (target / 'metadata.yaml').is_file():
            msg = f'{target} is not a bag and is not replaced'
            raise OutputError(msg)
    return targets


def _print_list() -> None:
    from rover_obstacle_detection.simulation.description import Scene, parameters_of
    from rover_obstacle_detection.simulation.presets import PRESETS
    from rover_obstacle_detection.simulation.rigs import RIGS

    print('rigs:')
    for rig in RIGS.values():
        print(
            f'  {rig.name:18} {rig.description}: {rig.width} x {rig.height}, '
            f'{rig.horizontal_view_deg:.0f} degrees field of view, baseline {rig.baseline_m:g} m, '
            f'height {rig.camera_height_m:g} m, pitch {rig.pitch_deg:g} degrees down'
        )
    print('conditions:')
    for name, preset in PRESETS.items():
        print(f'  {name:18} {preset.description}')
    print('parameters:')
    for parameter in parameters_of(Scene):
        default = ', '.join(parameter.choices) if parameter.choices else parameter.default
        print(f'  {parameter.name:26} {parameter.description} ({default})')
