"""The node's parameters in ROS: declared with range and meaning, refused with a reason."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException

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


def current_settings(node: Any, changes: Iterable[Any] = ()) -> Settings:
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


def judge_change(node: Any, changes: Iterable[Any]) -> SetParametersResult:
    """Answer a request to set parameters: refused with the reason if they do not fit."""
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
    if isinstance(description.default, float) and isinstance(value, int):
        return f'{description.name} is {value}: expected a decimal point, as in {value}.0'
    return str(error)
