"""Declare the ROS parameters and validate changes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.parameter import Parameter

from rover_obstacle_detection.detection.config import ParameterDescription
from rover_obstacle_detection.errors import ConfigurationError, ObstacleDetectionError
from rover_obstacle_detection.node.settings import READ_ONLY, Settings, all_parameters
from rover_obstacle_detection.node.tf_gravity import import_tf2_ros
from rover_obstacle_detection.parameter_file import describe_unknown


def declare_parameters(node: Any) -> Settings:
    """Declare every parameter with its descriptor.

    Returns
    -------
    Settings
        With the values given on the command line and in parameter files.

    Raises
    ------
    ConfigurationError
        If a given value has the wrong type, is out of range or conflicts with another.
    """
    given = _overrides(node)
    given.update({each.name: each for each in integers_to_floats(given.values())})
    for description in all_parameters():
        try:
            node.declare_parameter(
                description.name, description.default, make_descriptor(description)
            )
        except (InvalidParameterTypeException, InvalidParameterValueException) as error:
            raise ConfigurationError(_refusal(node, description, error)) from error
    return current_settings(node)


def make_descriptor(description: ParameterDescription) -> ParameterDescriptor:
    """Return the ROS descriptor of a parameter."""
    text = description.description
    if description.choices:
        text += f' One of {", ".join(description.choices)}.'
    descriptor = ParameterDescriptor(description=text, read_only=description.name in READ_ONLY)
    if description.minimum is None or description.maximum is None:
        return descriptor
    if isinstance(description.default, float):
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=description.minimum, to_value=description.maximum)
        ]
    else:
        descriptor.integer_range = [
            IntegerRange(
                from_value=int(description.minimum),
                to_value=int(description.maximum),
                step=description.step or 0,
            )
        ]
        if description.step:
            descriptor.additional_constraints = (
                f'{description.minimum:g} plus a multiple of {description.step}'
            )
    return descriptor


def current_settings(node: Any, changes: Iterable[Parameter] = ()) -> Settings:
    """Read all parameters, apply changes and validate the result.

    Parameters
    ----------
    node : rclpy node
    changes : iterable of rclpy.parameter.Parameter, optional

    Raises
    ------
    ObstacleDetectionError
        If values conflict, or need a package that is not installed.
    """
    names = [each.name for each in all_parameters()]
    values = {name: node.get_parameter(name).value for name in names if node.has_parameter(name)}
    values |= {each.name: each.value for each in changes if each.name in names}
    settings = Settings.from_values(values)
    if settings.config.gravity_source == 'tf':
        import_tf2_ros()
    return settings


def integers_to_floats(changes: Iterable[Parameter]) -> list[Parameter]:
    """Convert integers given for float parameters, which ROS would refuse."""
    floats = {each.name for each in all_parameters() if isinstance(each.default, float)}
    return [
        Parameter(each.name, value=float(each.value))
        if each.name in floats and each.type_ == Parameter.Type.INTEGER
        else each
        for each in changes
    ]


def concerns_settings(changes: Iterable[Parameter]) -> bool:
    """Return whether any of `all_parameters` changes, not only ROS's own parameters."""
    names = {each.name for each in all_parameters()}
    return any(each.name in names for each in changes)


def judge_change(node: Any, changes: Sequence[Parameter]) -> SetParametersResult:
    """Accept a change of parameters, or refuse it with the reason."""
    if not concerns_settings(changes):
        return SetParametersResult(successful=True)
    try:
        current_settings(node, changes)
    except ObstacleDetectionError as error:
        return SetParametersResult(successful=False, reason=str(error))
    return SetParametersResult(successful=True)


def refuse_unknown_parameters(node: Any) -> None:
    """Refuse names given at start-up that the node does not have, such as misspelt ones.

    Raises
    ------
    ConfigurationError
        Naming the first of them and the parameter that is most like it.
    """
    unknown = sorted(
        name
        for name in _overrides(node)
        if not node.has_parameter(name) and not name.startswith('qos_overrides.')
    )
    if unknown:
        known = [each.name for each in all_parameters()]
        raise ConfigurationError(describe_unknown(unknown[0], known))


def _overrides(node: Any) -> dict[str, Parameter]:
    overrides: dict[str, Parameter] = getattr(node, '_parameter_overrides', {})
    return overrides


def _refusal(node: Any, description: ParameterDescription, error: Exception) -> str:
    # rclpy's own message names neither the range nor the value.
    given = _overrides(node).get(description.name)
    try:
        description.check(getattr(given, 'value', None))
    except ConfigurationError as reason:
        return str(reason)
    return str(error)
