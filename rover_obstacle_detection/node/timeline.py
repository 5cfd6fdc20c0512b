"""Convert between recorded time and playback time."""

from __future__ import annotations

from dataclasses import dataclass

MIN_ROUND_S = 0.1


@dataclass(frozen=True)
class Timeline:
    """Recorded time as a function of the time elapsed since playback started.

    Parameters
    ----------
    start_ns : int
        Recorded time at which playback starts.
    rate : float
        Recorded seconds per second of playback.
    clock_hz : float, optional
        Messages on /clock per second of playback; 0 for none.
    """

    start_ns: int
    rate: float = 1.0
    clock_hz: float = 0.0

    def due_s(self, recorded_ns: int) -> float:
        """Return when to publish a message (s after the start)."""
        return (recorded_ns - self.start_ns) / 1e9 / self.rate

    def round_s(self, end_ns: int) -> float:
        """Return how long a round up to ``end_ns`` takes in a loop: `MIN_ROUND_S` or more.

        A recording of one pair would be repeated without a pause.
        """
        return max(self.due_s(end_ns), MIN_ROUND_S)

    def recorded_ns(self, elapsed_s: float) -> int:
        """Return the recorded time after ``elapsed_s`` of playback."""
        return self.start_ns + round(elapsed_s * self.rate * 1e9)

    def tick_s(self, number: int) -> float:
        """Return when to publish a message on /clock (s after the start); infinity for none."""
        return number / self.clock_hz if self.clock_hz else float('inf')
