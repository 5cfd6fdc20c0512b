"""Write result folders so that each is entirely old or entirely new, whenever it is looked at."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import logging
import os
import shutil
from collections.abc import Iterator, Sequence
from collections.abc import Set as AbstractSet
from pathlib import Path

from rover_obstacle_detection.errors import OutputError
from rover_obstacle_detection.partial_folder import locked, partial_folder

SUMMARY = 'summary.json'
"""The file that marks complete results; the last to appear where files are moved one by one."""

_logger = logging.getLogger(__name__)

_AT_FDCWD = -100
_RENAME_EXCHANGE = 2


def check_output_folder(path: Path, *, force: bool) -> None:
    """Check that an output folder is missing or empty, or that `force` is set.

    Raises
    ------
    OutputError
        If the folder is not empty and `force` is not set, or if the path is not a folder.
    """
    if path.is_dir():
        if not force and any(path.iterdir()):
            raise OutputError(
                f'output folder {path} is not empty: give --force to replace earlier results'
            )
    elif path.exists() or path.is_symlink():
        raise OutputError(f'output {path} is a file: expected a folder')


@contextlib.contextmanager
def output_folder(path: Path, *, force: bool, replaces: Sequence[str]) -> Iterator[Path]:
    """Provide a folder that takes the place of `path` when the block ends.

    The two are exchanged in one step. Only where that is impossible, as on a mount point, in the
    working directory, or on a file system that cannot exchange folders, are files moved one by
    one, `SUMMARY` last.

    Parameters
    ----------
    path : Path
        The folder to create, including its parents.
    force : bool
        Write into a folder that is not empty.
    replaces : sequence of str
        Glob patterns, relative to `path`, of the files of a previous run, which are removed. All
        other files are kept.

    Yields
    ------
    Path
        An empty folder next to `path`. Any exception, including `KeyboardInterrupt` and
        `SystemExit`, removes it.

    Raises
    ------
    OutputError
        If the folder is not empty and `force` is not set, if it cannot be created, or if another
        run is writing to it.
    """
    check_output_folder(path, force=force)
    path = path.resolve()
    with folder_if_filled(path.parent), contextlib.ExitStack() as stack:
        try:
            partial = stack.enter_context(partial_folder(path))
            _recover(path)
        except (OSError, ValueError) as error:
            reason = getattr(error, 'strerror', None) or 'it has no name'
            raise OutputError(f'cannot write output folder {path}: {reason}') from error
        check_output_folder(path, force=force)
        yield partial
        _put_in_place(partial, path, replaces, force=force)


@contextlib.contextmanager
def folder_if_filled(path: Path) -> Iterator[None]:
    """Create a folder and its parents; afterwards remove those that are still empty.

    Raises
    ------
    OutputError
        If the folder cannot be created.
    """
    missing = [each for each in (path, *path.parents) if not each.exists()]
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f'cannot create output folder {path}: {error.strerror}') from error
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            for each in missing:
                each.rmdir()


def _put_in_place(new: Path, path: Path, replaces: Sequence[str], *, force: bool) -> None:
    replaced = {each for pattern in replaces for each in path.glob(pattern) if not each.is_dir()}
    try:
        # A shell in the folder would be left in a removed one.
        if not Path.cwd().is_relative_to(path):
            _replace(new, path, replaced, force=force)
            return
    except OSError as error:
        _logger.debug('%s cannot be replaced as a whole: %s', path, error)
    check_output_folder(path, force=force)
    _remove(path, replaced)
    _merge(new, path)


def _replace(new: Path, path: Path, replaced: AbstractSet[Path], *, force: bool) -> None:
    if path.exists():
        _take_attributes(path, new)
        if force and any(path.iterdir()):
            with locked(path, path):
                _link_others(path, new, replaced)
                _exchange(new, path)
                # Now the old folder.
                shutil.rmtree(new, ignore_errors=True)
            return
    # Fails if another program has filled it meanwhile.
    new.rename(path)


def _link_others(old: Path, new: Path, replaced: AbstractSet[Path]) -> None:
    """Give the new folder the files of the old one that no run has written."""
    for each in old.iterdir():
        place = new / each.name
        if each in replaced:
            continue
        if each.is_dir() and not each.is_symlink():
            kept = [other for other in each.iterdir() if other not in replaced]
            if kept or not any(each.iterdir()):
                place.mkdir(exist_ok=True)
                _take_attributes(each, place)
                _link_others(each, place, replaced)
        elif place.is_dir() or not os.path.lexists(place):
            _link(each, place)


def _link(file: Path, place: Path) -> None:
    try:
        os.link(file, place, follow_symlinks=False)
    except FileExistsError:
        raise
    except OSError:
        # Not every file system has hard links, and they do not lead to another one.
        shutil.copy2(file, place, follow_symlinks=False)


def _take_attributes(old: Path, new: Path) -> None:
    """Give a new folder the owner and the permissions of the old one, as far as allowed."""
    status = old.stat()
    with contextlib.suppress(OSError):
        os.chown(new, status.st_uid, status.st_gid)
    with contextlib.suppress(OSError):
        new.chmod(status.st_mode & 0o7777)


def _exchange(one: Path, other: Path) -> None:
    """Exchange two folders, in one step if the system can."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), 'renameat2', None)
    names = os.fsencode(one), os.fsencode(other)
    if rename and not rename(_AT_FDCWD, names[0], _AT_FDCWD, names[1], _RENAME_EXCHANGE):
        return
    aside = _aside(other)
    other.rename(aside)
    try:
        one.rename(other)
    except BaseException:
        aside.rename(other)
        raise
    aside.rename(one)


def _aside(path: Path) -> Path:
    return path.with_name(f'.{path.name}.replaced')


def _recover(path: Path) -> None:
    """Put back, or remove, the old folder of a run that was killed while it put it aside."""
    aside = _aside(path)
    if not aside.exists():
        return
    if path.exists():
        shutil.rmtree(aside)
    else:
        _logger.warning('%s is left over from a run that was killed: putting it back', aside)
        aside.rename(path)


def _remove(folder: Path, replaced: AbstractSet[Path]) -> None:
    """Remove files, the summary first, and subfolders that become empty."""
    for old in sorted(replaced, key=lambda file: file.name != SUMMARY):
        old.unlink()
        if old.parent != folder and not any(old.parent.iterdir()):
            old.parent.rmdir()


def _merge(source: Path, target: Path) -> None:
    """Move the content of a folder into another, replacing files of the same name."""
    target.mkdir(exist_ok=True)
    for new in sorted(source.iterdir(), key=lambda file: file.name == SUMMARY):
        place = target / new.name
        if new.is_dir():
            _merge(new, place)
            continue
        try:
            new.replace(place)
        except OSError as error:
            if error.errno != errno.EXDEV:
                raise
            shutil.copy2(new, place)
