"""A result file that appears whole or not at all."""

from __future__ import annotations

import json
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rover_obstacle_detection.errors import OutputError


def check_output_file(path: Path, *, force: bool) -> None:
    """Refuse before the work a file that could not be written after it.

    Raises
    ------
    OutputError
        If it is no place for a file, or there is one and `force` is not set.
    """
    is_other = path.exists() and not path.is_file()
    if is_other or not path.absolute().parent.is_dir():
        msg = f'cannot write {path}: expected a file in a folder that exists'
        raise OutputError(msg)
    if path.exists() and not force:
        msg = f'{path} exists: give --force to replace it'
        raise OutputError(msg)


def write_whole(path: Path, text: str) -> None:
    """Write a text under another name, and move it into place.

    Raises
    ------
    OutputError
        If it cannot be written; then what was there before is left as it was.
    """
    path = path.resolve()
    temporary = path.with_name(f'.{path.name}.{secrets.token_hex(4)}')
    try:
        temporary.write_text(text, encoding='utf-8')
        temporary.replace(path)
    except OSError as error:
        msg = f'cannot write {path}: {error.strerror}'
        raise OutputError(msg) from error
    finally:
        temporary.unlink(missing_ok=True)


def write_json_whole(path: Path, content: Mapping[str, Any]) -> None:
    """Write figures; a number that is not finite is a mistake and raises ValueError."""
    write_whole(path, json.dumps(content, indent=2, allow_nan=False) + '\n')
