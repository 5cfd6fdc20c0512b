"""Parameters of a running node, over its parameter services."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

import synthetic
from live_graph import live_graph
from live_rover import Rover

from rover_obstacle_detection.node.settings import READ_ONLY, all_parameters

VIEW = synthetic.render(synthetic.mast(solids=(synthetic.Box(0.0, 1.0, 0.3, 0.3, 0.25),)))
PARAMETERS = {each.name: each for each in all_parameters()}
NUMBERS = [each for each in all_parameters() if each.minimum is not None]


class ConfigurableRover(Rover):
    def _call(self, name: str, **fields: Any) -> Any:
        from rcl_interfaces import srv

        type_ = getattr(srv, ''.join(part.capitalize() for part in name.split('_')))
        return self.graph.call(type_, f'/stereo/obstacle_detector/{name}', type_.Request(**fields))

    def get(self, name: str) -> Any:
        from rclpy.parameter import parameter_value_to_python

        return parameter_value_to_python(self._call('get_parameters', names=[name]).values[0])

    def describe(self, names: list[str]) -> list[Any]:
        return list(self._call('describe_parameters', names=names).descriptors)


@pytest.fixture(scope='module')
def rover(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ConfigurableRover]:
    with live_graph(tmp_path_factory.mktemp('parameters')) as graph:
        yield ConfigurableRover(graph, '-p', 'max_slope:=30.0')


def test_initial_values_come_from_the_command_line_or_the_defaults(
    rover: ConfigurableRover,
) -> None:
    assert rover.get('max_slope') == 30.0
    assert rover.get('max_step') == PARAMETERS['max_step'].default
    assert rover.get('rover_polygon') == ''


def test_every_descriptor_has_the_range(rover: ConfigurableRover) -> None:
    descriptors = rover.describe(list(PARAMETERS))

    assert [each.name for each in descriptors] == list(PARAMETERS)
    for descriptor, parameter in zip(descriptors, PARAMETERS.values(), strict=True):
        assert parameter.description in descriptor.description
        assert descriptor.read_only == (parameter.name in READ_ONLY)
        ranges = [*descriptor.integer_range, *descriptor.floating_point_range]
        if parameter.minimum is None:
            assert not ranges
        else:
            assert (ranges[0].from_value, ranges[0].to_value) == (
                parameter.minimum,
                parameter.maximum,
            )
            assert ranges[0].step == (parameter.step or 0)


def test_every_range_is_enforced(rover: ConfigurableRover) -> None:
    for parameter in NUMBERS:
        before = rover.get(parameter.name)
        is_float = isinstance(parameter.default, float)
        margin = 1.0 if is_float else 1
        impossible = [parameter.minimum - margin, parameter.maximum + margin]
        if is_float:
            impossible += [math.nan, math.inf, -math.inf]
        if parameter.step:
            impossible.append(parameter.minimum + 1)
        for value in impossible:
            answer = rover.request_parameters(
                **{parameter.name: value if is_float else int(value)}
            )
            assert not answer.successful, (parameter.name, value)
            assert parameter.name in answer.reason, answer.reason
        assert rover.get(parameter.name) == before


@pytest.mark.parametrize(
    ('values', 'reason'),
    [
        ({'method': 'magic'}, "method is 'magic': expected one of hybrid, study"),
        ({'gravity_source': 'stars'}, 'expected one of estimate, parameters, imu, tf'),
        ({'max_range': 0.2}, 'max_range is 0.2: expected more than min_range'),
        ({'P1': 800.0, 'P2': 400.0}, 'P2 is 400.0: expected more than P1'),
        ({'rover_mask': '/nowhere/mask.png'}, 'no such file'),
        ({'rover_polygon': '[[1, 2]]'}, 'expected three or more corners'),
        ({'base_frame': ''}, 'expected the name of a frame'),
        ({'max_step': 'high'}, 'Wrong parameter type'),
        ({'autostart': False}, 'read-only'),
        ({'max_stp': 0.1}, 'undeclared'),
    ],
)
def test_invalid_change_is_refused_with_the_reason(
    rover: ConfigurableRover, values: dict[str, Any], reason: str
) -> None:
    before = {name: rover.get(name) for name in values if name in PARAMETERS}

    answer = rover.request_parameters(**values)

    assert not answer.successful
    assert reason in answer.reason
    assert {name: rover.get(name) for name in before} == before


def test_integer_is_accepted_for_a_float_parameter(rover: ConfigurableRover) -> None:
    rover.set(max_range=8)
    assert rover.get('max_range') == 8.0
    rover.set(max_range=10.0)


def test_an_angle_without_effect_is_named_in_the_log(rover: ConfigurableRover) -> None:
    rover.set(camera_pitch=30)
    words = "camera_pitch will have no effect, since gravity_source is 'estimate'"
    rover.wait_for(lambda: words in rover.process.output)
    rover.set(camera_pitch=0)


def test_gravity_from_tf_needs_tf2_ros(rover: ConfigurableRover) -> None:
    try:
        import tf2_ros  # noqa: F401
    except ImportError:
        answer = rover.request_parameters(gravity_source='tf')
        assert not answer.successful
        assert 'needs tf2_ros' in answer.reason
    else:
        pytest.skip('tf2_ros is installed')


def test_change_takes_effect_with_the_next_pair(rover: ConfigurableRover) -> None:
    rover.camera.wait_for_subscribers()
    box = rover.detect(VIEW) > 0
    assert synthetic.iou(box, VIEW.obstacle) > 0.5

    rows, columns = np.nonzero(box)
    left, right, top, bottom = columns.min() - 5, columns.max() + 5, rows.min() - 5, rows.max() + 5
    corners = [[left, top], [right, top], [right, bottom], [left, bottom]]
    rover.set(rover_polygon=str([[int(x), int(y)] for x, y in corners]))
    assert not rover.detect(VIEW).any()

    rover.set(rover_polygon='')
    np.testing.assert_array_equal(rover.detect(VIEW) > 0, box)

    rover.set(max_step=0.5, max_slope=60.0)
    assert np.count_nonzero(rover.detect(VIEW)) < 0.2 * np.count_nonzero(box)
