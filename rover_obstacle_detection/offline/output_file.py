"""Write result files atomically."""

from __future__ import annotations

import json
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rover_obstacle_detection.errors import OutputError


def check_output_file(path: Path, *, force: bool) -> None:
    """Check that a file can be written, before the work that produces it.

    Raises
    ------
    OutputError
        If the folder does not exist, the path is not a regular file, or the file exists and
        `force` is not set.
    """
    is_other = path.exists() and not path.is_file()
    if is_other or not path.absolute().parent.is_dir():
        raise OutputError(f'cannot write {path}: expected a file in an existing folder')
    if path.exists() and not force:
        raise OutputError(f'{path} exists: give --force to replace it')


def atomic_write_text(path: Path, text: str) -> None:
    """Write text to a temporary file and rename it.

    Raises
    ------
    OutputError
        If the file cannot be written. An existing file is then unchanged.
    """
    path = path.resolve()
    temporary = path.with_name(f'.{path.name}.{secrets.token_hex(4)}')
    try:
        temporary.write_text(text, encoding='utf-8')
        temporary.replace(path)
    except OSError as error:
        raise OutputError(f'cannot write {path}: {error.strerror}') from error
    finally:
        temporary.unlink(missing_ok=True)


def atomic_write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a JSON file as `atomic_write_text` does.

    Raises
    ------
    OutputError
        If the file cannot be written.
    ValueError
        If a number is not finite, which JSON cannot represent.
    """
    atomic_write_text(path, json.dumps(content, indent=2, allow_nan=False) + '\n')
