"""What the C library does with freed memory."""

from __future__ import annotations

import ctypes
import os

# Options of mallopt, from malloc.h of glibc.
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -3, -8
# Larger arrays are mapped one by one, and returned when they are freed. At 640 x 480, where most
# images are judged, those are the ones of 8 bytes a pixel; at 1024 x 768, of 4. To map the many of
# 4 bytes at 640 x 480 as well takes a tenth more CPU.
LARGE_BYTES = 2 << 20
# Free memory that is kept: what is returned has to be cleared again before its next use.
KEPT_BYTES = 16 << 20

# Option and value by the variable with which a user sets it.
SETTINGS = {
    'MALLOC_ARENA_MAX': (M_ARENA_MAX, 1),
    'MALLOC_MMAP_THRESHOLD_': (M_MMAP_THRESHOLD, LARGE_BYTES),
    'MALLOC_TRIM_THRESHOLD_': (M_TRIM_THRESHOLD, KEPT_BYTES),
}


def return_freed_memory() -> bool:
    """Have glibc return freed images to the system; call it before other threads start.

    By default, each thread has memory of its own, and freed arrays of up to 32 MB are kept. Small
    objects between them prevent both their return and their reuse for larger ones. What a
    variable such as ``MALLOC_ARENA_MAX`` sets stays as it is.

    Returns
    -------
    bool
        False if this is another C library, which is left alone.
    """
    mallopt = getattr(ctypes.CDLL(None), 'mallopt', None)
    unset = [each for variable, each in SETTINGS.items() if variable not in os.environ]
    return mallopt is not None and all(mallopt(*each) == 1 for each in unset)
