"""When each message of a recording is due, and what time the recording has then."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Timeline:
    """Recorded time against time that passes.

    Parameters
    ----------
    start_ns : int
        Recorded time at which the round starts.
    rate : float
        Recorded seconds a second.
    clock_hz : float, optional
        Ticks of /clock a second of time that passes; 0 for none.
    """

    start_ns: int
    rate: float = 1.0
    clock_hz: float = 0.0

    def due_s(self, recorded_ns: int) -> float:
        """Return the seconds after the start at which a message is due."""
        return (recorded_ns - self.start_ns) / 1e9 / self.rate

    def recorded_ns(self, elapsed_s: float) -> int:
        """Return the recorded time after a span of time that has passed."""
        return self.start_ns + round(elapsed_s * self.rate * 1e9)

    def tick_s(self, number: int) -> float:
        """Return the seconds after the start of a tick of /clock; infinity without clock."""
        return number / self.clock_hz if self.clock_hz else float('inf')
