"""The node's parameters in ROS: declared with range and meaning, refused with a reason."""

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


def declare_parameters(node: Any) -> Settings:
    """Declare every parameter with its descriptor.

    Returns
    -------
    Settings
        With what the command line and parameter files gave.

    Raises
    ------
    ConfigurationError
        In one line, if a given value has another type, is out of range, or contradicts another.
    """
    given = getattr(node, '_parameter_overrides', {})
    given.update({each.name: each for each in with_decimals(given.values())})
    for description in all_parameters():
        try:
            node.declare_parameter(
                description.name, description.default, make_descriptor(description)
            )
        except (InvalidParameterTypeException, InvalidParameterValueException) as error:
            raise ConfigurationError(_why_refused(node, description, error)) from error
    return current_settings(node)


def make_descriptor(description: ParameterDescription) -> ParameterDescriptor:
    """Describe a parameter as ROS tools show it."""
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
    """Read all parameters, with some changed, and check them together.

    Parameters
    ----------
    node : rclpy node
    changes : iterable of rclpy.parameter.Parameter

    Raises
    ------
    ObstacleDetectionError
        If they contradict each other, or need what is not installed.
    """
    names = [each.name for each in all_parameters()]
    values = {name: node.get_parameter(name).value for name in names if node.has_parameter(name)}
    values |= {each.name: each.value for each in changes if each.name in names}
    settings = Settings.from_values(values)
    if settings.config.gravity_source == 'tf':
        import_tf2_ros()
    return settings


def with_decimals(changes: Iterable[Parameter]) -> list[Parameter]:
    """Take whole numbers for parameters that have decimals; ROS itself refuses them."""
    decimals = {each.name for each in all_parameters() if isinstance(each.default, float)}
    return [
        Parameter(each.name, value=float(each.value))
        if each.name in decimals and each.type_ == Parameter.Type.INTEGER
        else each
        for each in changes
    ]


def concerns_settings(changes: Iterable[Parameter]) -> bool:
    """Whether parameters of `all_parameters` are among them, and not only ROS's own."""
    names = {each.name for each in all_parameters()}
    return any(each.name in names for each in changes)


def judge_change(node: Any, changes: Sequence[Parameter]) -> SetParametersResult:
    """Answer a request to set parameters: refused with the reason if they do not fit."""
    if not concerns_settings(changes):
        return SetParametersResult(successful=True)
    try:
        current_settings(node, changes)
    except ObstacleDetectionError as error:
        return SetParametersResult(successful=False, reason=str(error))
    return SetParametersResult(successful=True)


def unknown_parameters(node: Any) -> list[str]:
    """Names that were given at the start and that the node does not have: misspelt, perhaps."""
    given = getattr(node, '_parameter_overrides', {})
    return sorted(
        name
        for name in given
        if not node.has_parameter(name) and not name.startswith('qos_overrides.')
    )


def _why_refused(node: Any, description: ParameterDescription, error: Exception) -> str:
    given = getattr(node, '_parameter_overrides', {}).get(description.name)
    value = getattr(given, 'value', None)
    try:
        description.check(value)
    except ConfigurationError as reason:
        return str(reason)
    return str(error)
