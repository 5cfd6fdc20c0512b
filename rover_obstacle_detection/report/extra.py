"""Import the libraries of the optional dependency group ``report``."""

from __future__ import annotations

import importlib
from typing import Any

from rover_obstacle_detection.errors import MissingExtraError

_LIBRARIES = ('jinja2', 'matplotlib')


def report_library(module: str) -> Any:
    """Import a module that reports need.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingExtraError(
            f'reports need {module.partition(".")[0]}, which is not installed: '
            f'pip install {" ".join(_LIBRARIES)}'
        ) from error


def require_report_libraries() -> None:
    """Check that all libraries for reports are installed.

    Raises
    ------
    MissingExtraError
        If one is missing.
    """
    for module in _LIBRARIES:
        report_library(module)
