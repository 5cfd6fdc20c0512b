"""Build a folder next to its final place, so that it appears there at once or not at all."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import logging
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from rover_obstacle_detection.errors import OutputError

_logger = logging.getLogger(__name__)

# What flock says on a file system without locks, such as some network mounts.
_NO_LOCKS = {errno.EBADF, errno.EINVAL, errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP}


@contextlib.contextmanager
def partial_folder(path: Path) -> Iterator[Path]:
    """Provide the empty folder ``.<name>.partial`` next to `path` to one process at a time.

    A killed process leaves its folder behind; the next one clears it.

    Parameters
    ----------
    path : Path
        The final place, in an existing folder.

    Yields
    ------
    Path
        Removed when the block ends, unless it has been moved away.

    Raises
    ------
    OutputError
        If another process builds the same folder.
    OSError
        If it cannot be created.
    """
    partial = path.with_name(f'.{path.name}.partial')
    descriptor = _create_and_lock(partial, path)
    try:
        if any(partial.iterdir()):
            _logger.warning('%s is left over from a run that was killed: removing it', partial)
            _clear(partial)
        yield partial
    finally:
        if _is_at(partial, descriptor):
            shutil.rmtree(partial, ignore_errors=True)
        os.close(descriptor)


@contextlib.contextmanager
def locked(folder: Path, path: Path) -> Iterator[None]:
    """Keep other processes from taking a folder for a left-over one.

    Raises
    ------
    OutputError
        If another process holds it; the message names `path`.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        _lock(descriptor, path)
        yield
    finally:
        os.close(descriptor)


def _create_and_lock(partial: Path, path: Path) -> int:
    while True:
        is_new = True
        try:
            partial.mkdir()
        except FileExistsError:
            is_new = False
        try:
            descriptor = os.open(partial, os.O_RDONLY | os.O_DIRECTORY)
        except FileNotFoundError:
            continue
        try:
            if not _lock(descriptor, path) and not is_new:
                raise OutputError(
                    f'{partial} exists: if no other run is writing to {path}, remove it'
                )
            # Its owner may have moved or removed it since.
            if _is_at(partial, descriptor):
                return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _lock(descriptor: int, path: Path) -> bool:
    """Lock an open folder; return False if the file system has no locks."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise OutputError(f'another run is writing to {path}') from None
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            raise
        return False
    return True


def _is_at(path: Path, descriptor: int) -> bool:
    return path.exists() and os.path.samestat(path.stat(), os.fstat(descriptor))


def _clear(folder: Path) -> None:
    for each in folder.iterdir():
        if each.is_dir() and not each.is_symlink():
            shutil.rmtree(each)
        else:
            each.unlink()
