"""What the node bears: figures that tests judge and the benchmark prints."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import synthetic
from live_graph import Camera, LiveGraph, Process

NODE_MASK = '/stereo/obstacle_mask'
OUTPUTS = {
    NODE_MASK: 'sensor_msgs/msg/Image',
    '/stereo/obstacle_points': 'sensor_msgs/msg/PointCloud2',
    '/stereo/ground_points': 'sensor_msgs/msg/PointCloud2',
}


class Driver:
    """Sends a pair at a steady rate from a thread, stamped with the clock, as a driver does."""

    def __init__(self, graph: LiveGraph, view: Any, rate_hz: float) -> None:
        self.camera = Camera(graph)
        self.stamps_ns: list[int] = []
        self._stereo = view.scene.camera
        # Two exposures in turn: a camera that repeats its image counts as frozen.
        self._exposures = itertools.cycle(
            [self.camera.image(image, 1) for image in (each.left, each.right)]
            for each in (view, synthetic.exposed_again(view))
        )
        self._period_s = 1.0 / rate_hz
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._stopped.set()
        self._thread.join()

    def send(self) -> int:
        """Send one pair; return its stamp."""
        stamp = time.time_ns()
        self.camera.send_infos(self._stereo, stamp)
        images = next(self._exposures)
        for image in images:
            image.header.stamp.sec, image.header.stamp.nanosec = divmod(stamp, 1_000_000_000)
        self.stamps_ns.append(stamp)
        self.camera.send_images(*images)
        return stamp

    def _run(self) -> None:
        due_s = time.monotonic()
        while not self._stopped.wait(max(0.0, due_s - time.monotonic())):
            self.send()
            due_s += self._period_s


def idle_cpu_share(graph: LiveGraph, view: Any, *, rate_hz: float, seconds: float) -> float:
    """Share of one core that the node takes while nobody listens to it."""
    diagnostics = graph.diagnostics()
    process = graph.start_node()
    driver = Driver(graph, view, rate_hz)
    graph.wait_for(
        lambda: driver.camera.publishers['left', 'camera_info'].get_subscription_count()
    )
    driver.start()
    graph.wait_for(lambda: len(driver.stamps_ns) > rate_hz, process)
    before_s, started_s = process.cpu_s(), time.monotonic()
    graph.wait_for(lambda: time.monotonic() - started_s > seconds, process)
    share = (process.cpu_s() - before_s) / (time.monotonic() - started_s)
    driver.stop()
    assert diagnostics.message('detection').startswith('idle')
    return share


def first_mask_s(graph: LiveGraph, view: Any) -> float:
    """Seconds from the start of the node's process to its first mask, a camera running."""
    masks = graph.subscribe(OUTPUTS[NODE_MASK], NODE_MASK)
    driver = Driver(graph, view, 10.0)
    driver.start()
    started_s = time.monotonic()
    process = graph.start('run', '--namespace', 'stereo')
    graph.wait_for(lambda: masks.messages, process)
    seconds = time.monotonic() - started_s
    driver.stop()
    return seconds


@dataclass(frozen=True)
class Steady:
    """A bag at a rate that the machine bears."""

    sent: int
    pairs: int
    lost: int
    dropped: int
    detections: int
    latency_p50_ms: float
    latency_p95_ms: float
    settled_mb: float
    end_mb: float
    own_mb: float
    settled_lost: int
    """Images lost and pairs dropped while it settled."""
    settled_dropped: int
    cpu_ms: float
    """CPU time of the node for each pair after it settled."""


def steady(
    graph: LiveGraph,
    bag: Path,
    frames: int,
    settled_after: int,
    *,
    loop: bool = False,
    start_node: Callable[[LiveGraph], Process] = LiveGraph.start_node,
) -> Steady:
    """Play a bag into the node with mask and clouds subscribed.

    In a loop, until this many frames came after it settled, which needs some detections too.
    """
    diagnostics = graph.diagnostics()
    topics = [graph.subscribe(type_, topic) for topic, type_ in OUTPUTS.items()]
    process = start_node(graph)
    graph.wait_until_listening('/stereo/left/image_rect', '/stereo/right/image_rect')
    player = graph.start('play', str(bag), *(['--loop'] if loop else []))

    def count(task: str, name: str) -> int:
        return int(diagnostics.value(task, name, '0'))

    def pairs() -> int:
        # What came is of no interest here, and would fill the memory.
        for topic in topics:
            topic.messages.clear()
            topic.arrivals_s.clear()
        return count('stereo input', 'pairs')

    least = settled_after // 5 if loop else 0

    def settled() -> bool:
        return pairs() >= settled_after and count('detection', 'detections') >= least

    graph.wait_for(settled, process, timeout_s=120)
    settled_mb, settled_cpu_s, settled_pairs = process.resident_mb(), process.cpu_s(), pairs()
    settled_lost = count('stereo input', 'images lost on the way')
    settled_dropped = count('detection', 'dropped frames')
    graph.wait_for(
        lambda: not player.running or (loop and pairs() >= settled_pairs + frames),
        process,
        timeout_s=300,
    )
    cpu_s = process.cpu_s() - settled_cpu_s
    assert player.stop() == 0, player.output
    seen = diagnostics.count
    graph.wait_for(lambda: diagnostics.count > seen + 1, process)

    def judged() -> int:
        names = ('detections', 'dropped frames', 'bad frames')
        return sum(count('detection', name) for name in names)

    # On a busy machine, the last pair takes seconds.
    graph.wait_for(lambda: judged() >= pairs(), process)
    return Steady(
        sent=frames,
        pairs=pairs(),
        lost=count('stereo input', 'images lost on the way'),
        dropped=count('detection', 'dropped frames'),
        detections=count('detection', 'detections'),
        latency_p50_ms=float(diagnostics.value('detection', 'latency p50 (ms)')),
        latency_p95_ms=float(diagnostics.value('detection', 'latency p95 (ms)')),
        settled_mb=settled_mb,
        end_mb=process.resident_mb(),
        own_mb=process.own_mb(),
        settled_lost=settled_lost,
        settled_dropped=settled_dropped,
        cpu_ms=1000 * cpu_s / max(pairs() - settled_pairs, 1),
    )


@dataclass(frozen=True)
class Overload:
    """More pairs than the machine can do."""

    frame_s: float
    sent: int
    received: int
    """Left and right images."""
    pairs: int
    lost: int
    dropped: int
    detections: int
    bad: int
    staleness_s: np.ndarray
    """Age of each pair when its detection began, by the arrival of the mask before it."""
    recovered_s: float


def overload(graph: LiveGraph, view: Any, *, rate_hz: float, seconds: float) -> Overload:
    """Flood the node for a while, then send one pair at rest."""
    diagnostics = graph.diagnostics()
    masks = graph.subscribe(OUTPUTS[NODE_MASK], NODE_MASK)
    process = graph.start_node()
    driver = Driver(graph, view, rate_hz)
    driver.camera.wait_for_subscribers()
    driver.start()
    started_s = time.monotonic()
    graph.wait_for(lambda: time.monotonic() - started_s > seconds, process)
    driver.stop()
    flooded = len(driver.stamps_ns)
    _wait_until_done(graph, diagnostics, process)
    counts = {
        name: int(diagnostics.value('detection', name))
        for name in ('detections', 'dropped frames', 'bad frames')
    }
    pairs = int(diagnostics.value('stereo input', 'pairs'))
    received = sum(
        int(diagnostics.value('stereo input', f'{side} images')) for side in ('left', 'right')
    )
    lost = int(diagnostics.value('stereo input', 'images lost on the way'))
    starts_s = masks.arrivals_s[:-1]
    stamps_s = [stamp / 1e9 for stamp in masks.stamps_ns[1:]]
    last = driver.send()
    sent_s = time.monotonic()
    graph.wait_for(lambda: last in masks.stamps_ns, process)
    return Overload(
        frame_s=1.0 / rate_hz,
        sent=flooded,
        received=received,
        pairs=pairs,
        lost=lost,
        dropped=counts['dropped frames'],
        detections=counts['detections'],
        bad=counts['bad frames'],
        staleness_s=np.subtract(starts_s, stamps_s),
        recovered_s=time.monotonic() - sent_s,
    )


def _wait_until_done(graph: LiveGraph, diagnostics: Any, process: Process) -> None:
    """Wait until the node has nothing left to do: two equal reports."""

    def counts() -> tuple[str, ...]:
        return tuple(
            diagnostics.value('detection', name) for name in ('detections', 'dropped frames')
        )

    last, seen = counts(), diagnostics.count

    def settled() -> bool:
        nonlocal last, seen
        if diagnostics.count <= seen + 1:
            return False
        before, last, seen = last, counts(), diagnostics.count
        return before == last

    graph.wait_for(settled, process)
