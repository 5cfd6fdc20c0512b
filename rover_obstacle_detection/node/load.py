"""What became of the images and pairs of the last seconds."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

WINDOW_S = 10.0


@dataclass(frozen=True)
class Load:
    """Counts of the last 10 s, or since the first image if that was later.

    Parameters
    ----------
    seconds : float
        The time that the counts cover.
    images, lost : int
        Images that arrived, and images lost on the way.
    pairs, dropped, ended : int
        Pairs that arrived, that were dropped unprocessed, and whose detection ended.
    latency_p95_s : float or None
        Of the detections published in that time; None if there is none.
    """

    seconds: float = WINDOW_S
    images: int = 0
    lost: int = 0
    pairs: int = 0
    dropped: int = 0
    ended: int = 0
    latency_p95_s: float | None = None


class RecentLoad:
    """Adds up events of the last 10 s; not thread-safe."""

    def __init__(self) -> None:
        self._events: deque[tuple[float, str, int]] = deque()
        self._latencies_s: deque[tuple[float, float]] = deque()

    def add(self, kind: str, now_s: float, count: int = 1) -> None:
        """Add events of a kind, the name of a count of `Load`."""
        self._events.append((now_s, kind, count))
        self._expire(now_s)

    def add_latency(self, latency_s: float, now_s: float) -> None:
        """Add the latency of a published detection."""
        self._latencies_s.append((now_s, latency_s))

    def clear(self) -> None:
        """Forget all events."""
        self._events.clear()
        self._latencies_s.clear()

    def sum(self, now_s: float) -> Load:
        """Return the counts at a time (s)."""
        self._expire(now_s)
        counts = dict.fromkeys(('images', 'lost', 'pairs', 'dropped', 'ended'), 0)
        for _, kind, count in self._events:
            counts[kind] += count
        latencies_s = [latency_s for _, latency_s in self._latencies_s]
        return Load(
            seconds=max(now_s - self._events[0][0], 1.0) if self._events else WINDOW_S,
            latency_p95_s=float(np.percentile(latencies_s, 95)) if latencies_s else None,
            **counts,
        )

    def _expire(self, now_s: float) -> None:
        for kept in (self._events, self._latencies_s):
            while kept and now_s - kept[0][0] > WINDOW_S:
                kept.popleft()
