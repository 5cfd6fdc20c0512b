"""Which Fast DDS profile a process of ours uses: the shipped one, unless the user has a choice."""

from __future__ import annotations

import os
import xml.etree.ElementTree
from collections.abc import MutableMapping
from pathlib import Path

PROFILE = Path(__file__).with_name('fastdds_profile.xml')
PROFILE_VARIABLES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')
# A file of this name in the working folder is what Fast DDS takes where no variable is set.
IMPLICIT_PROFILES = ('DEFAULT_FASTRTPS_PROFILES.xml', 'DEFAULT_FASTDDS_PROFILES.xml')
FAST_DDS = 'rmw_fastrtps_cpp'
SHARED_MEMORY = Path('/dev/shm')
# What a participant takes beside its segment, measured: 140 MB in all for 134 MB.
SEGMENT_OVERHEAD = 1.06


def use_large_message_profile(
    environment: MutableMapping[str, str] | None = None,
    *,
    folder: Path | None = None,
    shared_memory: Path = SHARED_MEMORY,
) -> str | None:
    """Set the shipped Fast DDS profile; to be called before rclpy starts.

    Left alone: another middleware, a profile or a choice of transports that the user has set
    (also a profile in the working folder), and a machine without enough shared memory.

    Parameters
    ----------
    environment : mutable mapping, optional
        ``os.environ`` if none is given.
    folder : Path, optional
        Where Fast DDS looks for a profile of its own; the working folder.
    shared_memory : Path, optional
        The file system of shared memory.

    Returns
    -------
    str or None
        A line to warn the user with, where large messages will be lost.
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
            f'{shared_memory} has {free / 1e6:.0f} MB free, the shipped Fast DDS profile takes '
            f'{needed / 1e6:.0f} MB for each process: not used, large images and clouds may be '
            'lost (in a container: --shm-size 1g)'
        )
    for name in PROFILE_VARIABLES:
        environment[name] = str(PROFILE)
    return None


def segment_size() -> int:
    """Size of the shipped profile's shared-memory segment, bytes."""
    root = xml.etree.ElementTree.parse(PROFILE).getroot()
    return int(next(each.text or '0' for each in root.iter() if each.tag.endswith('segment_size')))


def _free_bytes(folder: Path) -> int:
    try:
        status = os.statvfs(folder)
    except OSError:
        return 0
    return status.f_bavail * status.f_frsize
