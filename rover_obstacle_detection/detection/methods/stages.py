"""The stages of the hybrid method that can be replaced from outside."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.images.brightness import Spread
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.images.image_noise import noise_share
from rover_obstacle_detection.detection.images.parameters import ImageParameters
from rover_obstacle_detection.detection.rectification.parameters import RectificationParameters
from rover_obstacle_detection.detection.rectification.rectify import (
    CoarseMatch,
    Rectified,
    rectify,
)
from rover_obstacle_detection.detection.rectification.reduced_pair import ReducedPair
from rover_obstacle_detection.detection.rectification.row_alignment import RowAlignment
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.detection.result.specks import without_doubtful
from rover_obstacle_detection.detection.rocks.rocks import Draw, network_outlines
from rover_obstacle_detection.detection.stereo.matching import Stereo
from rover_obstacle_detection.detection.stereo.parameters import StereoParameters
from rover_obstacle_detection.detection.stereo.subpixel import RefinedDisparity, refine_disparity
from rover_obstacle_detection.detection.terrain.brims import Brims, find_brims
from rover_obstacle_detection.detection.terrain.cell_evidence import CellEvidence
from rover_obstacle_detection.detection.terrain.hazard_model import HazardProbability
from rover_obstacle_detection.detection.terrain.hazards import dropping_ground, steep_ground
from rover_obstacle_detection.detection.terrain.likely_hazards import likely_hazards
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.reflections import without_reflections
from rover_obstacle_detection.detection.terrain.slope import Hazard
from rover_obstacle_detection.detection.terrain.survey import survey
from rover_obstacle_detection.detection.terrain.terrain import Layer, Terrain
from rover_obstacle_detection.detection.terrain.vertical import likely_verticals

Image = NDArray[np.float32]
Mask = NDArray[np.bool_]
Cells = Sequence[CellEvidence]
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class HybridStages:
    """The stages of the hybrid method, in the order in which they run.

    An ablation replaces one of them: see ``evaluation/methods/ablation.py``.
    """

    noise_share: Callable[[Spread, Spread, ImageParameters], Spread] = noise_share
    rectify: Callable[[ReducedPair, CoarseMatch, RectificationParameters], Rectified] = rectify
    refine: Callable[
        [GreyPair, Image, StereoCamera, RowAlignment, StereoParameters], RefinedDisparity
    ] = refine_disparity
    reflections: Callable[[Stereo, TerrainParameters], Stereo] = without_reflections
    brims: Callable[[Stereo, TerrainParameters], Brims] = find_brims
    survey: Callable[[Stereo, TerrainParameters], Terrain] = survey
    verticals: Callable[[Sequence[Layer], GroundPlane, TerrainParameters], Sequence[Vector]] = (
        likely_verticals
    )
    slope: Callable[[Terrain, Cells, GroundPlane, TerrainParameters], Hazard] = steep_ground
    drop: Callable[[Terrain, Cells, TerrainParameters], Hazard] = dropping_ground
    hazards: Callable[
        [Terrain, Cells, Mask, GroundPlane, TerrainParameters], HazardProbability | None
    ] = likely_hazards
    outlines: Draw = network_outlines
    doubt: Callable[[Detection], Detection] = without_doubtful


HYBRID_STAGES = HybridStages()
