"""What the node counts: frames in, frames out, and how long they took."""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

RATE_WINDOW_S = 5.0
LATEST = 100


@dataclass(frozen=True)
class Snapshot:
    """The counters at one moment.

    Parameters
    ----------
    pair_rate_hz : float
        Pairs that arrived per second, of the last 5 s.
    detection_rate_hz : float
        Detections published per second, of the last 5 s.
    detected : int
        Detections published.
    dropped : int
        Good pairs that a newer one replaced before the detector was free.
    lost : int
        Images that were sent and never reached the node.
    bad : dict of str to int
        Frames that could not be used, by what was wrong with them.
    latency_p50_ms, latency_p95_ms : float or None
        From the arrival of a pair's second image to its last message published, of the latest
        100 detections; None before the first.
    valid_share, obstacle_share : float or None
        Share of pixels with a disparity, and on obstacles, of the latest detection.
    rows_off_px, lens_bend_px : float or None
        What the latest detection had to make good of the rectification: rows by which a side of
        the right image is off, and how far a lens moves pixels, mean over the image.
    """

    pair_rate_hz: float
    detection_rate_hz: float
    detected: int
    dropped: int
    lost: int
    bad: dict[str, int]
    latency_p50_ms: float | None
    latency_p95_ms: float | None
    valid_share: float | None
    obstacle_share: float | None
    rows_off_px: float | None
    lens_bend_px: float | None

    @property
    def bad_frames(self) -> int:
        """Frames that could not be used."""
        return sum(self.bad.values())


class NodeStatistics:
    """Counters that callbacks and worker write and the diagnostics read.

    Parameters
    ----------
    clock : callable, optional
        Seconds of a clock that never jumps.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._pairs = _Rate()
        self._detections = _Rate()
        self._detected = 0
        self._dropped = 0
        self._lost = 0
        self._bad: Counter[str] = Counter()
        self._latencies_s: deque[float] = deque(maxlen=LATEST)
        self._shares: tuple[float, float] | None = None
        self._off_px: tuple[float, float] | None = None

    def pair(self) -> None:
        """Count a pair that arrived."""
        with self._lock:
            self._pairs.add(self._clock())

    def drop(self) -> None:
        """Count a pair that was thrown away unseen."""
        with self._lock:
            self._dropped += 1

    def lost(self, count: int) -> None:
        """Count images that the transport lost."""
        with self._lock:
            self._lost += count

    def bad_frame(self, reason: str) -> None:
        """Count a frame that could not be used, under a few words that say why."""
        with self._lock:
            self._bad[reason] += 1

    def detection(
        self,
        latency_s: float,
        valid_share: float,
        obstacle_share: float,
        rows_off_px: float = 0.0,
        lens_bend_px: float = 0.0,
    ) -> None:
        """Count a detection that was published."""
        with self._lock:
            self._detected += 1
            self._detections.add(self._clock())
            self._latencies_s.append(latency_s)
            self._shares = valid_share, obstacle_share
            self._off_px = rows_off_px, lens_bend_px

    def snapshot(self) -> Snapshot:
        """Read all counters at once."""
        with self._lock:
            now_s = self._clock()
            p50, p95 = (
                np.percentile(self._latencies_s, (50, 95)) * 1000
                if self._latencies_s
                else (None, None)
            )
            valid, obstacle = self._shares or (None, None)
            rows_off_px, lens_bend_px = self._off_px or (None, None)
            return Snapshot(
                pair_rate_hz=self._pairs.per_second(now_s),
                detection_rate_hz=self._detections.per_second(now_s),
                detected=self._detected,
                dropped=self._dropped,
                lost=self._lost,
                bad=dict(self._bad),
                latency_p50_ms=None if p50 is None else float(p50),
                latency_p95_ms=None if p95 is None else float(p95),
                valid_share=valid,
                obstacle_share=obstacle,
                rows_off_px=rows_off_px,
                lens_bend_px=lens_bend_px,
            )


class _Rate:
    """Events per second of the last `RATE_WINDOW_S`."""

    def __init__(self) -> None:
        self._times_s: deque[float] = deque()

    def add(self, now_s: float) -> None:
        self._times_s.append(now_s)
        self._forget(now_s)

    def per_second(self, now_s: float) -> float:
        self._forget(now_s)
        if len(self._times_s) < 2:
            return 0.0
        # Between events, so that a steady 5 Hz reads 5.0; a stream that has stopped fades out.
        mean_s = (self._times_s[-1] - self._times_s[0]) / (len(self._times_s) - 1)
        return 1.0 / max(mean_s, now_s - self._times_s[-1], 1e-9)

    def _forget(self, now_s: float) -> None:
        while self._times_s and now_s - self._times_s[0] > RATE_WINDOW_S:
            self._times_s.popleft()
