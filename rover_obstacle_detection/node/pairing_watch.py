"""Detect that images arrive but never match."""

from __future__ import annotations

from rover_obstacle_detection.pairing import PairingStatistics, shows_one_moment

PATIENCE_S = 3.0


class PairingWatch:
    """Compares the pairing counts over time and reports images without a pair.

    Parameters
    ----------
    patience_s : float, optional
        Time without a pair that is still normal while images arrive (s).
    """

    def __init__(self, patience_s: float = PATIENCE_S) -> None:
        self._patience_s = patience_s
        self._base: PairingStatistics | None = None
        self._last: PairingStatistics | None = None
        self._since_s: float | None = None

    def check(self, counts: PairingStatistics, now_s: float) -> str:
        """Compare the counts with those of the previous call.

        Parameters
        ----------
        counts : PairingStatistics
        now_s : float
            Time of a monotonic clock (s).

        Returns
        -------
        str
            What arrived without matching and a possible remedy. Empty if pairs arrive, or if no
            images do.
        """
        base, last, self._last = self._base, self._last, counts
        if base is None or counts.pairs != base.pairs or counts.left < base.left:
            self._base, self._since_s = counts, None
            return ''
        if last is None or (counts.left, counts.right) == (last.left, last.right):
            return ''
        if self._since_s is None:
            self._since_s = now_s
        if now_s - self._since_s < self._patience_s:
            return ''
        return _describe(counts, base)


def _describe(counts: PairingStatistics, base: PairingStatistics) -> str:
    left, right = counts.left - base.left, counts.right - base.right
    line = f'{left} left, {right} right, 0 pairs'
    if not left or not right:
        return f'{line}: no images from the {"right" if left else "left"} camera'
    gap_ns = counts.recent_gap_ns
    if gap_ns is None:
        return line
    line += f', smallest gap {gap_ns / 1e6:.1f} ms'
    if shows_one_moment(gap_ns, counts.spacing_ns):
        return (
            f'{line}; try approximate_sync with a large enough approximate_sync_tolerance_seconds'
        )
    return f'{line}: the images show different moments; synchronise the cameras'
