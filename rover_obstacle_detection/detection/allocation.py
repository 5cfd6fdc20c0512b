"""Memory that frames share one after the other."""

from __future__ import annotations

import numpy as np

_BYTES = 31 << 20
"""Just below the largest block to which 64-bit glibc adapts, 32 MB."""


def keep_freed_memory() -> None:
    """Let the C library keep freed memory, tens of megabytes, for the next frame.

    Every frame needs the same arrays. By default, glibc gives the larger ones back to the system,
    which has to clear thousands of new pages for each frame.

    Notes
    -----
    When a mapped block is freed, glibc raises the size from which it maps blocks to that of the
    block, and the free memory that it keeps to twice as much (``M_MMAP_THRESHOLD`` in mallopt(3)).
    The block is not touched, so it takes no memory. This holds for the whole process. It has no
    effect where a threshold is set, as in the node or by ``MALLOC_TRIM_THRESHOLD_``, nor in other
    C libraries.
    """
    np.empty(_BYTES, np.uint8)
