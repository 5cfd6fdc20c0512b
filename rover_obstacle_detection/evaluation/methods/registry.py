"""The methods that can be compared, by name."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from dataclasses import dataclass

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.evaluation.methods.depth_only import DepthOnly
from rover_obstacle_detection.evaluation.methods.detector_method import DetectorMethod
from rover_obstacle_detection.evaluation.methods.image_only import ImageOnly
from rover_obstacle_detection.evaluation.methods.listing import Listing
from rover_obstacle_detection.evaluation.methods.method import Method
from rover_obstacle_detection.evaluation.methods.peers import Cloth, Patchwork
from rover_obstacle_detection.evaluation.methods.wang import Wang


@dataclass(frozen=True)
class MethodEntry:
    """A method that can be asked for by name.

    Parameters
    ----------
    make : callable
        Takes the configuration, gives the method.
    description : str
        One line for a table.
    has_clearance : bool
        Whether ``max_step`` decides what it flags, so that a curve over it means something.
    """

    make: Callable[[DetectorConfig], Method]
    description: str
    has_clearance: bool


METHODS = {
    'hybrid': MethodEntry(
        lambda config: DetectorMethod('hybrid', config), "this package's default", True
    ),
    'study': MethodEntry(
        lambda config: DetectorMethod('study', config),
        "the study's method, its errors mended",
        False,
    ),
    'listing': MethodEntry(
        lambda config: Listing(), "the study's listing, repaired only to run", False
    ),
    'wang': MethodEntry(Wang, "Wang et al.'s sparse pipeline (study, 4.1)", True),
    'image_only': MethodEntry(
        lambda config: ImageOnly(), '2D only: Canny edges and k-means regions', False
    ),
    'depth_only': MethodEntry(DepthOnly, '3D only: robust ground plane plus height', True),
    'patchwork': MethodEntry(Patchwork, 'Patchwork++ on the stereo cloud', True),
    'cloth': MethodEntry(Cloth, 'cloth simulation filter on the stereo cloud', True),
}


def make_method(name: str, config: DetectorConfig | None = None) -> Method:
    """Make a method by its name.

    Raises
    ------
    ConfigurationError
        If there is no such method.
    MissingExtraError
        If its library is not installed.
    """
    if name not in METHODS:
        near = difflib.get_close_matches(name, METHODS, 1)
        hint = f' (did you mean {near[0]}?)' if near else ''
        msg = f'method is {name!r}: expected one of {", ".join(METHODS)}{hint}'
        raise ConfigurationError(msg)
    return METHODS[name].make(config or DetectorConfig())
