"""The detector's configuration in the form of a ROS parameter file."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from io import StringIO
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from rover_obstacle_detection.detection.config import DetectorConfig, ParameterDescription
from rover_obstacle_detection.errors import ConfigurationError

NODE_NAME = 'obstacle_detector'
NODE_PARAMETER_NAMES = frozenset(
    {
        'approximate_sync',
        'approximate_sync_tolerance_seconds',
        'autostart',
        'base_frame',
        'image_transport',
        'imu_pitch',
        'imu_roll',
        'imu_yaw',
        'queue_size',
        'rover_mask',
        'rover_polygon',
        'start_type_description_service',
        'use_sim_time',
    }
)
"""Parameters that only the live node has; a replay takes no notice of them."""

_NODE_PREFIXES = ('qos_overrides.',)
_PARAMETERS = 'ros__parameters'
_WILDCARDS = ('**', '*')


def load_config(path: str | Path, node_name: str = NODE_NAME) -> DetectorConfig:
    """Read the detector's parameters from a ROS parameter file.

    Parameters
    ----------
    path : str or Path
        YAML with ``ros__parameters`` under ``/**`` or the node's name, with or without
        namespaces. Where both set a parameter, the node's name wins.
    node_name : str

    Returns
    -------
    DetectorConfig
        With defaults for what the file does not set.

    Raises
    ------
    ConfigurationError
        Naming the file and the parameter that is unknown or has an impossible value.
    """
    path = Path(path)
    values = _values(_load(path), path, node_name)
    descriptions = {each.name: each for each in DetectorConfig.parameters()}
    unknown = [name for name in values if name not in descriptions and not _is_of_node(name)]
    if unknown:
        near = difflib.get_close_matches(unknown[0], [*descriptions, *NODE_PARAMETER_NAMES], n=1)
        hint = f'did you mean {near[0]}?' if near else 'expected a parameter of the detector'
        msg = f'{path}: {unknown[0]} is not a parameter: {hint}'
        raise ConfigurationError(msg)
    try:
        return DetectorConfig(
            **{
                name: _of_type(value, descriptions[name])
                for name, value in values.items()
                if name in descriptions
            }
        )
    except ConfigurationError as error:
        msg = f'{path}: {error}'
        raise ConfigurationError(msg) from None


def dump_config(config: DetectorConfig, node_name: str = '/**') -> str:
    """Write a configuration as a ROS parameter file, each parameter with its meaning.

    Returns
    -------
    str
        YAML that `load_config` and ``ros2 run ... --params-file`` read.
    """
    parameters = CommentedMap()
    for each in config.parameters():
        parameters[each.name] = getattr(config, each.name)
        parameters.yaml_set_comment_before_after_key(each.name, before=each.description, indent=4)
    text = StringIO()
    YAML().dump({node_name: {_PARAMETERS: parameters}}, text)
    return text.getvalue()


def _load(path: Path) -> object:
    try:
        return YAML(typ='safe').load(path.read_text(encoding='utf-8'))
    except FileNotFoundError:
        msg = f'{path}: no such parameter file'
    except OSError as error:
        msg = f'{path}: cannot be read: {error.strerror}'
    except MarkedYAMLError as error:
        line = f' in line {error.problem_mark.line + 1}' if error.problem_mark else ''
        msg = f'{path}: is not YAML: {error.problem}{line}'
    except (YAMLError, UnicodeDecodeError):
        msg = f'{path}: is not YAML'
    raise ConfigurationError(msg)


def _values(content: object, path: Path, node_name: str) -> dict[str, Any]:
    blocks = list(_blocks(content, ()))
    if not blocks:
        msg = f'{path}: is not a ROS parameter file: expected {_PARAMETERS} under /** or a node'
        raise ConfigurationError(msg)
    mine = [block for block in blocks if block[0][-1] in (*_WILDCARDS, node_name)]
    if not mine:
        found = ', '.join('/'.join(names) for names, _ in blocks)
        msg = f'{path}: has parameters of {found} only: expected {node_name} or /**'
        raise ConfigurationError(msg)
    values: dict[str, Any] = {}
    # Sorting is stable: among equals the later block wins, as in ROS.
    for names, block in sorted(mine, key=lambda block: block[0][-1] == node_name):
        if not isinstance(block, Mapping):
            msg = f'{path}: {_PARAMETERS} of {"/".join(names)} is {block!r}: expected parameters'
            raise ConfigurationError(msg)
        values.update(_flat(block, ''))
    return values


def _blocks(content: object, names: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], object]]:
    if not isinstance(content, Mapping):
        return
    for key, value in content.items():
        if key == _PARAMETERS and names:
            yield names, value
        else:
            yield from _blocks(value, (*names, *(part for part in str(key).split('/') if part)))


def _flat(block: Mapping[Any, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    for key, value in block.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f'{prefix}{key}.')
        else:
            yield f'{prefix}{key}', value


def _is_of_node(name: str) -> bool:
    return name in NODE_PARAMETER_NAMES or name.startswith(_NODE_PREFIXES)


def _of_type(value: Any, description: ParameterDescription) -> Any:
    is_whole = isinstance(value, int) and not isinstance(value, bool)
    return float(value) if isinstance(description.default, float) and is_whole else value
