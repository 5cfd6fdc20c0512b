"""A result folder that appears whole or not at all."""

from __future__ import annotations

import contextlib
import secrets
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

from rover_obstacle_detection.errors import OutputError


def check_output(path: Path, *, force: bool) -> None:
    """Refuse an output folder that holds something, unless forced.

    Raises
    ------
    OutputError
        If it is a file, or a folder with anything in it and `force` is not set.
    """
    if path.is_dir():
        if not force and any(path.iterdir()):
            msg = f'output folder {path} exists and is not empty: give --force to replace it'
            raise OutputError(msg)
    elif path.exists() or path.is_symlink():
        msg = f'output {path} is a file: expected a folder'
        raise OutputError(msg)


@contextlib.contextmanager
def output_folder(path: Path, *, force: bool, replaces: Sequence[str]) -> Iterator[Path]:
    """Fill a temporary sibling of a folder, and move it into place in the end.

    Parameters
    ----------
    path : Path
        The folder to make, with its parents.
    force : bool
        Write into a folder that exists.
    replaces : sequence of str
        Glob patterns, relative to the folder, of the files of an earlier run. Forced, these are
        removed before the new ones are moved in; every other file is left as it is.

    Yields
    ------
    Path
        The temporary folder: removed on an error, on Ctrl-C, on `SystemExit`.

    Raises
    ------
    OutputError
        If the folder exists and `force` is not set, or cannot be made.
    """
    check_output(path, force=force)
    path = path.resolve()
    temporary = path.with_name(f'.{path.name}.{secrets.token_hex(4)}')
    with folder_if_filled(path.parent):
        try:
            temporary.mkdir()
        except OSError as error:
            msg = f'cannot write to output folder {path}: {error.strerror}'
            raise OutputError(msg) from error
        try:
            yield temporary
            if path.is_dir():
                _remove(path, replaces)
                _merge(temporary, path)
            else:
                temporary.rename(path)
        except BaseException:
            shutil.rmtree(temporary, ignore_errors=True)
            raise


@contextlib.contextmanager
def folder_if_filled(path: Path) -> Iterator[None]:
    """Make a folder with its parents, and take away again what is empty in the end.

    Raises
    ------
    OutputError
        If it cannot be made.
    """
    missing = [each for each in (path, *path.parents) if not each.exists()]
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        msg = f'cannot make output folder {path}: {error.strerror}'
        raise OutputError(msg) from error
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            for each in missing:
                each.rmdir()


def _remove(folder: Path, patterns: Sequence[str]) -> None:
    for pattern in patterns:
        for old in list(folder.glob(pattern)):
            if not old.is_dir():
                old.unlink()
                if old.parent != folder and not any(old.parent.iterdir()):
                    old.parent.rmdir()


def _merge(source: Path, target: Path) -> None:
    target.mkdir(exist_ok=True)
    for new in list(source.iterdir()):
        place = target / new.name
        if new.is_dir():
            _merge(new, place)
        else:
            new.replace(place)
    source.rmdir()
