"""Decide whether what the cameras deliver can be trusted; knows no ROS and no clock."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from rover_obstacle_detection.node.frozen_images import FrozenImages
from rover_obstacle_detection.node.statistics import Snapshot

# Stamps further from the node's clock are of another clock, as in a bag played without /clock.
OTHER_CLOCK_S = 60.0
# Clocks of two machines may differ by this much.
CLOCK_TOLERANCE_S = 1.0
# Simulated time can jump; a longer step between two calls is no time that passed.
MAX_STEP_S = 5.0


@dataclass(frozen=True)
class WatchdogLimits:
    """What is a fault; the parameters of the same names.

    Parameters
    ----------
    frozen_after : int
        Pairs in a row that repeat an image, or the stamp.
    stale_after_s : float
        Time without a pair, or without one that can be judged (s).
    max_image_age_s : float
        Age of an image, by its stamp, when it arrives (s).
    """

    frozen_after: int
    stale_after_s: float
    max_image_age_s: float


@dataclass(frozen=True)
class Faults:
    """What is wrong at one moment; empty texts if nothing is.

    Parameters
    ----------
    input : str
        Fault of the images that arrive, or do not arrive.
    detection : str
        Fault that lasts: no pair can be judged.
    """

    input: str = ''
    detection: str = ''


NO_FAULTS = Faults()


class Watchdog:
    """Watches for frozen, stale, late and unjudgeable pairs; for use in one thread.

    Parameters
    ----------
    limits : WatchdogLimits or None
        None: nothing is a fault.
    on_fault : callable
        Receives the text of a fault, again and again while it lasts.
    on_recovery : callable
        Receives a text once when a fault has ended.
    """

    _now_s: float | None
    _age_s: float | None

    def __init__(
        self,
        limits: WatchdogLimits | None,
        on_fault: Callable[[str], object],
        on_recovery: Callable[[str], object],
    ) -> None:
        self._on_fault = on_fault
        self._on_recovery = on_recovery
        self._limits = limits
        self.stop()

    @property
    def image_age_s(self) -> float | None:
        """Age of the latest pair when it arrived; None if its stamp is of another clock."""
        return self._age_s

    def configure(self, limits: WatchdogLimits | None) -> None:
        """Apply new limits, and start again."""
        self._limits = limits
        if self._now_s is not None:
            self.start(self._now_s)

    def start(self, now_s: float) -> None:
        """Expect pairs from now on."""
        self.stop()
        self._now_s = now_s

    def stop(self) -> None:
        """Expect no pairs, and forget all faults."""
        self._now_s = None
        self._silent_s = 0.0
        self._sides_silent_s = [0.0, 0.0]
        self._stamp_ns = 0
        self._repeats = 0
        self._age_s = None
        self._frozen = FrozenImages(1 if self._limits is None else self._limits.frozen_after)
        self._frozen_text = ''
        self._lasting: set[str] = set()

    def image(self, side: int, now_s: float) -> None:
        """Note an image of the left (0) or right (1) camera, with or without a partner."""
        if self._now_s is not None:
            self._advance(now_s)
            self._sides_silent_s[side] = 0.0

    def take(self, images: Sequence[Any], stamp_ns: int, now_s: float, age_s: float) -> str:
        """Take a pair that arrived.

        Parameters
        ----------
        images : sequence of bytes-like
            Data of the left and of the right image message.
        stamp_ns : int
            Stamp of the left image.
        now_s : float
            Any clock that does not stop while pairs should arrive (s).
        age_s : float
            Node's clock minus stamp (s).

        Returns
        -------
        str
            Why the pair must not be judged; empty if it may be.
        """
        if self._now_s is None:
            self._now_s = now_s
        self._advance(now_s)
        self._silent_s = 0.0
        if stamp_ns < self._stamp_ns:
            self._age_s = None
        self._repeats = self._repeats + 1 if stamp_ns == self._stamp_ns else 0
        self._stamp_ns = stamp_ns
        # Once stamps were seen to be of the node's clock, an image of any age is late.
        if self._age_s is not None or -CLOCK_TOLERANCE_S <= age_s <= OTHER_CLOCK_S:
            self._age_s = age_s
        if self._limits is None:
            return ''
        self._frozen_text = self._frozen.check(images, stamp_ns)
        return self._note(self._frozen_text, 'images change again')

    def check(
        self, now_s: float, counts: Snapshot, topics: Sequence[str] = ('left', 'right')
    ) -> Faults:
        """Look for faults, at least every few seconds.

        Parameters
        ----------
        now_s : float
            The clock of `take` (s).
        counts : Snapshot
        topics : sequence of str, optional
            How to call the left and the right images.
        """
        limits = self._limits
        if limits is None or self._now_s is None:
            return NO_FAULTS
        self._advance(now_s)
        silent = late = lasting = repeated = ''
        if self._repeats >= limits.frozen_after:
            repeated = (
                f'header.stamp of both images has not changed for {self._repeats} pairs: expected '
                'the time of exposure of each image; the camera or its driver repeats it'
            )
        if self._silent_s > limits.stale_after_s:
            silent = self._describe_silence(limits.stale_after_s, topics)
        elif self._age_s is not None and self._age_s > limits.max_image_age_s:
            late = (
                f'stamps are {self._age_s:.1f} s behind the clock of this node: images arrive '
                'late, or the clocks differ'
            )
        if counts.failing_s > limits.stale_after_s and not self._frozen_text:
            lasting = (
                f'no pair could be judged for {counts.failing_s:.1f} s: {counts.recent.problem}'
            )
        self._note(silent, 'pairs arrive again')
        self._note(late, 'images arrive in time again')
        self._note(repeated, 'stamps change again')
        self._note(lasting, 'pairs can be judged again')
        return Faults(silent or self._frozen_text or repeated or late, lasting)

    def _advance(self, now_s: float) -> None:
        assert self._now_s is not None
        step_s = min(max(now_s - self._now_s, 0.0), MAX_STEP_S)
        self._now_s = now_s
        self._silent_s += step_s
        self._sides_silent_s = [each + step_s for each in self._sides_silent_s]

    def _describe_silence(self, limit_s: float, topics: Sequence[str]) -> str:
        silent = {
            topic: seconds
            for topic, seconds in zip(topics, self._sides_silent_s, strict=True)
            if seconds > limit_s
        }
        if not silent:
            return f'no pair for {self._silent_s:.1f} s'
        return f'no images on {" and ".join(silent)} for {min(silent.values()):.1f} s'

    def _note(self, text: str, recovery: str) -> str:
        """Pass a fault or its end on; `recovery` identifies the kind of fault."""
        if text:
            self._lasting.add(recovery)
            self._on_fault(text)
        elif recovery in self._lasting:
            self._lasting.remove(recovery)
            self._on_recovery(recovery)
        return text
