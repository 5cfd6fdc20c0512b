"""Write result folders atomically."""

from __future__ import annotations

import contextlib
import secrets
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

from rover_obstacle_detection.errors import OutputError


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
    """Provide a temporary folder and move it into place when the block ends.

    Parameters
    ----------
    path : Path
        The folder to create, including its parents.
    force : bool
        Write into a folder that is not empty.
    replaces : sequence of str
        Glob patterns, relative to `path`, of the files of a previous run. They are removed
        before the new files are moved in. All other files are kept.

    Yields
    ------
    Path
        The temporary folder, next to `path`. Any exception, including `KeyboardInterrupt` and
        `SystemExit`, removes it.

    Raises
    ------
    OutputError
        If the folder is not empty and `force` is not set, or if it cannot be created.
    """
    check_output_folder(path, force=force)
    path = path.resolve()
    temporary = path.with_name(f'.{path.name}.{secrets.token_hex(4)}')
    with folder_if_filled(path.parent):
        try:
            temporary.mkdir()
        except OSError as error:
            raise OutputError(f'cannot write output folder {path}: {error.strerror}') from error
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


def _remove(folder: Path, patterns: Sequence[str]) -> None:
    """Remove matching files, and subfolders that become empty."""
    for pattern in patterns:
        for old in list(folder.glob(pattern)):
            if not old.is_dir():
                old.unlink()
                if old.parent != folder and not any(old.parent.iterdir()):
                    old.parent.rmdir()


def _merge(source: Path, target: Path) -> None:
    """Move the content of a folder into another, replacing files of the same name."""
    target.mkdir(exist_ok=True)
    for new in list(source.iterdir()):
        place = target / new.name
        if new.is_dir():
            _merge(new, place)
        else:
            new.replace(place)
    source.rmdir()
