"""Play a recording into the live ROS graph, with its own timing and reliable publishers."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rover_obstacle_detection.bags.reader import BadMessage, BagReader, open_bag
from rover_obstacle_detection.errors import BagError
from rover_obstacle_detection.node.process import StopSignals, ros
from rover_obstacle_detection.node.timeline import Timeline
from rover_obstacle_detection.wording import counted

DEPTH = 10
# Discovery is complete when no subscriber has appeared for this long.
SETTLE_S = 0.5
# Longest wait for subscribers to acknowledge the last messages.
ACKNOWLEDGE_S = 5.0
# Interval between checks for subscribers.
POLL_S = 0.02


@dataclass(frozen=True)
class PlayOptions:
    """Playback options.

    Parameters
    ----------
    rate : float
        Recorded seconds per second of playback.
    loop : bool
        Restart at the end, with the same stamps; a round takes at least 0.1 s.
    clock_hz : float
        Messages on /clock per second; 0 for none.
    start_s : float
        Seconds to skip at the beginning.
    duration_s : float, optional
        Recorded seconds to play. Default: to the end.
    topics : sequence of str
        Topics to play; empty for all.
    wait_s : float
        Longest wait for a first subscriber (s).
    """

    rate: float = 1.0
    loop: bool = False
    clock_hz: float = 0.0
    start_s: float = 0.0
    duration_s: float | None = None
    topics: Sequence[str] = ()
    wait_s: float = 5.0


def play(
    path: Path,
    options: PlayOptions,
    ros_arguments: Sequence[str] = (),
) -> None:
    """Play a recording until its end, Ctrl-C or SIGTERM.

    Parameters
    ----------
    path : Path
    options : PlayOptions
    ros_arguments : sequence of str, optional
        Without ``--ros-args``.

    Raises
    ------
    BagError
        If the recording cannot be read or lacks a requested topic.
    MissingExtraError
        If rclpy is not installed.
    """
    with open_bag(path) as bag:
        topics = _chosen_topics(bag, options)
        stop = StopSignals()
        try:
            with ros(ros_arguments) as warning:
                if warning is not None:
                    print(warning)
                player = Player(bag, topics, options, stop)
                try:
                    player.play()
                finally:
                    player.close()
        finally:
            stop.ignore()


class Player:
    """Publishes the topics of a recording; needs an initialised rclpy.

    Parameters
    ----------
    bag : BagReader
    topics : sequence of str
    options : PlayOptions
    stop : StopSignals
    """

    def __init__(
        self,
        bag: BagReader,
        topics: Sequence[str],
        options: PlayOptions,
        stop: StopSignals,
    ) -> None:
        import rclpy

        self._bag = bag
        self._options = options
        self._stop = stop
        self._published = 0
        self._bad = 0
        self._node = rclpy.create_node('rover_obstacles_player')
        self._publishers = {
            topic: publisher for topic in topics if (publisher := self._publisher(topic))
        }
        self._clock = self._clock_publisher() if options.clock_hz else None
        self._start_ns = bag.start_ns + round(options.start_s * 1e9)
        self._end_ns = bag.end_ns
        if options.duration_s is not None:
            self._end_ns = min(self._end_ns, self._start_ns + round(options.duration_s * 1e9))

    def play(self) -> None:
        """Wait for subscribers, then play once or in a loop."""
        if not self._wait_for_subscribers():
            return
        seconds = max(self._end_ns - self._start_ns, 0) / 1e9
        topics = counted(len(self._publishers), 'topic')
        print(
            f'playing {self._bag.path}: {topics}, {seconds:.1f} s at rate {self._options.rate:g}'
        )
        while self._play_round() and self._options.loop:
            pass
        self._finish()
        line = f'{counted(self._published, "message")} published'
        print(f'{line}, {self._bad} skipped that cannot be decoded' if self._bad else line)

    def close(self) -> None:
        """Remove the topics."""
        self._node.destroy_node()

    def _publisher(self, topic: str) -> Any:
        from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

        from rover_obstacle_detection.node.rclpy_factory import message_type

        type_name = self._bag.topics[topic]
        try:
            message_class = message_type(type_name)
        except ImportError:
            print(f'{topic}: skipped, {type_name} is not installed')
            return None
        qos = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.RELIABLE)
        if topic.endswith('tf_static'):
            # Published once, but needed by late subscribers.
            qos.durability = DurabilityPolicy.TRANSIENT_LOCAL
        return self._node.create_publisher(message_class, topic, qos)

    def _clock_publisher(self) -> Any:
        from rosgraph_msgs.msg import Clock

        return self._node.create_publisher(Clock, '/clock', 10)

    def _wait_for_subscribers(self) -> bool:
        started_s = changed_s = time.monotonic()
        before: tuple[int, ...] = ()
        while True:
            counts = tuple(each.get_subscription_count() for each in self._publishers.values())
            now_s = time.monotonic()
            if counts != before:
                before, changed_s = counts, now_s
            if any(counts) and now_s - changed_s >= SETTLE_S:
                return True
            if now_s - started_s >= self._options.wait_s:
                if not any(counts) and self._options.wait_s:
                    print('no subscriber to these topics yet')
                return True
            if self._stop.wait(POLL_S):
                return False

    def _play_round(self) -> bool:
        """Play from start to end; return False if interrupted."""
        timeline = Timeline(self._start_ns, self._options.rate, self._options.clock_hz)
        started_s = time.monotonic()
        ticks = 0
        # Includes the message at the end time.
        entries = self._bag.serialized_messages(
            tuple(self._publishers), self._start_ns, self._end_ns + 1
        )
        for topic, recorded_ns, data in entries:
            due_s = timeline.due_s(recorded_ns)
            while (tick_s := timeline.tick_s(ticks)) <= due_s:
                if self._wait_until(started_s + tick_s):
                    return False
                self._publish_clock(timeline.recorded_ns(tick_s))
                ticks += 1
            if self._wait_until(started_s + due_s):
                return False
            if isinstance(data, BadMessage):
                self._bad += 1
                print(f'{topic}: {data.reason}')
                continue
            self._publishers[topic].publish(bytes(data))
            self._published += 1
        if self._options.loop:
            return not self._wait_until(started_s + timeline.round_s(self._end_ns))
        return not self._wait_until(started_s + timeline.due_s(self._end_ns))

    def _wait_until(self, moment_s: float) -> bool:
        return self._stop.wait(max(0.0, moment_s - time.monotonic()))

    def _publish_clock(self, recorded_ns: int) -> None:
        from rclpy.time import Time
        from rosgraph_msgs.msg import Clock

        if self._clock is not None:
            self._clock.publish(Clock(clock=Time(nanoseconds=recorded_ns).to_msg()))

    def _finish(self) -> None:
        """Let the last messages arrive before their memory goes with this process."""
        from rclpy.duration import Duration

        for publisher in self._publishers.values():
            publisher.wait_for_all_acked(Duration(seconds=ACKNOWLEDGE_S))
        # Best-effort subscribers do not acknowledge.
        self._stop.wait(SETTLE_S)


def _chosen_topics(bag: BagReader, options: PlayOptions) -> list[str]:
    unknown = [topic for topic in options.topics if topic not in bag.topics]
    if unknown:
        msg = f'{bag.path}: no topic {unknown[0]}: there are {", ".join(sorted(bag.topics))}'
        raise BagError(msg)
    return sorted(options.topics or bag.topics)
