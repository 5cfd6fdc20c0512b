"""Measure the time of each stage from the detector's ``on_stage`` calls."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np


class Stopwatch:
    """Measures the stages of one frame after another.

    Pass ``on_stage=stopwatch.lap`` to `Detector.detect`, which calls it at the end of each stage.
    Stages of the same name within a frame add up.

    Parameters
    ----------
    clock_ns : callable, optional
        A monotonic clock in nanoseconds.
    """

    def __init__(self, clock_ns: Callable[[], int] = time.perf_counter_ns) -> None:
        self._clock_ns = clock_ns
        self._laps_ns: dict[str, int] = {}
        self._last_ns = clock_ns()

    def lap(self, stage: str) -> None:
        """End a stage that began at the previous call."""
        now_ns = self._clock_ns()
        self._laps_ns[stage] = self._laps_ns.get(stage, 0) + now_ns - self._last_ns
        self._last_ns = now_ns

    def take_ms(self) -> dict[str, float]:
        """Return the milliseconds of each stage in order and start the next frame."""
        taken = {stage: lap_ns / 1e6 for stage, lap_ns in self._laps_ns.items()}
        self._laps_ns = {}
        self._last_ns = self._clock_ns()
        return taken


@dataclass(frozen=True)
class StageTime:
    """Time of one stage over the frames that include it."""

    mean_ms: float
    median_ms: float
    p95_ms: float
    max_ms: float

    @classmethod
    def of(cls, laps_ms: Sequence[float]) -> StageTime:
        """Summarise one or more times in milliseconds."""
        return cls(
            mean_ms=float(np.mean(laps_ms)),
            median_ms=float(np.median(laps_ms)),
            p95_ms=float(np.percentile(laps_ms, 95)),
            max_ms=float(np.max(laps_ms)),
        )


def stage_times(frames: Iterable[Mapping[str, float]]) -> dict[str, StageTime]:
    """Summarise each stage over all frames, in order of first occurrence."""
    by_stage: dict[str, list[float]] = {}
    for frame in frames:
        for stage, lap_ms in frame.items():
            by_stage.setdefault(stage, []).append(lap_ms)
    return {stage: StageTime.of(laps_ms) for stage, laps_ms in by_stage.items()}
