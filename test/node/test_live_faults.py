"""Every fault of the table, live: the node says so, and judges the next good pair."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from fault_row import Row
from faulty_rover import FaultyRover
from live_fault_table import LIVE_ROWS, OTHER_FILE, OTHER_PARAMETERS, START_ROWS
from live_graph import live_graph

from rover_obstacle_detection.cli.main import main


@pytest.fixture(scope='module')
def rover(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FaultyRover]:
    with live_graph(tmp_path_factory.mktemp('faults')) as graph:
        rover = FaultyRover(graph)
        rover.see_good_pair()
        yield rover


@pytest.mark.parametrize('fault', LIVE_ROWS, ids=lambda fault: fault.fault)
def test_fault_is_named_and_the_next_good_pair_judged(rover: FaultyRover, fault: Row) -> None:
    rover.see(fault)

    rover.see_good_pair()
    assert 'Traceback' not in rover.process.output


@pytest.mark.parametrize('fault', START_ROWS, ids=lambda fault: fault.fault)
def test_fault_at_the_start_is_one_line(
    rover: FaultyRover,
    fault: Row,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert isinstance(fault.inject, tuple)
    if '--ros-args' in fault.inject:
        process = rover.graph.start('run', *fault.inject)
        status, output = process.wait(), process.output
    else:
        # Found before ROS starts, and so without a process.
        monkeypatch.chdir(tmp_path)
        Path(OTHER_FILE).write_text(OTHER_PARAMETERS)
        status = main(['run', *fault.inject])
        output = capsys.readouterr().err

    assert status == 1
    assert output == f'rover-obstacles: error: {fault.says}\n'


def test_failed_pair_is_published_as_unknown(rover: FaultyRover) -> None:
    known = rover.graph.subscribe('sensor_msgs/msg/Image', '/stereo/debug/known')
    while not known.messages:
        rover.see_good_pair()
    left, right = rover.pair()
    left.encoding = 'nonsense'
    stamp = known.stamps_ns[-1]

    rover.camera.send_images(left, right)

    rover.wait_for(lambda: any(not any(each.data) for each in known.messages))
    assert known.stamps_ns[-1] > stamp
    rover.graph.unsubscribe(known)


def test_repeated_fault_is_counted_and_logged_once_in_ten_seconds(rover: FaultyRover) -> None:
    rover.see_good_pair()
    count = rover.diagnostics.count
    rover.wait_for(lambda: rover.diagnostics.count > count + 1)
    before = int(rover.diagnostics.value('detection', 'bad frames'))
    for number in range(1, 4):
        left, right = rover.pair()
        left.encoding = 'unheard of'
        rover.camera.send_images(left, right)
        rover.wait_for(
            lambda sent=number: (
                rover.diagnostics.value('detection', 'bad frames') == str(before + sent)
            )
        )
        rover.see_good_pair()

    assert rover.process.output.count("encoding is 'unheard of'") == 1
    rover.wait_for(
        lambda: rover.diagnostics.message('detection').endswith('detections per second')
    )
