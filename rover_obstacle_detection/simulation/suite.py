"""Suites of scenes, stored as YAML files."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.simulation.description import Scene
from rover_obstacle_detection.simulation.presets import scene_of

_KEYS = {'name', 'seed', 'rig', 'conditions', 'parameters'}


def suite_names() -> list[str]:
    """Return the names of the suites in the package."""
    folder = resources.files(__package__) / 'suites'
    return sorted(
        entry.name.removesuffix('.yaml')
        for entry in folder.iterdir()
        if entry.name.endswith('.yaml')
    )


def load_suite(name_or_path: str) -> list[Scene]:
    """Read a suite by name, or from a YAML file of the same format.

    Raises
    ------
    ConfigurationError
        If the suite does not exist or is invalid. The message names the suite and the scene.
    """
    if name_or_path in suite_names():
        text = (resources.files(__package__) / 'suites' / f'{name_or_path}.yaml').read_text(
            encoding='utf-8'
        )
    else:
        try:
            text = Path(name_or_path).read_text(encoding='utf-8')
        except OSError as error:
            msg = (
                f'no suite {name_or_path!r}: expected one of {", ".join(suite_names())}, '
                f'or a file ({error.strerror})'
            )
            raise ConfigurationError(msg) from error
    try:
        content = YAML(typ='safe').load(text)
    except YAMLError as error:
        msg = f'suite {name_or_path}: {" ".join(str(error).split())}'
        raise ConfigurationError(msg) from error
    return _scenes(content, name_or_path)


def _scenes(content: Any, where: str) -> list[Scene]:
    entries = content.get('scenes') if isinstance(content, dict) else None
    if not isinstance(entries, list) or not entries:
        msg = f'suite {where}: expected a list named scenes'
        raise ConfigurationError(msg)
    scenes: list[Scene] = []
    for number, entry in enumerate(entries, 1):
        if not isinstance(entry, dict) or 'name' not in entry or set(entry) - _KEYS:
            msg = (
                f'suite {where}, scene {number}: {entry!r}: expected a name and optionally '
                f'{", ".join(sorted(_KEYS - {"name"}))}'
            )
            raise ConfigurationError(msg)
        try:
            scene = scene_of(
                str(entry['name']),
                entry.get('seed', 1),
                entry.get('conditions', ()),
                entry.get('rig', 'study'),
                entry.get('parameters'),
            )
        except ConfigurationError as error:
            msg = f'suite {where}, scene {entry["name"]}: {error}'
            raise ConfigurationError(msg) from error
        if scene.name in {other.name for other in scenes}:
            msg = f'suite {where}: two scenes are named {scene.name}'
            raise ConfigurationError(msg)
        scenes.append(scene)
    return scenes
