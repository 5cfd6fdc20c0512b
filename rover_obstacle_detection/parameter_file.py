"""Read and write the detector's configuration as a ROS parameter file."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator, Mapping
from io import StringIO
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap

from rover_obstacle_detection.detection.config import DetectorConfig, ParameterDescription
from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.yaml_file import read_yaml

NODE_NAME = 'obstacle_detector'
NODE_PARAMETER_NAMES = frozenset(
    {
        'approximate_sync',
        'approximate_sync_tolerance_seconds',
        'autostart',
        'base_frame',
        'frozen_after',
        'image_transport',
        'imu_pitch',
        'imu_roll',
        'imu_yaw',
        'max_image_age',
        'queue_size',
        'rectify',
        'rover_mask',
        'rover_polygon',
        'stale_after',
        'start_type_description_service',
        'use_sim_time',
        'watchdog',
    }
)
"""Parameters of the live node only; ignored offline."""

_NODE_PREFIXES = ('qos_overrides.',)
_PARAMETERS = 'ros__parameters'
_WILDCARDS = ('**', '*')


def load_config(path: str | Path) -> DetectorConfig:
    """Read the detector's parameters from a ROS parameter file.

    Parameters
    ----------
    path : str or Path
        YAML with ``ros__parameters`` under ``/**`` or ``obstacle_detector``, with or without
        namespaces. If both set a parameter, ``obstacle_detector`` wins.

    Returns
    -------
    DetectorConfig
        Parameters that the file does not set have their defaults.

    Raises
    ------
    ConfigurationError
        If the file cannot be read, or a parameter is unknown or has an invalid value.
    """
    path = Path(path)
    values = _values(read_yaml(path, 'parameter file', ConfigurationError), path)
    descriptions = {each.name: each for each in DetectorConfig.parameters()}
    unknown = [name for name in values if name not in descriptions and not _is_of_node(name)]
    if unknown:
        known = [*descriptions, *NODE_PARAMETER_NAMES]
        raise ConfigurationError(f'{path}: {describe_unknown(unknown[0], known)}')
    try:
        return DetectorConfig(
            **{
                name: _of_type(value, descriptions[name])
                for name, value in values.items()
                if name in descriptions
            }
        )
    except ConfigurationError as error:
        raise ConfigurationError(f'{path}: {error}') from None


def check_node_file(path: str | Path, node_name: str) -> None:
    """Check that a parameter file sets something of a node; ROS ignores other files silently.

    Parameters
    ----------
    path : str or Path
    node_name : str
        With its namespace, such as ``/stereo/obstacle_detector``.

    Raises
    ------
    ConfigurationError
        If the file cannot be read, or has no parameters under ``/**`` or the name of the node.
    """
    path = Path(path)
    content = read_yaml(path, 'parameter file', ConfigurationError)
    keys = ['/' + '/'.join(names) for names, _ in _parameter_blocks(content, path)]
    if not any(_key_matches(key, node_name) for key in keys):
        raise ConfigurationError(
            f'{path}: only has parameters of {", ".join(keys)}: expected /** or {node_name}'
        )


def describe_unknown(name: str, known: Iterable[str]) -> str:
    """Return that a name is no parameter, and the known one that is most like it."""
    near = difflib.get_close_matches(name, list(known), n=1)
    hint = f'did you mean {near[0]}?' if near else 'expected a parameter of the detector'
    return f'{name} is not a parameter: {hint}'


def dump_config(config: DetectorConfig) -> str:
    """Return a configuration as a ROS parameter file, with each parameter's description.

    Returns
    -------
    str
        YAML for `load_config` and ``ros2 run ... --params-file``.
    """
    parameters = CommentedMap()
    for each in config.parameters():
        parameters[each.name] = getattr(config, each.name)
        parameters.yaml_set_comment_before_after_key(each.name, before=each.description, indent=4)
    text = StringIO()
    YAML().dump({'/**': {_PARAMETERS: parameters}}, text)
    return text.getvalue()


def _key_matches(key: str, node_name: str) -> bool:
    """Whether ROS gives the parameters under a key to a node."""
    # ** stands for any number of names, * for one.
    tokens = {'**': '(/[^/]+)*', '*': '/[^/]+'}
    parts = key.strip('/').split('/')
    pattern = ''.join(tokens.get(part, '/' + re.escape(part)) for part in parts)
    return re.fullmatch(pattern, node_name) is not None


def _parameter_blocks(content: object, path: Path) -> list[tuple[tuple[str, ...], object]]:
    blocks = list(_blocks(content, ()))
    if not blocks:
        raise ConfigurationError(
            f'{path}: is not a ROS parameter file: expected {_PARAMETERS} under /** or a node name'
        )
    return blocks


def _values(content: object, path: Path) -> dict[str, Any]:
    blocks = _parameter_blocks(content, path)
    mine = [block for block in blocks if block[0][-1] in (*_WILDCARDS, NODE_NAME)]
    if not mine:
        found = ', '.join('/'.join(names) for names, _ in blocks)
        raise ConfigurationError(
            f'{path}: only has parameters of {found}: expected {NODE_NAME} or /**'
        )
    values: dict[str, Any] = {}
    # Later blocks override earlier ones, as in ROS; those of the node override wildcards.
    for names, block in sorted(mine, key=lambda block: block[0][-1] == NODE_NAME):
        if not isinstance(block, Mapping):
            raise ConfigurationError(
                f'{path}: {_PARAMETERS} of {"/".join(names)} is {block!r}: expected name: value'
            )
        values.update(_flat(block, ''))
    return values


def _blocks(content: object, names: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], object]]:
    """Yield each ``ros__parameters`` block and the names that it is nested under."""
    if not isinstance(content, Mapping):
        return
    for key, value in content.items():
        if key == _PARAMETERS and names:
            yield names, value
        else:
            yield from _blocks(value, (*names, *(part for part in str(key).split('/') if part)))


def _flat(block: Mapping[Any, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    """Join nested names with dots."""
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
