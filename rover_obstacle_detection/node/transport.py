"""Select the Fast DDS profile: the shipped one, unless the user configured a transport."""

from __future__ import annotations

import os
import xml.etree.ElementTree
from collections.abc import MutableMapping
from pathlib import Path

PROFILE = Path(__file__).with_name('fastdds_profile.xml')
PROFILE_VARIABLES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')
# Without a variable, Fast DDS loads a file of this name from the working directory.
IMPLICIT_PROFILES = ('DEFAULT_FASTRTPS_PROFILES.xml', 'DEFAULT_FASTDDS_PROFILES.xml')
FAST_DDS = 'rmw_fastrtps_cpp'
SHARED_MEMORY = Path('/dev/shm')
# Measured: a participant takes this many times the size of its segment.
SEGMENT_OVERHEAD = 1.06


def use_large_message_profile(
    environment: MutableMapping[str, str] | None = None,
    *,
    folder: Path | None = None,
    shared_memory: Path = SHARED_MEMORY,
) -> str | None:
    """Select the shipped Fast DDS profile; call it before rclpy is loaded.

    Nothing changes if the user chose another middleware, profile or transport, or if there is
    too little shared memory.

    Parameters
    ----------
    environment : mutable mapping, optional
        Default: ``os.environ``.
    folder : Path, optional
        Where Fast DDS looks for a profile. Default: the working directory.
    shared_memory : Path, optional
        Mount point of shared memory.

    Returns
    -------
    str or None
        A warning if large messages may be lost.
    """
    environment = os.environ if environment is None else environment
    if environment.get('RMW_IMPLEMENTATION', FAST_DDS) not in (FAST_DDS, ''):
        return None
    if any(environment.get(name) for name in PROFILE_VARIABLES):
        return None
    if environment.get('FASTDDS_BUILTIN_TRANSPORTS'):
        return None
    if any(((folder or Path.cwd()) / name).exists() for name in IMPLICIT_PROFILES):
        return None
    needed = int(segment_size() * SEGMENT_OVERHEAD)
    free = _free_bytes(shared_memory)
    if free < needed:
        return (
            f'{shared_memory} has {free / 1e6:.0f} MB free, but the shipped Fast DDS profile '
            f'needs {needed / 1e6:.0f} MB per process and is not used: large images and clouds '
            'may be lost (in a container, set --shm-size 1g)'
        )
    for name in PROFILE_VARIABLES:
        environment[name] = str(PROFILE)
    return None


def segment_size() -> int:
    """Return the size of the shipped profile's shared-memory segment (bytes)."""
    root = xml.etree.ElementTree.parse(PROFILE).getroot()
    return int(next(each.text or '0' for each in root.iter() if each.tag.endswith('segment_size')))


def _free_bytes(folder: Path) -> int:
    try:
        status = os.statvfs(folder)
    except OSError:
        return 0
    return status.f_bavail * status.f_frsize
