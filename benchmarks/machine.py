"""The machine, in words."""

from __future__ import annotations

import os
import platform
import re
from importlib import metadata
from pathlib import Path

import cv2
import numpy as np

GIGA = 1 << 30


def use_cores(count: int) -> None:
    """Keep this process and those that it starts to a number of cores."""
    cores = sorted(os.sched_getaffinity(0))[:count]
    os.sched_setaffinity(0, cores)
    cv2.setNumThreads(len(cores))


def described_machine() -> str:
    """Describe processor, memory and libraries, and what else the machine was doing."""
    found = re.search(r'^model name\s*:\s*(.+)$', Path('/proc/cpuinfo').read_text(), re.M)
    processor = ' '.join(found[1].split()) if found else platform.machine()
    memory = os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / GIGA
    return (
        f'{processor}, {len(os.sched_getaffinity(0))} of {os.cpu_count()} cores used, '
        f'{memory:.0f} GB; {platform.system()} {kernel()}; '
        f'Python {platform.python_version()}, NumPy {np.__version__}, '
        f'OpenCV {cv2.__version__} with {cv2.getNumThreads()} threads, {onnx_runtime()}, {ros()}; '
        f'load average {os.getloadavg()[0]:.1f} at the start'
    )


def kernel() -> str:
    """Return the version of the kernel without what a distributor adds to it."""
    return platform.release().partition('-')[0]


def onnx_runtime() -> str:
    """Return the version of ONNX Runtime."""
    try:
        return f'ONNX Runtime {metadata.version("onnxruntime")}'
    except metadata.PackageNotFoundError:
        return 'no ONNX Runtime'


def ros() -> str:
    """Return the version of rclpy."""
    try:
        return f'rclpy {metadata.version("rclpy")}'
    except metadata.PackageNotFoundError:
        return f'ROS {os.environ.get("ROS_DISTRO", "not installed")}'
