"""A ROS graph for one test: its own domain, our node and player as processes of their own."""

from __future__ import annotations

import fcntl
import itertools
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import synthetic

from rover_obstacle_detection.bags.writer import BagWriter
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.messages.factory import MessageFactory
from rover_obstacle_detection.messages.header import make_header, stamp_ns
from rover_obstacle_detection.messages.image import encode_image
from rover_obstacle_detection.node.rclpy_factory import RclpyFactory, message_type
from rover_obstacle_detection.node.transport import use_large_message_profile

ROOT = Path(__file__).parents[2]
DOMAINS = range(1, 100)
PATIENCE_S = 30.0
FRAME = 'stereo_left_optical_frame'

Condition = Callable[[], Any]


class Process:
    """One of our commands, its output in a file."""

    def __init__(self, arguments: Sequence[str], log: Path, environment: dict[str, str]) -> None:
        self.log = log
        with log.open('wb') as file:
            self._process = subprocess.Popen(
                arguments,
                stdout=file,
                stderr=subprocess.STDOUT,
                env=environment,
                cwd=log.parent,
            )
        self.pid = self._process.pid

    @property
    def output(self) -> str:
        return self.log.read_text(errors='replace')

    @property
    def running(self) -> bool:
        return self._process.poll() is None

    def send(self, number: signal.Signals) -> None:
        self._process.send_signal(number)

    def wait(self, timeout_s: float = PATIENCE_S) -> int:
        return self._process.wait(timeout_s)

    def stop(self) -> int:
        """End it as Ctrl-C does, the hard way only if that does not help."""
        if self.running:
            self.send(signal.SIGINT)
        try:
            return self.wait()
        except subprocess.TimeoutExpired:
            self._process.kill()
            self.wait()
            raise

    def cpu_s(self) -> float:
        fields = Path(f'/proc/{self.pid}/stat').read_text().rpartition(')')[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')

    def resident_mb(self) -> float:
        return self._memory_mb('VmRSS')

    def own_mb(self) -> float:
        """Resident memory without the segments that it shares with other processes."""
        return self.resident_mb() - self._memory_mb('RssShmem')

    def proportional_mb(self) -> float:
        """Resident memory, with shared pages divided by the number of their users."""
        return self._memory_mb('Pss', 'smaps_rollup')

    def threads(self) -> int:
        return len(list(Path(f'/proc/{self.pid}/task').iterdir()))

    def descriptors(self) -> int:
        return len(list(Path(f'/proc/{self.pid}/fd').iterdir()))

    def _memory_mb(self, name: str, file: str = 'status') -> float:
        text = Path(f'/proc/{self.pid}/{file}').read_text()
        found = re.search(rf'^{name}:\s+(\d+) kB', text, re.MULTILINE)
        assert found
        return int(found[1]) / 1024


class Topic:
    """A subscription that keeps what came, with the time of arrival."""

    def __init__(self) -> None:
        self.subscription: Any = None
        self.messages: list[Any] = []
        self.arrivals_s: list[float] = []

    def take(self, message: Any) -> None:
        self.messages.append(message)
        self.arrivals_s.append(time.time())

    @property
    def stamps_ns(self) -> list[int]:
        return [stamp_ns(message.header) for message in self.messages]

    def at(self, stamp: int) -> Any:
        return self.messages[self.stamps_ns.index(stamp)]


class Diagnostics:
    """What the node said last on /diagnostics."""

    def __init__(self) -> None:
        self.count = 0
        self.statuses: dict[str, Any] = {}
        self.stamps_ns: list[int] = []

    def take(self, array: Any) -> None:
        self.count += 1
        self.stamps_ns.append(stamp_ns(array.header))
        for status in array.status:
            self.statuses[status.name.partition(': ')[2]] = status

    def message(self, task: str) -> str:
        return str(self.statuses[task].message) if task in self.statuses else ''

    def level(self, task: str) -> int:
        return int.from_bytes(self.statuses[task].level, 'little')

    def value(self, task: str, key: str, default: str = '') -> str:
        if task not in self.statuses:
            return default
        values = {each.key: each.value for each in self.statuses[task].values}
        return str(values.get(key, default))


class LiveGraph:
    """The test's own node, and the processes it started."""

    def __init__(self, domain: int, folder: Path) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        self.folder = folder
        self.factory = RclpyFactory()
        self.environment = os.environ | {'ROS_DOMAIN_ID': str(domain)}
        self._context = rclpy.Context()
        rclpy.init(args=[], context=self._context, domain_id=domain)
        self.node = rclpy.create_node('test', context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._processes: list[Process] = []
        self._ended = threading.Event()

    def start(self, *arguments: str) -> Process:
        return self.start_python(arguments[0], '-m', 'rover_obstacle_detection', *arguments)

    def start_python(self, name: str, *arguments: str) -> Process:
        log = self.folder / f'{len(self._processes)}_{name}.log'
        process = Process([sys.executable, *arguments], log, self.environment)
        self._processes.append(process)
        return process

    def start_node(self, *ros_arguments: str, namespace: str = 'stereo') -> Process:
        return self.wait_until_active(
            self.start('run', '--namespace', namespace, '--ros-args', *ros_arguments)
        )

    def wait_until_active(self, process: Process) -> Process:
        self.wait_for(lambda: ' active, method ' in process.output, process)
        return process

    def create_node(self, name: str, **options: Any) -> Any:
        """Create another node in the process of the test."""
        import rclpy

        return rclpy.create_node(name, context=self._context, **options)

    def subscribe(self, type_name: str, topic: str, qos: Any = 10) -> Topic:
        kept = Topic()
        kept.subscription = self.node.create_subscription(
            message_type(type_name), topic, kept.take, qos
        )
        return kept

    def unsubscribe(self, topic: Topic) -> None:
        self.node.destroy_subscription(topic.subscription)

    def diagnostics(self) -> Diagnostics:
        kept = Diagnostics()
        self.node.create_subscription(
            message_type('diagnostic_msgs/msg/DiagnosticArray'), '/diagnostics', kept.take, 10
        )
        return kept

    def wait_for(
        self, condition: Condition, *running: Process, timeout_s: float = PATIENCE_S
    ) -> None:
        """Spin until something is true; fail if it takes too long or a process ends."""
        end_s = time.monotonic() + timeout_s
        while not condition():
            for process in running:
                assert process.running, process.output
            assert time.monotonic() < end_s, self._vain(timeout_s)
            self._executor.spin_once(timeout_sec=0.02)

    def _vain(self, waited_s: float) -> str:
        outputs = '\n'.join(process.output for process in self._processes)
        return f'waited {waited_s} s in vain\n{outputs}'

    def wait_until_listening(self, *topics: str) -> None:
        """Wait until somebody subscribes to all of these topics."""
        self.wait_for(lambda: all(self.node.count_subscribers(topic) for topic in topics))

    def wait_until_matched(self, *publishers: Any) -> None:
        """Wait until publishers and their subscribers in our node have found each other.

        A publisher may find a subscriber first, which then misses what is published. Participants
        announce their endpoints in order: who answers a client of now has found the publishers.
        """
        from lifecycle_msgs.srv import GetState

        self.wait_for(lambda: all(each.get_subscription_count() for each in publishers))
        self.call(GetState, '/stereo/obstacle_detector/get_state', GetState.Request())

    def call(self, type_: Any, name: str, request: Any) -> Any:
        client = self.node.create_client(type_, name)
        self.wait_for(client.service_is_ready)
        future = client.call_async(request)
        self.wait_for(future.done)
        self.node.destroy_client(client)
        return future.result()

    def close(self) -> None:
        for process in self._processes:
            process.stop()
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()


class Camera:
    """Publishes pairs of one stereo camera, reliably, as a driver does."""

    def __init__(
        self,
        graph: LiveGraph,
        namespace: str = '/stereo',
        info_qos: Any = 10,
        image: str = 'image_rect',
    ) -> None:
        self.graph = graph
        self._namespace = namespace
        self._image = image
        self._names = {
            image: ('sensor_msgs/msg/Image', 10),
            'camera_info': ('sensor_msgs/msg/CameraInfo', info_qos),
        }
        self.publishers = {
            (side, name): self.create(side, name)
            for side in ('left', 'right')
            for name in self._names
        }

    def create(self, side: str, name: str) -> Any:
        """Create a publisher."""
        type_name, qos = self._names[name]
        topic = f'{self._namespace}/{side}/{name}'
        return self.graph.node.create_publisher(message_type(type_name), topic, qos)

    def wait_for_subscribers(self) -> None:
        """Wait until the node subscribes to the four topics and has found the publishers."""
        self.graph.wait_until_matched(*self.publishers.values())

    def info(self, camera: StereoCamera, side: str, stamp: int) -> Any:
        return make_info(camera, side, stamp, self.graph.factory)

    def image(self, array: np.ndarray, stamp: int) -> Any:
        return make_image(array, stamp, self.graph.factory)

    def send_infos(self, camera: StereoCamera, stamp: int) -> None:
        for side in ('left', 'right'):
            self.publishers[side, 'camera_info'].publish(self.info(camera, side, stamp))

    def send_images(self, left: Any, right: Any) -> None:
        self.publishers['left', self._image].publish(left)
        self.publishers['right', self._image].publish(right)

    def send(self, camera: StereoCamera, left: np.ndarray, right: np.ndarray, stamp: int) -> None:
        """Send a good pair with its calibration."""
        self.send_infos(camera, stamp)
        self.send_images(self.image(left, stamp), self.image(right, stamp))


def make_info(camera: StereoCamera, side: str, stamp: int, factory: MessageFactory) -> Any:
    p = [camera.fx, 0, camera.cx, 0, 0, camera.fy, camera.cy, 0, 0, 0, 1, 0]
    if side == 'right':
        p[3] = -camera.fx * camera.baseline_m
    return factory.make(
        'sensor_msgs/msg/CameraInfo',
        header=make_header(stamp, FRAME, factory),
        width=camera.width,
        height=camera.height,
        p=np.array(p, np.float64),
    )


def make_image(array: np.ndarray, stamp: int, factory: MessageFactory) -> Any:
    encoding = 'bgr8' if array.ndim == 3 else 'mono16' if array.dtype == np.uint16 else 'mono8'
    return encode_image(array, encoding, make_header(stamp, FRAME, factory), factory)


def write_stereo_bag(
    path: Path, view: Any, stamps: Sequence[int], *, end: int | None = None
) -> None:
    """Record one scene in two exposures in turn: a camera that repeats its image is frozen.

    At ``end`` a last calibration, for loops of steady rate.
    """
    images = [(each.left, each.right) for each in (view, synthetic.exposed_again(view))]
    write_pairs(path, view.scene.camera, images, stamps, end=end)


def write_pairs(
    path: Path,
    camera: StereoCamera,
    images: Sequence[tuple[np.ndarray, np.ndarray]],
    stamps: Sequence[int],
    *,
    end: int | None = None,
    compress: bool = True,
) -> None:
    """Record pairs of images in turn, and at ``end`` a last calibration."""
    with BagWriter(path, compress=compress) as bag:
        for stamp, pair in zip(stamps, itertools.cycle(images), strict=False):
            for side, array in zip(('left', 'right'), pair, strict=True):
                info = make_info(camera, side, stamp, bag.factory)
                image = make_image(array, stamp, bag.factory)
                bag.add(f'/stereo/{side}/camera_info', 'sensor_msgs/msg/CameraInfo', info, stamp)
                bag.add(f'/stereo/{side}/image_rect', 'sensor_msgs/msg/Image', image, stamp)
        if end is not None:
            info = make_info(camera, 'left', end, bag.factory)
            bag.add('/stereo/left/camera_info', 'sensor_msgs/msg/CameraInfo', info, end)


@contextmanager
def own_domain() -> Iterator[int]:
    """Take a ROS domain that no other test on this machine uses."""
    for domain in DOMAINS:
        lock = Path(tempfile.gettempdir()) / f'rover_obstacle_detection_domain_{domain}.lock'
        with lock.open('w') as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                continue
            yield domain
            return
    msg = 'no ROS domain is free'
    raise RuntimeError(msg)


@contextmanager
def live_graph(folder: Path) -> Iterator[LiveGraph]:
    """Set up a graph of one test, and take it down with all its processes."""
    # Before the first participant of this process; later ones find it set.
    use_large_message_profile()
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    with own_domain() as domain:
        graph = LiveGraph(domain, folder)
        try:
            yield graph
        finally:
            graph.close()
