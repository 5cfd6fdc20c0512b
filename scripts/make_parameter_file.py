"""Regenerate config/obstacle_detector.yaml after a parameter has changed.

python scripts/make_parameter_file.py > config/obstacle_detector.yaml
"""

from __future__ import annotations

import textwrap

from rover_obstacle_detection.detection.config import DetectorConfig, ParameterDescription
from rover_obstacle_detection.node.settings import NODE_PARAMETERS

HEADER = """\
# Every parameter of the node obstacle_detector, with its default, its range and its meaning.
#
#   rover-obstacles run --params obstacle_detector.yaml
#   ros2 run rover_obstacle_detection obstacle_detector --ros-args --params-file FILE
#   rover-obstacles replay BAG --output DIR --params obstacle_detector.yaml
#
# All but autostart can be changed while the node runs:
#
#   ros2 param set /stereo/obstacle_detector max_step 0.15
/**:
  ros__parameters:
"""
WIDTH = 110  # columns of the comments


def main() -> None:
    """Print the parameter file."""
    print(parameter_file(), end='')


def parameter_file() -> str:
    """Return the text of the parameter file."""
    parts = [HEADER]
    for title, parameters in (
        ('The detector', DetectorConfig.parameters()),
        ('The node', NODE_PARAMETERS),
    ):
        parts.append(f'    # {title}\n\n')
        parts.extend(_entry(parameter) for parameter in parameters)
    return ''.join(parts).rstrip('\n') + '\n'


def _entry(parameter: ParameterDescription) -> str:
    text = parameter.description
    if parameter.choices:
        text += f' One of {", ".join(parameter.choices)}.'
    if parameter.minimum is not None and parameter.maximum is not None:
        low = f'0, or {parameter.smallest:g}' if parameter.smallest else f'{parameter.minimum:g}'
        text += f' {low} to {parameter.maximum:g}'
        text += f', in steps of {parameter.step}.' if parameter.step else '.'
    comment = textwrap.fill(text, WIDTH, initial_indent='    # ', subsequent_indent='    # ')
    return f'{comment}\n    {parameter.name}: {_value(parameter.default)}\n\n'


def _value(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if value == '' else str(value)


if __name__ == '__main__':
    main()
