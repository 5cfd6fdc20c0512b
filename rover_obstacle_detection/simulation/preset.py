"""A named condition of a scene."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from rover_obstacle_detection.simulation.rigs import Rig

Changes = Callable[[Rig], Mapping[str, Any]]


@dataclass(frozen=True)
class Preset:
    """A named condition.

    Parameters
    ----------
    description : str
    changes : callable
        Takes the rig, which determines where objects are in view; returns nested parameters.
    """

    description: str
    changes: Changes


def for_any_rig(**changes: Any) -> Changes:
    """Return changes that do not depend on the rig."""
    return lambda rig: changes
