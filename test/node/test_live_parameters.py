"""Parameters over the parameter services of a running node."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

import synthetic
from live_graph import Camera, LiveGraph, Process, live_graph

from rover_obstacle_detection.node.settings import READ_ONLY, all_parameters

VIEW = synthetic.render(synthetic.mast(solids=(synthetic.Box(0.0, 1.0, 0.3, 0.3, 0.25),)))
CAMERA = VIEW.scene.camera
SECOND = 1_000_000_000
PARAMETERS = {each.name: each for each in all_parameters()}
NUMBERS = [each for each in all_parameters() if each.minimum is not None]


class Remote:
    """The running node's parameters, as any ROS tool sees them."""

    def __init__(self, graph: LiveGraph, process: Process) -> None:
        self.graph = graph
        self.process = process

    def _call(self, name: str, **fields: Any) -> Any:
        from rcl_interfaces import srv

        type_ = getattr(srv, ''.join(part.capitalize() for part in name.split('_')))
        return self.graph.call(type_, f'/stereo/obstacle_detector/{name}', type_.Request(**fields))

    def set(self, **values: Any) -> Any:
        """Set all or none; return the answer."""
        from rclpy.parameter import Parameter

        messages = [
            Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
        ]
        return self._call('set_parameters_atomically', parameters=messages).result

    def get(self, name: str) -> Any:
        from rclpy.parameter import parameter_value_to_python

        return parameter_value_to_python(self._call('get_parameters', names=[name]).values[0])

    def describe(self, names: list[str]) -> list[Any]:
        return list(self._call('describe_parameters', names=names).descriptors)


@pytest.fixture(scope='module')
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveGraph]:
    with live_graph(tmp_path_factory.mktemp('parameters')) as graph:
        yield graph


@pytest.fixture(scope='module')
def process(graph: LiveGraph) -> Process:
    return graph.start_node('-p', 'max_slope:=30.0')


@pytest.fixture(scope='module')
def remote(graph: LiveGraph, process: Process) -> Remote:
    return Remote(graph, process)


def test_start_values_come_from_the_command_line_else_from_the_defaults(remote: Remote) -> None:
    assert remote.get('max_slope') == 30.0
    assert remote.get('max_step') == PARAMETERS['max_step'].default
    assert remote.get('rover_polygon') == ''


def test_every_parameter_is_described_with_its_range(remote: Remote) -> None:
    descriptors = remote.describe(list(PARAMETERS))

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


def test_every_range_is_enforced(remote: Remote) -> None:
    for parameter in NUMBERS:
        before = remote.get(parameter.name)
        is_float = isinstance(parameter.default, float)
        margin = 1.0 if is_float else 1
        impossible = [parameter.minimum - margin, parameter.maximum + margin]
        if is_float:
            impossible += [math.nan, math.inf, -math.inf]
        if parameter.step:
            impossible.append(parameter.minimum + 1)
        for value in impossible:
            answer = remote.set(**{parameter.name: value if is_float else int(value)})
            assert not answer.successful, (parameter.name, value)
            assert parameter.name in answer.reason, answer.reason
        assert remote.get(parameter.name) == before


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
def test_what_does_not_fit_is_refused_with_the_reason(
    remote: Remote, values: dict[str, Any], reason: str
) -> None:
    before = {name: remote.get(name) for name in values if name in PARAMETERS}

    answer = remote.set(**values)

    assert not answer.successful
    assert reason in answer.reason
    assert {name: remote.get(name) for name in before} == before


def test_whole_number_is_taken_for_a_decimal_one(remote: Remote) -> None:
    assert remote.set(max_range=8).successful
    assert remote.get('max_range') == 8.0
    assert remote.set(max_range=10.0).successful


def test_gravity_from_tf_needs_tf2_ros(remote: Remote) -> None:
    try:
        import tf2_ros  # noqa: F401
    except ImportError:
        answer = remote.set(gravity_source='tf')
        assert not answer.successful
        assert 'needs tf2_ros' in answer.reason
    else:
        pytest.skip('tf2_ros is installed')


def test_change_shows_in_the_next_mask(graph: LiveGraph, process: Process, remote: Remote) -> None:
    masks = graph.subscribe('sensor_msgs/msg/Image', '/stereo/obstacle_mask')
    camera = Camera(graph)
    camera.wait_for_subscribers()
    stamp = 1000 * SECOND

    def flagged() -> np.ndarray:
        nonlocal stamp
        stamp += SECOND
        camera.send(CAMERA, VIEW.left, VIEW.right, stamp)
        graph.wait_for(lambda: stamp in masks.stamps_ns, process)
        return np.frombuffer(masks.at(stamp).data, np.uint8).reshape(CAMERA.shape) > 0

    box = flagged()
    assert synthetic.iou(box, VIEW.obstacle) > 0.5

    rows, columns = np.nonzero(box)
    left, right, top, bottom = columns.min() - 5, columns.max() + 5, rows.min() - 5, rows.max() + 5
    corners = [[left, top], [right, top], [right, bottom], [left, bottom]]
    assert remote.set(rover_polygon=str([[int(x), int(y)] for x, y in corners])).successful
    assert not flagged().any()

    assert remote.set(rover_polygon='').successful
    np.testing.assert_array_equal(flagged(), box)

    assert remote.set(max_step=0.5, max_slope=60.0).successful
    assert np.count_nonzero(flagged()) < 0.2 * np.count_nonzero(box)
