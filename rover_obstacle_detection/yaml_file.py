"""Read YAML files of any origin: what they may cost is bounded, and every error is one line."""

from __future__ import annotations

from pathlib import Path

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import CollectionEndEvent, CollectionStartEvent, NodeEvent

from rover_obstacle_detection.errors import ObstacleDetectionError

MAX_BYTES = 250_000
MAX_DEPTH = 32
MAX_NODES = 10_000

_MAX_PROBLEM = 200


def read_yaml(path: Path, kind: str, error_type: type[ObstacleDetectionError]) -> object:
    """Read a YAML file of at most `MAX_BYTES` and `MAX_NODES`, nested at most `MAX_DEPTH` deep.

    Aliases, anchors and integers beyond 64 bits are refused, as in ROS parameter files.

    Parameters
    ----------
    path : Path
    kind : str
        What the file should be, for the message if it does not exist.
    error_type : type
        The error to raise; its message starts with the path.
    """
    data = read_small_file(path, kind, error_type)
    try:
        return parse_yaml(data.decode())
    except UnicodeDecodeError:
        problem = 'expected UTF-8 text'
    except ValueError as error:
        problem = str(error)
    raise error_type(f'{path}: is not valid YAML: {problem}')


def read_small_file(
    path: Path, kind: str, error_type: type[ObstacleDetectionError], max_bytes: int = MAX_BYTES
) -> bytes:
    """Read a file of at most `max_bytes`; see `read_yaml`."""
    try:
        with path.open('rb') as file:
            data = file.read(max_bytes + 1)
    except FileNotFoundError:
        raise error_type(f'{path}: no such {kind}') from None
    except OSError as error:
        raise error_type(f'{path}: cannot be read: {error.strerror}') from None
    if len(data) > max_bytes:
        raise error_type(f'{path}: has more than {max_bytes} bytes: expected {_a(kind)}')
    return data


def parse_yaml(text: str) -> object:
    """Parse YAML as `read_yaml` does.

    Raises
    ------
    ValueError
        On one line, with the number of the line that is wrong where it is known.
    """
    try:
        _check_structure(text)
        content = YAML(typ='safe').load(text)
        _check_integers(content)
    except MarkedYAMLError as error:
        problem = _line(error.problem)
        if error.problem_mark:
            problem += f' on line {error.problem_mark.line + 1}'
    except YAMLError as error:
        problem = _line(error)
    except Exception as error:
        # The constructors of dates, numbers and keys raise whatever Python does.
        problem = _line(error) or type(error).__name__
    else:
        return content
    raise ValueError(problem)


def _a(kind: str) -> str:
    return f'{"an" if kind[0] in "aeiou" else "a"} {kind}'


def _check_structure(text: str) -> None:
    """Refuse what would cost more than the file's size, before anything is built of it."""
    depth = nodes = 0
    for event in YAML(typ='safe').parse(text):
        depth += isinstance(event, CollectionStartEvent)
        depth -= isinstance(event, CollectionEndEvent)
        nodes += isinstance(event, NodeEvent)
        for is_wrong, problem in (
            (getattr(event, 'anchor', None), 'anchors and aliases are not supported'),
            (depth > MAX_DEPTH, f'nested more than {MAX_DEPTH} deep'),
            (nodes > MAX_NODES, f'more than {MAX_NODES} values'),
        ):
            if is_wrong:
                raise MarkedYAMLError(problem=problem, problem_mark=event.start_mark)


def _check_integers(value: object) -> None:
    if isinstance(value, int) and not -(2**63) <= value < 2**63:
        raise ValueError('an integer has more than 64 bits')
    if isinstance(value, dict):
        _check_integers([*value, *value.values()])
    elif isinstance(value, (list, tuple, set)):
        for each in value:
            _check_integers(each)


def _line(problem: object) -> str:
    text = ' '.join(str(problem).split())
    return text if len(text) <= _MAX_PROBLEM else f'{text[:_MAX_PROBLEM]} ...'
