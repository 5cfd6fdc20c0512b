"""The hybrid method: hazards of the terrain by 3D, outlines of rocks by 3D and image."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.images.resampling import resized
from rover_obstacle_detection.detection.methods.measurement import (
    Finished,
    Mask,
    Measurement,
    measure,
)
from rover_obstacle_detection.detection.methods.outline_view import outline_view
from rover_obstacle_detection.detection.methods.stages import HYBRID_STAGES, HybridStages
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.regions.segmentation import reduced_regions
from rover_obstacle_detection.detection.result.cue import Cue
from rover_obstacle_detection.detection.result.detection import OBSTACLE, Detection
from rover_obstacle_detection.detection.result.enlarged import enlarged
from rover_obstacle_detection.detection.result.left_image import in_left_image
from rover_obstacle_detection.detection.result.specks import around, combined_cues
from rover_obstacle_detection.detection.rocks.rocks import Rocks, outlined_rocks
from rover_obstacle_detection.detection.rocks.standing import standing_parts
from rover_obstacle_detection.detection.stereo.matching import Stereo
from rover_obstacle_detection.detection.study.products import StudyProducts
from rover_obstacle_detection.detection.terrain.border import slope_in_border, walls_in_border
from rover_obstacle_detection.detection.terrain.cell_evidence import cell_evidence
from rover_obstacle_detection.detection.terrain.hazards import (
    large_slopes,
    rough_ground,
    tall,
)
from rover_obstacle_detection.detection.terrain.level import level_ground, uneven
from rover_obstacle_detection.detection.terrain.likely_hazards import judged_ground
from rover_obstacle_detection.detection.terrain.slope import Hazard
from rover_obstacle_detection.detection.terrain.terrain import Terrain


def detect_hybrid(
    frame: Frame,
    parameters: DetectorParameters,
    finished: Finished,
    stages: HybridStages = HYBRID_STAGES,
) -> Detection:
    """Run the hybrid method on one frame.

    Parameters
    ----------
    frame : Frame
    parameters : DetectorParameters
    finished : callable
        Called with the name of each stage when it ends.
    stages : HybridStages

    Raises
    ------
    UnjudgeablePairError
        If the pair says nothing about the ground, or contradicts itself.
    """
    p, full = parameters, frame
    measured = measure(full, p, finished, stages)
    steep, dropped = ground_hazards(measured, stages, p)
    finished('slope, drop')
    if not p.terrain.max_roughness_m:
        # The maps take as much memory as everything that follows.
        measured = measured._replace(terrain=replace(measured.terrain, layers=()))
    view = outline_view(full, measured, p)
    standing = standing_parts(view.terrain, p.rocks)
    finished('height')
    rocks = outlined_rocks(view.stereo, view.terrain, standing, p.rocks, stages.outlines)
    finished('outlines')
    rock = resized(rocks.high, measured.frame.camera.shape)
    hazards, doubtful = terrain_hazards(measured, steep, dropped, rock, p, finished)
    found = {cue: view.finer(hazard) for cue, hazard in hazards.items()}
    found[Cue.HEIGHT] |= rocks.high
    may_be_free = ~(view.finer(doubtful) | rocks.possible(p.rocks))
    detection = decided(found, may_be_free, view.stereo, view.terrain, rocks, p)
    detection = replace(detection, correction=view.correction, warnings=measured.warnings)
    detection = enlarged(in_left_image(stages.doubt(detection), view.frame), full)
    finished('mask')
    return detection


def ground_hazards(
    measured: Measurement, stages: HybridStages, parameters: DetectorParameters
) -> tuple[Hazard, Hazard]:
    """Find slopes and hollows, by limits and by the network.

    Parameters
    ----------
    measured : Measurement
    stages : HybridStages
    parameters : DetectorParameters

    Returns
    -------
    steep, dropped : Hazard
    """
    p, terrain, ground = parameters.terrain, measured.terrain, measured.stereo.ground
    cells = cell_evidence(terrain, ground, p)
    steep = stages.slope(terrain, cells, ground, p)
    dropped = stages.drop(terrain, cells, p)
    edges = measured.brims.edge(p.brims)
    likely = stages.hazards(terrain, cells, edges, ground, p)
    return judged_ground(likely, steep, dropped, measured.sparse, terrain, p)


def terrain_hazards(
    measured: Measurement,
    steep: Hazard,
    dropped: Hazard,
    rock: Mask,
    parameters: DetectorParameters,
    finished: Finished,
) -> tuple[dict[Cue, Mask], Mask]:
    """Find the hazards of the terrain, and what may be one.

    Parameters
    ----------
    measured : Measurement
    steep, dropped : Hazard
        Slopes and hollows.
    rock : ndarray of bool, shape (height, width)
        Pixels on rocks.
    parameters : DetectorParameters
    finished : callable

    Returns
    -------
    hazards : dict of Cue to ndarray of bool, shape (height, width)
    doubtful : ndarray of bool, shape (height, width)
        Pixels that are not free, hazard or not.
    """
    p, terrain, stereo = parameters.terrain, measured.terrain, measured.stereo
    brims = measured.brims.not_on(rock, p.brims).doubted(measured.sparse, p.brims)
    drops = dropped.found | brims.edge(p.brims)
    rough = rough_ground(terrain, rock | steep.found | drops, p)
    finished('roughness')
    border = (terrain, stereo.disparity, stereo.frame.camera, p)
    large = large_slopes(steep.found, p)
    slopes = steep.found | large | slope_in_border(large, *border)
    walls = tall(terrain, p)
    walls |= walls_in_border(rock | walls | slopes, *border)
    finished('border')
    if not stereo.ground.measured:
        # Nothing in view can be ground, so all that is seen stands in the way.
        slopes = terrain.measured
    # Smoothing spreads the fall at a brim into the ground before it, beyond the marked edge.
    doubtful = measured.sparse | brims.beyond() | brims.near(p.brims)
    doubtful |= steep.possible | dropped.possible
    return {
        Cue.HEIGHT: walls,
        Cue.SLOPE: slopes,
        Cue.DROP: drops,
        Cue.ROUGHNESS_STEP: rough,
    }, doubtful


def study_products(stereo: Stereo, parameters: DetectorParameters) -> StudyProducts:
    """Prepare the study's intermediate results for the debug topics.

    They are computed on first access, and regions at a fraction of the resolution.
    """
    p = parameters
    return StudyProducts(
        grey=stereo.frame.pair[0],
        disparity=stereo.disparity,
        camera=stereo.frame.camera,
        up=stereo.ground.up_vector,
        segment=partial(reduced_regions, parameters=p.regions, images=p.images),
        study=p.study,
        min_seed_points=p.regions.min_seed_points,
    )


def decided(
    found: dict[Cue, Mask],
    may_be_free: Mask,
    stereo: Stereo,
    terrain: Terrain,
    rocks: Rocks,
    parameters: DetectorParameters,
) -> Detection:
    """Combine the cues into the detection."""
    excluded = stereo.frame.excluded
    cues, mask = combined_cues(found, excluded, parameters.result.min_obstacle_px)
    # A pixel is known if noise would not hide a step there, or if it is an obstacle anyway.
    known = level_ground(terrain, parameters.terrain)
    known &= may_be_free & stereo.ground.measured
    known &= ~around(mask, parameters.result.outline_px)
    known &= ~uneven(terrain, mask == OBSTACLE, parameters.terrain)
    known |= mask == OBSTACLE
    probability = rocks.probability
    if excluded is not None:
        known &= ~excluded
        probability = np.where(excluded, np.float32(np.nan), probability)
    return Detection(
        camera=stereo.frame.camera,
        parameters=parameters,
        ground=stereo.ground,
        grey=stereo.frame.pair[0],
        disparity=stereo.disparity,
        height=terrain.height_m,
        height_noise=terrain.noise_m,
        rock_probability=probability,
        cues=cues,
        known=known,
        mask=mask,
        study=study_products(stereo, parameters),
    )
