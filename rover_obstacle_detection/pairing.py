"""Pair left and right images by their stamps, for the live node and for recordings."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from statistics import median
from typing import Any, NamedTuple

# Exact stamps may arrive this much out of order; more means that the stream has restarted.
RESTART_NS = 1_000_000_000

# The next stamp may come after half the smallest spacing so far. A gap of at most a quarter of
# that spacing is then the smallest possible.
_CERTAIN_SPACING_FRACTION = 4

# Images of each camera, or pairs, that count as recent.
RECENT = 20
# A rover that turns by 20 deg/s moves the view by a degree in this time.
SAME_MOMENT_NS = 50_000_000


@dataclass(frozen=True)
class Pair:
    """A left and a right image taken at the same time.

    Parameters
    ----------
    stamp_ns : int
        Stamp of the left image.
    left, right
        The items passed with the stamps.
    gap_ns : int
        Absolute difference of the two stamps.
    """

    stamp_ns: int
    left: Any
    right: Any
    gap_ns: int


@dataclass(frozen=True)
class PairingStatistics:
    """Counts of images: ``left = pairs + unmatched_left + pending_left``, and so on the right.

    ``smallest_gap_ns`` is the smallest difference seen between a left and a right stamp, matched
    or not. It is None until both sides have received an image. ``recent_gap_ns`` is that of the
    latest 20 images of each side. ``spacing_ns`` is the median time between the latest 20 images
    of the faster side. ``pair_gap_ns`` is the largest stamp difference within the latest 20 pairs.
    """

    left: int
    right: int
    pairs: int
    unmatched_left: int
    unmatched_right: int
    pending_left: int
    pending_right: int
    smallest_gap_ns: int | None
    recent_gap_ns: int | None = None
    spacing_ns: int | None = None
    pair_gap_ns: int | None = None


def shows_one_moment(gap_ns: int, spacing_ns: int | None) -> bool:
    """Return whether two images may be of one exposure although their stamps differ.

    Parameters
    ----------
    gap_ns : int
        Difference of the stamps.
    spacing_ns : int or None
        Time between two images of one camera, if known. Cameras that run freely have gaps of up to
        half of it.
    """
    return gap_ns <= SAME_MOMENT_NS and (spacing_ns is None or 4 * gap_ns <= spacing_ns)


class _Image(NamedTuple):
    stamp_ns: int
    item: Any


class _Side:
    """The waiting images of one camera, oldest first, and its counts."""

    def __init__(self) -> None:
        self.waiting: deque[_Image] = deque()
        self.received = 0
        self.unmatched = 0
        self.newest_ns: int | None = None
        self.smallest_spacing_ns: int | None = None
        self.spacings_ns: deque[int] = deque(maxlen=RECENT)

    def append(self, image: _Image) -> None:
        if self.newest_ns is not None and image.stamp_ns > self.newest_ns:
            spacing_ns = image.stamp_ns - self.newest_ns
            self.smallest_spacing_ns = min(spacing_ns, self.smallest_spacing_ns or spacing_ns)
            self.spacings_ns.append(spacing_ns)
        self.newest_ns = image.stamp_ns
        self.received += 1
        self.waiting.append(image)

    def drop_oldest(self) -> None:
        self.waiting.popleft()
        self.unmatched += 1

    def drop_all(self) -> None:
        self.unmatched += len(self.waiting)
        self.waiting.clear()

    def drop_after(self, stamp_ns: int) -> None:
        kept = [image for image in self.waiting if image.stamp_ns <= stamp_ns]
        self.unmatched += len(self.waiting) - len(kept)
        self.waiting = deque(kept)

    def take(self, image: _Image) -> None:
        """Remove an image; older ones can no longer be paired and count as unmatched."""
        while self.waiting[0] is not image:
            self.drop_oldest()
        self.waiting.popleft()


class StereoPairing:
    """Pairs images as they arrive; every image is paired once or counted as unmatched.

    Without a tolerance, an image is paired as soon as its partner with the same stamp arrives.

    With a tolerance, each image is paired with its nearest partner within it, in stamp order. A
    pair is held until the next image of the earlier side if that image could be nearer. Without
    this, a lost image would leave the two streams one frame apart. No wait is needed for gaps of
    at most a quarter of that side's smallest spacing so far.

    The result depends only on the stamps, not on how the two streams interleave, provided that

    - stamps increase on each side,
    - neither side is more than ``queue_size`` images ahead,
    - with a tolerance, no spacing is less than half the smallest one before.

    Not thread-safe.

    Parameters
    ----------
    tolerance_ns : int, optional
        Largest stamp difference of a pair; None requires equal stamps.
    queue_size : int
        Images that may wait on each side.

    Raises
    ------
    ValueError
        If a parameter is out of range.
    """

    def __init__(self, tolerance_ns: int | None = None, queue_size: int = 5) -> None:
        if queue_size < 1 or (tolerance_ns is not None and tolerance_ns < 0):
            raise ValueError(
                f'queue_size {queue_size} or tolerance_ns {tolerance_ns} is too small'
            )
        self.tolerance_ns = tolerance_ns
        self.queue_size = queue_size
        self._left = _Side()
        self._right = _Side()
        self._ready: deque[Pair] = deque()
        self._pairs = 0
        self._smallest_gap_ns: int | None = None
        self._gaps_ns: deque[int] = deque(maxlen=2 * RECENT)
        self._pair_gaps_ns: deque[int] = deque(maxlen=RECENT)

    def add_left(self, stamp_ns: int, item: Any) -> Pair | None:
        """Add a left image; return the next pair if one is complete."""
        return self._add(self._left, self._right, _Image(stamp_ns, item))

    def add_right(self, stamp_ns: int, item: Any) -> Pair | None:
        """Add a right image; return the next pair if one is complete."""
        return self._add(self._right, self._left, _Image(stamp_ns, item))

    def flush(self) -> list[Pair]:
        """Return the pairs still held and count the remaining images as unmatched."""
        if self.tolerance_ns is not None:
            self._match_nearest(self.tolerance_ns, ended=True)
        pairs = list(self._ready)
        self._ready.clear()
        self._left.drop_all()
        self._right.drop_all()
        return pairs

    @property
    def statistics(self) -> PairingStatistics:
        """The counts so far."""
        spacings_ns = [
            int(median(side.spacings_ns)) for side in (self._left, self._right) if side.spacings_ns
        ]
        return PairingStatistics(
            left=self._left.received,
            right=self._right.received,
            pairs=self._pairs,
            unmatched_left=self._left.unmatched,
            unmatched_right=self._right.unmatched,
            pending_left=len(self._left.waiting),
            pending_right=len(self._right.waiting),
            smallest_gap_ns=self._smallest_gap_ns,
            recent_gap_ns=min(self._gaps_ns, default=None),
            spacing_ns=min(spacings_ns, default=None),
            pair_gap_ns=max(self._pair_gaps_ns, default=None),
        )

    def _add(self, own: _Side, other: _Side, image: _Image) -> Pair | None:
        self._restart_if_back(own, other, image.stamp_ns)
        self._note_gap(other, image.stamp_ns)
        own.append(image)
        if self.tolerance_ns is None:
            self._match_equal(image, other)
        else:
            self._match_nearest(self.tolerance_ns)
        for side in (own, other):
            while len(side.waiting) > self.queue_size:
                side.drop_oldest()
        return self._ready.popleft() if self._ready else None

    def _restart_if_back(self, own: _Side, other: _Side, stamp_ns: int) -> None:
        # Nearest matching needs ordered stamps; exact matching does not.
        allowed_ns = RESTART_NS if self.tolerance_ns is None else 0
        if own.newest_ns is None or stamp_ns >= own.newest_ns - allowed_ns:
            return
        own.drop_all()
        own.smallest_spacing_ns = None
        # The other side may have restarted first: keep its images from after the restart.
        other.drop_after(stamp_ns + RESTART_NS)

    def _note_gap(self, other: _Side, stamp_ns: int) -> None:
        stamps = [*(image.stamp_ns for image in other.waiting), other.newest_ns]
        gaps_ns = [abs(stamp_ns - each) for each in stamps if each is not None]
        if not gaps_ns:
            return
        self._gaps_ns.append(min(gaps_ns))
        if self._smallest_gap_ns is not None:
            gaps_ns.append(self._smallest_gap_ns)
        self._smallest_gap_ns = min(gaps_ns)

    def _match_equal(self, image: _Image, other: _Side) -> None:
        for candidate in other.waiting:
            if candidate.stamp_ns == image.stamp_ns:
                is_left = other is self._right
                self._emit(*((image, candidate) if is_left else (candidate, image)))
                return

    def _match_nearest(self, tolerance_ns: int, *, ended: bool = False) -> None:
        while self._left.waiting and self._right.waiting:
            left, right = self._left.waiting[0], self._right.waiting[0]
            early, late = self._left, self._right
            if right.stamp_ns < left.stamp_ns:
                early, late = late, early
            late_ns = late.waiting[0].stamp_ns
            gap_ns = abs(left.stamp_ns - right.stamp_ns)
            if gap_ns > tolerance_ns:
                early.drop_oldest()
            elif len(early.waiting) > 1:
                if abs(early.waiting[1].stamp_ns - late_ns) < gap_ns:
                    early.drop_oldest()
                else:
                    self._emit(left, right)
            elif ended or self._is_nearest(early, late, gap_ns):
                self._emit(left, right)
            else:
                return

    def _is_nearest(self, early: _Side, late: _Side, gap_ns: int) -> bool:
        """Whether the next image of the early side cannot be nearer, or must not be awaited."""
        if gap_ns == 0 or len(late.waiting) > self.queue_size:
            return True
        spacing_ns = early.smallest_spacing_ns
        return spacing_ns is not None and _CERTAIN_SPACING_FRACTION * gap_ns <= spacing_ns

    def _emit(self, left: _Image, right: _Image) -> None:
        self._left.take(left)
        self._right.take(right)
        self._pairs += 1
        gap_ns = abs(left.stamp_ns - right.stamp_ns)
        self._pair_gaps_ns.append(gap_ns)
        self._ready.append(Pair(left.stamp_ns, left.item, right.item, gap_ns))
