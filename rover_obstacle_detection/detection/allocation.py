"""Memory that frames share one after the other."""

from __future__ import annotations

import numpy as np

_BYTES = 31 << 20
"""Largest block, less what surrounds it, to which glibc adapts: see `keep_freed_memory`."""


def keep_freed_memory() -> None:
    """Let the C library keep up to 62 MB of freed memory for the next frame.

    Every frame needs the same arrays. By default, glibc gives the larger ones back to the system,
    which has to clear thousands of new pages for each frame.

    Notes
    -----
    Freeing a block raises the size from which glibc maps blocks of their own to that of the block,
    and the freed memory that it keeps to twice as much (``M_MMAP_THRESHOLD`` in mallopt(3)). The
    block is not touched, so it takes no memory. Other libraries are not affected.
    """
    np.empty(_BYTES, np.uint8)
