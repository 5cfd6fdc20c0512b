"""What the C library does with freed memory."""

from __future__ import annotations

import ctypes

# Options of mallopt, from malloc.h of glibc.
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -3, -8
# Most images of a detection are larger; larger ones are mapped one by one.
LARGE_BYTES = 1 << 20
# Free memory that is kept: what is returned has to be cleared again before its next use.
KEPT_BYTES = 16 << 20

SETTINGS = {
    M_ARENA_MAX: 1,
    M_MMAP_THRESHOLD: LARGE_BYTES,
    M_TRIM_THRESHOLD: KEPT_BYTES,
}


def return_freed_memory() -> bool:
    """Have glibc return freed images to the system; call it before other threads start.

    By default, each thread has memory of its own, and freed arrays of up to 32 MB are kept. Small
    objects between them prevent both their return and their reuse for larger ones.

    Returns
    -------
    bool
        False if this is another C library, which is left alone.
    """
    mallopt = getattr(ctypes.CDLL(None), 'mallopt', None)
    return mallopt is not None and all(mallopt(*each) == 1 for each in SETTINGS.items())
