"""The hybrid without single stages, as named methods."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.images.brightness import Spread
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.images.parameters import ImageParameters
from rover_obstacle_detection.detection.methods.stages import HYBRID_STAGES, HybridStages
from rover_obstacle_detection.detection.network.tiles import Window
from rover_obstacle_detection.detection.rectification.parameters import RectificationParameters
from rover_obstacle_detection.detection.rectification.rectify import (
    CoarseMatch,
    Rectified,
    rectify,
)
from rover_obstacle_detection.detection.rectification.reduced_pair import ReducedPair
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT, RowAlignment
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.detection.rocks.judgement import half_height_outlines
from rover_obstacle_detection.detection.rocks.outline_features import (
    PARALLAX_FEATURES,
    outline_features,
)
from rover_obstacle_detection.detection.rocks.outline_model import outline_model
from rover_obstacle_detection.detection.rocks.parameters import RockParameters
from rover_obstacle_detection.detection.rocks.rocks import network_outlines
from rover_obstacle_detection.detection.rocks.standing import Standing
from rover_obstacle_detection.detection.stereo.matching import Stereo
from rover_obstacle_detection.detection.stereo.parameters import StereoParameters
from rover_obstacle_detection.detection.stereo.subpixel import RefinedDisparity, refine_disparity
from rover_obstacle_detection.detection.terrain.brims import Brims, find_brims
from rover_obstacle_detection.detection.terrain.hazard_model import HazardProbability
from rover_obstacle_detection.detection.terrain.likely_hazards import likely_hazards
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.slope import Hazard
from rover_obstacle_detection.detection.terrain.survey import layer_spans, survey_layers
from rover_obstacle_detection.detection.terrain.terrain import Layer, Terrain

Mask = NDArray[np.bool_]
Image = NDArray[np.float32]

WHOLE = 'hybrid'
WITHOUT = f'{WHOLE} without '

# Standard deviation of a disparity straight from semi-global matching, pixels.
_MATCHING_NOISE_PX = 0.125


def ablated_methods() -> tuple[str, ...]:
    """Names of the hybrid and of the hybrid without each stage of `ABLATIONS`."""
    return (WHOLE, *(f'{WITHOUT}{stage}' for stage in ABLATIONS))


def left_out_stage(method: str) -> str | None:
    """Stage that a method of this name leaves out; None for other methods."""
    stage = method.removeprefix(WITHOUT)
    return stage if stage != method and stage in ABLATIONS else None


def _no_noise(noise: Spread, gradient: Spread, parameters: ImageParameters) -> Spread:
    """Take the image to be free of noise."""
    return Spread(0.0, np.zeros_like(noise.by_brightness))


def _uncorrected(
    reduced: ReducedPair, match: CoarseMatch, parameters: RectificationParameters
) -> Rectified:
    """Match as if the rectification were perfect."""
    return Rectified(match(reduced.pair, STRAIGHT), reduced.camera, reduced.reduction)


def _rows_only(
    reduced: ReducedPair, match: CoarseMatch, parameters: RectificationParameters
) -> Rectified:
    """Correct rows, but no lens distortion."""
    return rectify(reduced, match, replace(parameters, min_first_lens_gain=math.inf))


def _as_matched(
    pair: GreyPair,
    disparity: Image,
    camera: StereoCamera,
    rows: RowAlignment,
    parameters: StereoParameters,
) -> RefinedDisparity:
    """Keep the disparity of semi-global matching, with the same noise everywhere."""
    refined = refine_disparity(pair, disparity, camera, rows, parameters)
    noise_px = np.full_like(disparity, _MATCHING_NOISE_PX)
    return replace(refined, disparity=disparity, noise_px=noise_px)


def _reflections_kept(stereo: Stereo, parameters: TerrainParameters) -> Stereo:
    """Believe points that are seen through the ground."""
    return stereo


def _no_brims(stereo: Stereo, parameters: TerrainParameters) -> Brims:
    """Find no brims."""
    everywhere = np.ones(stereo.disparity.shape, np.bool_)
    return find_brims(stereo, parameters).not_on(everywhere, parameters.brims)


def _single_layer(stereo: Stereo, parameters: TerrainParameters) -> Terrain:
    """Survey with the finest cells at all distances."""
    spans = layer_spans(stereo.frame.camera, stereo.ground.height_m, parameters)
    finest_m, _ = next(spans)
    return survey_layers(stereo, [(finest_m, math.inf)], parameters)


def _vertical_of_plane(
    layers: Sequence[Layer], ground: GroundPlane, parameters: TerrainParameters
) -> list[tuple[float, float, float]]:
    """Keep the vertical that came with the ground plane."""
    return [ground.up]


def _no_hazard(terrain: Terrain, *others: object) -> Hazard:
    """Find no impassable ground."""
    nothing = np.zeros(terrain.height_m.shape, np.bool_)
    return Hazard(nothing, nothing)


def _likely_drops(*ground: Any) -> HazardProbability:
    """Let the network find drops only."""
    likely = likely_hazards(*ground)
    return likely._replace(slope=np.zeros_like(likely.slope))


def _likely_slopes(*ground: Any) -> HazardProbability:
    """Let the network find slopes only."""
    likely = likely_hazards(*ground)
    return likely._replace(drop=np.zeros_like(likely.drop))


def _measured_hazards(*ground: object) -> None:
    """Leave the ground to the limits alone."""


def _outlines_by_height(
    stereo: Stereo,
    terrain: Terrain,
    standing: Standing,
    window: Window,
    parameters: RockParameters,
) -> Image:
    """Outline what is at least half as high as what stands beside it, without the network.

    The probability is enough to be outlined, but not to be accepted by looks alone.
    """
    near = Standing(standing.parts[window], standing.top_m)
    drawn = half_height_outlines(terrain.within(window), near, parameters.half_height_reach_px)
    outlined = (parameters.outline_probability + parameters.accepted_probability) / 2
    return np.where(drawn, np.float32(outlined), np.float32(0))


def _outlines_without_parallax(
    stereo: Stereo,
    terrain: Terrain,
    standing: Standing,
    window: Window,
    parameters: RockParameters,
) -> Image:
    """Hide the parallax evidence from the network."""
    features = outline_features(stereo, terrain, standing, window, parameters)
    features[list(PARALLAX_FEATURES)] = 0
    return outline_model().probability(features)


def _outlines_without_sight(
    stereo: Stereo,
    terrain: Terrain,
    standing: Standing,
    window: Window,
    parameters: RockParameters,
) -> Image:
    """Keep the network's probability below that of a rock that looks alone make an obstacle."""
    below = np.nextafter(np.float32(parameters.accepted_probability), np.float32(0))
    return np.minimum(network_outlines(stereo, terrain, standing, window, parameters), below)


def _no_doubt(detection: Detection) -> Detection:
    """Keep every obstacle, whatever its confidence."""
    return detection


ABLATIONS: Mapping[str, HybridStages] = {
    'noise': replace(HYBRID_STAGES, noise_share=_no_noise),
    'rows': replace(HYBRID_STAGES, rectify=_uncorrected),
    'lenses': replace(HYBRID_STAGES, rectify=_rows_only),
    'subpixel': replace(HYBRID_STAGES, refine=_as_matched),
    'reflections': replace(HYBRID_STAGES, reflections=_reflections_kept),
    'brims': replace(HYBRID_STAGES, brims=_no_brims),
    'layers': replace(HYBRID_STAGES, survey=_single_layer),
    'vertical': replace(HYBRID_STAGES, verticals=_vertical_of_plane),
    'slope': replace(HYBRID_STAGES, slope=_no_hazard, hazards=_likely_drops),
    'drop': replace(HYBRID_STAGES, drop=_no_hazard, hazards=_likely_slopes),
    'hazards': replace(HYBRID_STAGES, hazards=_measured_hazards),
    'outlines': replace(HYBRID_STAGES, outlines=_outlines_by_height),
    'parallax': replace(HYBRID_STAGES, outlines=_outlines_without_parallax),
    'sight': replace(HYBRID_STAGES, outlines=_outlines_without_sight),
    'doubt': replace(HYBRID_STAGES, doubt=_no_doubt),
}
"""The hybrid's stages with one of them left out or replaced by something simpler.

Without rows, lenses are not corrected either.
"""
