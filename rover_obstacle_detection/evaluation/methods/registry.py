"""Make methods by name."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from dataclasses import replace

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.evaluation.methods.ablation import (
    ABLATIONS,
    WHOLE,
    left_out_stage,
)
from rover_obstacle_detection.evaluation.methods.cascade import BoostedCascade
from rover_obstacle_detection.evaluation.methods.depth_only import DepthOnly
from rover_obstacle_detection.evaluation.methods.detector_method import DetectorMethod
from rover_obstacle_detection.evaluation.methods.image_only import ImageOnly
from rover_obstacle_detection.evaluation.methods.listing import Listing
from rover_obstacle_detection.evaluation.methods.method import Method
from rover_obstacle_detection.evaluation.methods.peers import Cloth, Patchwork
from rover_obstacle_detection.evaluation.methods.upside_down import UpsideDown
from rover_obstacle_detection.evaluation.methods.wang import Wang

METHODS: dict[str, Callable[[DetectorConfig], Method]] = {
    'hybrid': lambda config: DetectorMethod(replace(config, method='hybrid')),
    'study': lambda config: DetectorMethod(replace(config, method='study')),
    'listing': lambda config: Listing(),
    'wang': Wang,
    'image_only': lambda config: ImageOnly(),
    'cascade': lambda config: BoostedCascade(),
    'depth_only': DepthOnly,
    'patchwork': Patchwork,
    'cloth': Cloth,
}

USE_CLEARANCE = ('hybrid', 'wang', 'depth_only', 'patchwork', 'cloth')
"""Methods whose result depends on ``max_step``."""


def make_method(name: str, config: DetectorConfig | None = None) -> Method:
    """Make a method by name, or the hybrid without a stage: ``hybrid without slope``.

    Raises
    ------
    ConfigurationError
        If the method does not exist.
    MissingExtraError
        If its library is not installed.
    """
    stage = left_out_stage(name)
    if stage is not None:
        own = replace(config or DetectorConfig(), method=WHOLE)
        return DetectorMethod(own, ABLATIONS[stage])
    if name not in METHODS:
        near = difflib.get_close_matches(name, METHODS, 1)
        hint = f' (did you mean {near[0]}?)' if near else ''
        msg = f'method is {name!r}: expected one of {", ".join(METHODS)}{hint}'
        raise ConfigurationError(msg)
    config = config or DetectorConfig()
    method = METHODS[name](config)
    if config.upside_down and not isinstance(method, DetectorMethod):
        return UpsideDown(method)
    return method
