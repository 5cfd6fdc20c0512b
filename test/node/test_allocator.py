"""The setting is one of the whole process, so that each test runs in a process of its own."""

from __future__ import annotations

import os
import platform
import subprocess
import sys

import pytest

# Frees a few large arrays out of many, so that small ones stay between them.
FREE = """
import re, sys
from pathlib import Path
import numpy as np
from rover_obstacle_detection.node.allocator import return_freed_memory

if sys.argv[1] == 'set':
    assert return_freed_memory()

def resident_mb():
    found = re.search(r'VmRSS:\\s+(\\d+)', Path('/proc/self/status').read_text())
    return int(found[1]) / 1024

del (first := [np.ones(30 << 20, np.uint8)])[0]
before = resident_mb()
large, small = [], []
for _ in range(11):
    large.append(np.ones(6 << 20, np.uint8))
    small.append(np.ones(64 << 10, np.uint8))
large.clear()
print(resident_mb() - before)
"""


def kept_mb(mode: str, **variables: str) -> float:
    """Memory that a process keeps after it freed 66 MB."""
    done = subprocess.run(
        [sys.executable, '-c', FREE, mode],
        check=True,
        capture_output=True,
        text=True,
        env={**os.environ, **variables},
    )
    return float(done.stdout)


@pytest.mark.skipif(platform.libc_ver()[0] != 'glibc', reason='a setting of glibc')
def test_freed_images_are_returned() -> None:
    assert kept_mb('default') > 40
    assert kept_mb('set') < 20


@pytest.mark.skipif(platform.libc_ver()[0] != 'glibc', reason='a setting of glibc')
def test_what_the_user_has_set_is_left_alone() -> None:
    assert kept_mb('set', MALLOC_MMAP_THRESHOLD_=str(32 << 20)) > 40
