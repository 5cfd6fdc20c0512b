"""Notices images that come and never match."""

from __future__ import annotations

from rover_obstacle_detection.pairing import PairingStatistics

PATIENCE_S = 3.0


class PairingWatch:
    """Looks at the pairing's counts now and then; says when images come without a pair.

    Parameters
    ----------
    patience_s : float, optional
        Time without a pair, though images come, that is still normal.
    """

    def __init__(self, patience_s: float = PATIENCE_S) -> None:
        self._patience_s = patience_s
        self._base: PairingStatistics | None = None
        self._last: PairingStatistics | None = None
        self._since_s: float | None = None

    def look(self, counts: PairingStatistics, now_s: float) -> str:
        """Compare with the last look.

        Parameters
        ----------
        counts : PairingStatistics
        now_s : float
            Seconds of a clock that never jumps.

        Returns
        -------
        str
            What came and did not match, and what may help; empty if all is well, or if no images
            came since the last look.
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
        return f'{line}: nothing comes from the {"right" if left else "left"} eye'
    if counts.smallest_gap_ns is None:
        return line
    return (
        f'{line}, smallest gap {counts.smallest_gap_ns / 1e6:.1f} ms; try approximate_sync '
        'with a large enough approximate_sync_tolerance_seconds'
    )
