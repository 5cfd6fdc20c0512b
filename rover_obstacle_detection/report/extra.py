"""The libraries of the extra ``report``."""

from __future__ import annotations

import importlib
from typing import Any

from rover_obstacle_detection.errors import MissingExtraError


def report_library(module: str) -> Any:
    """Import a library that reports need.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        msg = (
            f'a report needs {module.partition(".")[0]}, which is not installed: '
            "pip install 'rover_obstacle_detection[report]'"
        )
        raise MissingExtraError(msg) from error


def require_report_libraries() -> None:
    """Import all that a report needs.

    Raises
    ------
    MissingExtraError
        If one is not installed.
    """
    for module in ('jinja2', 'matplotlib'):
        report_library(module)
