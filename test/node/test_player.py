"""``rover-obstacles play``: published messages and exit status."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Rosbag1Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from rover_obstacle_detection.cli.main import main

SECOND = 1_000_000_000
START_NS = 1_600_000_000 * SECOND
LEFT = '/stereo/left/image_rect'
INFO = '/stereo/left/camera_info'


def test_missing_bag_or_topic_is_a_one_line_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_rosbag1(tmp_path / 'old.bag')

    assert main(['play', str(tmp_path / 'none')]) == 1
    assert capsys.readouterr().err.endswith('none: no such recording\n')
    assert main(['play', str(tmp_path / 'old.bag'), '--topics', '/nothing']) == 1
    error = capsys.readouterr().err
    assert 'no topic /nothing: there are ' in error
    assert error.count('\n') == 1


@pytest.mark.parametrize('option', ['--rate=0', '--rate=fast', '--start=-1', '--clock=0'])
def test_usage_error(option: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(['play', 'bag', option])

    assert end.value.code == 2
    assert 'error: argument' in capsys.readouterr().err


@pytest.fixture(scope='module')
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    pytest.importorskip('rclpy', reason='needs ROS 2')
    from live_graph import live_graph

    with live_graph(tmp_path_factory.mktemp('player')) as graph:
        yield graph


@pytest.fixture(scope='module')
def images(graph: Any) -> Any:
    return graph.subscribe('sensor_msgs/msg/Image', LEFT)


def exposures() -> tuple[Any, Any]:
    """The views that `bag` holds in turn."""
    import synthetic

    view = synthetic.render(synthetic.mast(32, 24))
    return view, synthetic.exposed_again(view)


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten small pairs at 10 Hz."""
    from live_graph import write_stereo_bag

    path = tmp_path_factory.mktemp('recorded') / 'bag'
    write_stereo_bag(
        path, exposures()[0], [START_NS + number * SECOND // 10 for number in range(10)]
    )
    return path


def test_all_messages_arrive_unchanged(graph: Any, images: Any, bag: Path) -> None:
    images.messages.clear()
    infos = graph.subscribe('sensor_msgs/msg/CameraInfo', INFO)

    player = graph.start('play', str(bag))

    assert player.wait() == 0
    graph.wait_for(lambda: len(images.messages) == 10 and len(infos.messages) == 10)
    assert images.stamps_ns == [START_NS + number * SECOND // 10 for number in range(10)]
    assert infos.messages[3].p[0] == pytest.approx(infos.messages[0].p[5])
    # Two exposures in turn.
    recorded = [exposure.left.tobytes() for exposure in exposures()]
    assert [message.data.tobytes() for message in images.messages] == 5 * recorded
    assert '40 messages published' in player.output


def test_part_of_a_bag_and_selected_topics(graph: Any, images: Any, bag: Path) -> None:
    images.messages.clear()
    infos = graph.subscribe('sensor_msgs/msg/CameraInfo', INFO)

    player = graph.start(
        'play', str(bag), '--start', '0.25', '--duration', '0.5', '--rate', '2', '--topics', LEFT
    )

    assert player.wait() == 0
    graph.wait_for(lambda: len(images.messages) == 5)
    assert images.stamps_ns == [START_NS + number * SECOND // 10 for number in range(3, 8)]
    assert infos.messages == []


def test_remap_and_clock(graph: Any, bag: Path) -> None:
    elsewhere = graph.subscribe('sensor_msgs/msg/Image', '/elsewhere')
    clock = graph.subscribe('rosgraph_msgs/msg/Clock', '/clock', 1000)

    player = graph.start(
        'play', str(bag), '--clock', '50', '--ros-args', '-r', f'{LEFT}:=/elsewhere'
    )

    assert player.wait() == 0
    graph.wait_for(lambda: len(elsewhere.messages) == 10 and len(clock.messages) > 40)
    times = [message.clock.sec * SECOND + message.clock.nanosec for message in clock.messages]
    np.testing.assert_allclose(np.diff(times), SECOND / 50, atol=2)
    assert START_NS <= times[0] <= times[-1] <= START_NS + SECOND


def test_ros_1_bag_is_played(graph: Any, tmp_path: Path) -> None:
    write_rosbag1(tmp_path / 'old.bag')
    infos = graph.subscribe('sensor_msgs/msg/CameraInfo', '/old/camera_info')

    player = graph.start('play', str(tmp_path / 'old.bag'))

    assert player.wait() == 0
    graph.wait_for(lambda: len(infos.messages) == 2)
    assert infos.stamps_ns == [START_NS, START_NS + SECOND // 10]
    assert (infos.messages[0].width, infos.messages[0].header.frame_id) == (64, 'left_optical')
    assert list(infos.messages[1].p) == list(range(12))
    assert list(infos.messages[1].d) == [0.5]
    assert '/old/odd: skipped, odd_msgs/msg/Odd is not installed' in player.output


@pytest.mark.parametrize('signals', [(signal.SIGINT,) * 2, (signal.SIGTERM,)])
def test_signal_ends_playback_cleanly(
    graph: Any, images: Any, bag: Path, signals: tuple[signal.Signals, ...]
) -> None:
    images.messages.clear()
    player = graph.start('play', str(bag), '--loop')
    graph.wait_for(lambda: len(images.messages) > 3, player)

    for number in signals:
        player.send(number)

    assert player.wait() == 0
    assert 'Traceback' not in player.output


def write_rosbag1(path: Path) -> None:
    """Write two calibrations, and two messages of a type that is not installed."""
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg('int32 odd', 'odd_msgs/msg/Odd'))
    types = store.types
    make_time, header = types['builtin_interfaces/msg/Time'], types['std_msgs/msg/Header']
    roi = types['sensor_msgs/msg/RegionOfInterest'](0, 0, 0, 0, False)
    with Rosbag1Writer(path) as writer:
        infos = writer.add_connection(
            '/old/camera_info', 'sensor_msgs/msg/CameraInfo', typestore=store
        )
        odd = writer.add_connection('/old/odd', 'odd_msgs/msg/Odd', typestore=store)
        for number in range(2):
            stamp = START_NS + number * SECOND // 10
            info = types['sensor_msgs/msg/CameraInfo'](
                header(number, make_time(*divmod(stamp, SECOND)), 'left_optical'),
                48,
                64,
                'plumb_bob',
                np.array([0.5]),
                np.zeros(9),
                np.zeros(9),
                np.arange(12.0),
                0,
                0,
                roi,
            )
            writer.write(infos, stamp, store.serialize_ros1(info, 'sensor_msgs/msg/CameraInfo'))
            message = types['odd_msgs/msg/Odd'](number)
            writer.write(odd, stamp, store.serialize_ros1(message, 'odd_msgs/msg/Odd'))
