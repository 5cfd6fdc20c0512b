"""The node's counters: frames received, frames detected, and latencies."""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rover_obstacle_detection.node.load import Load, RecentLoad

RATE_WINDOW_S = 5.0
# Detections over which the latency percentiles are taken.
LATENCY_WINDOW = 100
# A little more than the period of the diagnostics, so that every outcome is reported once.
RECENT_S = 1.2
NO_LOAD = Load()


@dataclass(frozen=True)
class DetectionFigures:
    """Figures of one detection; all None before the first.

    Parameters
    ----------
    valid_share, obstacle_share : float or None
        Share of pixels with a disparity and on obstacles.
    rows_off_px, lens_bend_px : float or None
        Residual rectification error that was corrected: row misalignment, and mean displacement
        by lens distortion (px).
    camera_height_m, camera_pitch_deg : float or None
        Pose of the camera over the visible ground; None if no ground was found.
    """

    valid_share: float | None = None
    obstacle_share: float | None = None
    rows_off_px: float | None = None
    lens_bend_px: float | None = None
    camera_height_m: float | None = None
    camera_pitch_deg: float | None = None


@dataclass(frozen=True)
class Recent:
    """The pairs whose detection ended within `RECENT_S`, or else the latest one.

    Parameters
    ----------
    judged, failed : int
        Pairs with and without a detection.
    problem : str
        Why the latest failed pair has none; empty if none failed.
    warnings : tuple of str
        Warnings of the latest detection that has any.
    """

    judged: int = 0
    failed: int = 0
    problem: str = ''
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Snapshot:
    """The counters at one moment.

    Parameters
    ----------
    pair_rate_hz, detection_rate_hz : float
        Pairs received and detections published per second, over 5 s.
    detected : int
        Detections published.
    dropped : int
        Good pairs replaced by a newer one before the detector was free.
    lost : int
        Images that were published but never reached the node.
    bad : dict of str to int
        Unusable frames by reason.
    latency_p50_ms, latency_p95_ms : float or None
        From the arrival of a pair's second image to the last message published, over the latest
        100 detections; None before the first.
    latest : DetectionFigures
        Figures of the latest detection.
    warned : int
        Detections with warnings.
    recent : Recent
        What became of the latest pairs.
    failing_s : float
        Time since the first pair that failed after the latest detection (s); 0 if none did.
    load : Load
        What became of the images and pairs of the last 10 s.
    """

    pair_rate_hz: float
    detection_rate_hz: float
    detected: int
    dropped: int
    lost: int
    bad: dict[str, int]
    latency_p50_ms: float | None
    latency_p95_ms: float | None
    latest: DetectionFigures
    warned: int = 0
    recent: Recent = Recent()
    failing_s: float = 0.0
    load: Load = NO_LOAD

    @property
    def bad_frames(self) -> int:
        """Unusable frames."""
        return sum(self.bad.values())


class NodeStatistics:
    """Counters that callbacks and worker write and the diagnostics read.

    Parameters
    ----------
    clock : callable, optional
        Monotonic clock (s).
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
        self._latencies_s: deque[float] = deque(maxlen=LATENCY_WINDOW)
        self._latest = DetectionFigures()
        self._warned = 0
        self._outcomes: deque[_Outcome] = deque(maxlen=LATENCY_WINDOW)
        self._failing_since_s: float | None = None
        self._load = RecentLoad()

    def pair(self) -> None:
        """Count a pair that arrived."""
        with self._lock:
            now_s = self._clock()
            self._pairs.add(now_s)
            self._load.add('pairs', now_s)

    def drop(self) -> None:
        """Count a pair that was dropped unprocessed."""
        with self._lock:
            self._dropped += 1
            self._load.add('dropped', self._clock())

    def image(self, lost: int = 0) -> None:
        """Count an image that arrived, and those before it that were lost in transport."""
        with self._lock:
            self._lost += lost
            now_s = self._clock()
            self._load.add('images', now_s)
            self._load.add('lost', now_s, lost)

    def bad_frame(self, reason: str, problem: str = '') -> None:
        """Count an unusable frame under a short reason.

        Parameters
        ----------
        reason : str
        problem : str, optional
            Why there is no detection, in full.
        """
        with self._lock:
            self._bad[reason] += 1
            if problem:
                now_s = self._clock()
                self._end(_Outcome(now_s, problem))
                if self._failing_since_s is None:
                    self._failing_since_s = now_s

    def withheld(self, problem: str) -> None:
        """Count a pair that was not given to the detector, because an image is frozen."""
        with self._lock:
            self._bad['frozen image'] += 1
            self._end(_Outcome(self._clock(), problem))

    def forget_outcomes(self) -> None:
        """Forget what became of earlier pairs; all counts are kept."""
        with self._lock:
            self._outcomes.clear()
            self._load.clear()
            self._failing_since_s = None

    def detection(
        self, latency_s: float, figures: DetectionFigures, warnings: tuple[str, ...] = ()
    ) -> None:
        """Count a published detection."""
        with self._lock:
            self._detected += 1
            self._warned += bool(warnings)
            self._failing_since_s = None
            now_s = self._clock()
            self._end(_Outcome(now_s, warnings=warnings))
            self._detections.add(now_s)
            self._latencies_s.append(latency_s)
            self._load.add_latency(latency_s, now_s)
            self._latest = figures

    def snapshot(self) -> Snapshot:
        """Return all counters."""
        with self._lock:
            now_s = self._clock()
            failing_since_s = self._failing_since_s
            p50_ms = p95_ms = None
            if self._latencies_s:
                p50_ms, p95_ms = (np.percentile(self._latencies_s, (50, 95)) * 1000).tolist()
            return Snapshot(
                pair_rate_hz=self._pairs.per_second(now_s),
                detection_rate_hz=self._detections.per_second(now_s),
                detected=self._detected,
                dropped=self._dropped,
                lost=self._lost,
                bad=dict(self._bad),
                latency_p50_ms=p50_ms,
                latency_p95_ms=p95_ms,
                latest=self._latest,
                warned=self._warned,
                recent=self._recent(now_s),
                failing_s=0.0 if failing_since_s is None else now_s - failing_since_s,
                load=self._load.sum(now_s),
            )

    def _end(self, outcome: _Outcome) -> None:
        self._outcomes.append(outcome)
        self._load.add('ended', outcome.time_s)

    def _recent(self, now_s: float) -> Recent:
        outcomes = [each for each in self._outcomes if now_s - each.time_s <= RECENT_S]
        if not outcomes:
            # Pairs can be further apart than the window.
            outcomes = list(self._outcomes)[-1:]
        problems = [each.problem for each in outcomes if each.problem]
        warnings = [each.warnings for each in outcomes if each.warnings]
        return Recent(
            judged=len(outcomes) - len(problems),
            failed=len(problems),
            problem=problems[-1] if problems else '',
            warnings=warnings[-1] if warnings else (),
        )


@dataclass(frozen=True)
class _Outcome:
    """When a pair's detection ended, and how."""

    time_s: float
    problem: str = ''
    warnings: tuple[str, ...] = ()


class _Rate:
    """Events per second over the last `RATE_WINDOW_S`."""

    def __init__(self) -> None:
        self._times_s: deque[float] = deque()

    def add(self, now_s: float) -> None:
        self._times_s.append(now_s)
        self._expire(now_s)

    def per_second(self, now_s: float) -> float:
        self._expire(now_s)
        if len(self._times_s) < 2:
            return 0.0
        # From the mean interval, so that a steady 5 Hz reads 5.0. The time since the last event
        # makes the rate of a stopped stream fall.
        mean_s = (self._times_s[-1] - self._times_s[0]) / (len(self._times_s) - 1)
        return 1.0 / max(mean_s, now_s - self._times_s[-1], 1e-9)

    def _expire(self, now_s: float) -> None:
        while self._times_s and now_s - self._times_s[0] > RATE_WINDOW_S:
            self._times_s.popleft()
