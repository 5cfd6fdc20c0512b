"""Detect a camera that delivers the same image again and again with new stamps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

SIDES = ('left', 'right')
# Bytes compared first. They differ in almost every pair of a live camera, because of its noise.
SAMPLE_BYTES = 1024


class FrozenImages:
    """Counts the pairs in a row in which a camera's image repeats the previous one.

    Parameters
    ----------
    limit : int
        Repetitions after which an image counts as frozen.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._cameras = [_Camera() for _ in SIDES]
        self._stamp_ns: int | None = None

    def check(self, images: Sequence[Any], stamp_ns: int) -> str:
        """Take the next pair.

        Parameters
        ----------
        images : sequence of bytes-like
            Data of the left and of the right image message, kept until the image changes.
        stamp_ns : int
            A pair with the stamp of the previous one is ignored. A lower stamp restarts the count.

        Returns
        -------
        str
            Which image has not changed, and for how long; empty if both change.

        Notes
        -----
        An image of a single grey level has no noise that could change. It is left to the detector,
        which names dark and over-exposed images.
        """
        if self._stamp_ns is not None and stamp_ns < self._stamp_ns:
            self._cameras = [_Camera() for _ in SIDES]
        if stamp_ns != self._stamp_ns:
            for camera, data in zip(self._cameras, images, strict=True):
                camera.take(np.frombuffer(data, np.uint8), stamp_ns)
        self._stamp_ns = stamp_ns
        frozen = {
            side: camera
            for side, camera in zip(SIDES, self._cameras, strict=True)
            if camera.repeats >= self._limit and not camera.is_uniform
        }
        if not frozen:
            return ''
        latest = min(frozen.values(), key=lambda camera: camera.repeats)
        lasting_s = (stamp_ns - latest.since_ns) / 1e9
        which = f'{" and ".join(frozen)} {"image has" if len(frozen) == 1 else "images have"}'
        return (
            f'{which} not changed for {latest.repeats} frames ({lasting_s:.1f} s): '
            'the camera or its driver is frozen'
        )


class _Camera:
    """The latest image of one camera, and how often it was repeated."""

    def __init__(self) -> None:
        self.repeats = 0
        self.since_ns = 0
        self._pixels: NDArray[np.uint8] | None = None

    @property
    def is_uniform(self) -> bool:
        pixels = self._pixels
        return pixels is None or not pixels.size or bool(pixels.min() == pixels.max())

    def take(self, pixels: NDArray[np.uint8], stamp_ns: int) -> None:
        if self._pixels is not None and _equal(pixels, self._pixels):
            self.repeats += 1
        else:
            self.repeats, self.since_ns = 0, stamp_ns
        self._pixels = pixels


def _equal(one: NDArray[np.uint8], other: NDArray[np.uint8]) -> bool:
    # An odd step, so that the sample does not follow columns or colour channels.
    step = one.size // SAMPLE_BYTES | 1
    return np.array_equal(one[::step], other[::step]) and np.array_equal(one, other)
