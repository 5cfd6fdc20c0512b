"""The hybrid method: terrain above the local ground, outlines where image and 3D agree."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.reprojection import reproject
from rover_obstacle_detection.detection.images.components import small_parts
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.images.texture import texture_level
from rover_obstacle_detection.detection.regions.grey_level import dark_regions
from rover_obstacle_detection.detection.regions.regions import (
    Nearest,
    carried,
    nearest_known,
    seed_regions,
)
from rover_obstacle_detection.detection.regions.segmentation import mean_shift_regions
from rover_obstacle_detection.detection.result.as_seen import as_seen
from rover_obstacle_detection.detection.result.cue import Cue
from rover_obstacle_detection.detection.result.detection import FREE, OBSTACLE, Detection, Product
from rover_obstacle_detection.detection.rocks.rocks import Rocks, outlined_rocks
from rover_obstacle_detection.detection.stereo.ground_matching import Stereo, match_against_ground
from rover_obstacle_detection.detection.study.window_terrain import (
    elevation_along,
    window_roughness,
    window_step,
)
from rover_obstacle_detection.detection.terrain.hazards import (
    KNOWN_SHARE,
    impassable_ground,
    rough_ground,
    standing_parts,
)
from rover_obstacle_detection.detection.terrain.survey import Terrain, survey
from rover_obstacle_detection.detection.terrain.vertical import estimate_vertical

OPTIONAL_STAGES = (
    'noise',
    'rows',
    'lenses',
    'subpixel',
    'layers',
    'vertical',
    'slope',
    'drop',
    'outlines',
    'parallax',
    'sight',
    'regions',
    'grey level',
    'doubt',
)
"""Stages that the chain can do without, for the ablation; without rows there are no lenses."""

REGION_REDUCTION = 4
TEXTURE_BANDWIDTH = 3.0
MIN_PIXELS = 12
# How far a rock's region, or a slope, may go on where nothing is measured, metres.
REACH_M = 0.35
# What the outline filter holds for less likely than this, no region makes a rock.
REGION_PROBABILITY = 0.3
# Where the right image ends there are no matches, by so much and less.
BORDER_PX = 5
# Of the image: less is a speck.
SPECK_SHARE = 0.0025


@dataclass(frozen=True, eq=False)
class Segments:
    """Mean-shift regions and what is known of each."""

    regions: NDArray[np.int32]
    is_seed: NDArray[np.bool_]


def detect_hybrid(
    pair: GreyPair,
    camera: StereoCamera,
    config: DetectorConfig,
    gravity: Gravity | None,
    rover_mask: NDArray[np.bool_] | None,
    finished: Callable[[str], None],
    leave_out: frozenset[str] = frozenset(),
) -> Detection:
    """Run the hybrid chain on one pair.

    Parameters
    ----------
    pair : tuple of two ndarray of uint8, shape (height, width)
    camera : StereoCamera
    config : DetectorConfig
    gravity : Gravity, optional
        The vertical, where known.
    rover_mask : ndarray of bool, shape (height, width), optional
        Pixels that show the rover: without 3D, and never judged.
    finished : callable
        Told the name of each stage as it ends.
    leave_out : frozenset of str
        Of `OPTIONAL_STAGES`: what to do without, to see what it is worth.
    """
    stereo = match_against_ground(pair, camera, config, gravity, rover_mask, finished, leave_out)
    seen_mask, rover_mask = rover_mask, stereo.rover_mask
    terrain = survey(
        stereo.disparity,
        stereo.noise_px,
        stereo.expected,
        camera,
        stereo.ground,
        config,
        layered='layers' not in leave_out,
    )
    finished('local ground')
    if gravity is None and 'vertical' not in leave_out:
        up = estimate_vertical(terrain.layers, stereo.ground)
        stereo = replace(stereo, ground=replace(stereo.ground, up=up))
    finished('vertical')
    steep, dropped = impassable_ground(terrain, stereo.ground, config)
    steep &= 'slope' not in leave_out
    dropped &= 'drop' not in leave_out
    finished('slope, drop')
    if not config.max_roughness:
        # The maps are as large as all that follows together, and have done their work.
        terrain = replace(terrain, layers=())
    standing = standing_parts(terrain, config)
    finished('height')
    rocks = outlined_rocks(stereo, terrain, standing, camera, config, rover_mask, leave_out)
    finished('outlines')
    rough = rough_ground(terrain, rocks.high | steep | dropped, config)
    finished('roughness')
    segments = segment(stereo, terrain, config)
    finished('segmentation')
    nearest = nearest_known(terrain.measured, REACH_M * terrain.pixels_per_metre)
    steep |= slope_beyond_border(steep, nearest, stereo.disparity, camera)
    near_rock, dark = complete_by_regions(rocks, nearest, segments, stereo, camera, config)
    near_rock &= 'regions' not in leave_out
    dark &= 'grey level' not in leave_out
    finished('regions')
    found = {
        Cue.HEIGHT: rocks.high,
        Cue.SLOPE: steep,
        Cue.DROP: dropped,
        Cue.ROUGHNESS_STEP: rough,
        Cue.REGION: near_rock,
        Cue.GREY_LEVEL: dark | rocks.by_sight,
    }
    cues, mask = combined(found, rover_mask)
    detection = _detection(
        stereo, terrain, segments, rocks, cues, mask, rover_mask, camera, config
    )
    if 'doubt' not in leave_out:
        detection = without_doubtful(detection)
    if stereo.seen is not None:
        detection = as_seen(detection, stereo.lenses, stereo.seen, seen_mask)
    finished('mask')
    return detection


def combined(
    found: Mapping[Cue, NDArray[np.bool_]], rover_mask: NDArray[np.bool_] | None
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Put together what each cue found; specks and the rover itself are no obstacles.

    Returns
    -------
    cues : ndarray of uint8, shape (height, width)
        Sum of the cues of each obstacle pixel.
    mask : ndarray of uint8, shape (height, width)
        `FREE` or `OBSTACLE`.
    """
    cues = np.zeros(next(iter(found.values())).shape, np.uint8)
    for cue, where in found.items():
        cues += np.uint8(cue) * where
    obstacle = cues > 0
    obstacle &= ~small_parts(obstacle, MIN_PIXELS)
    if rover_mask is not None:
        obstacle &= ~rover_mask
    cues[~obstacle] = 0
    return cues, np.where(obstacle, OBSTACLE, FREE).astype(np.uint8)


def segment(stereo: Stereo, terrain: Terrain, config: DetectorConfig) -> Segments:
    """Divide the image into mean-shift regions, and find which of them are seeds.

    The grey-level bandwidth follows the texture: ground of one kind should be one region.
    """
    grey = stereo.pair[0]
    reduction = REGION_REDUCTION
    size = max(1, grey.shape[1] // reduction), max(1, grey.shape[0] // reduction)
    small = np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), np.uint8)
    bandwidth = TEXTURE_BANDWIDTH * texture_level(small)
    regions = mean_shift_regions(
        small,
        max(1.0, config.mean_shift_spatial_radius / reduction),
        float(
            np.clip(
                bandwidth, config.mean_shift_color_radius / 4, config.mean_shift_color_radius * 2
            )
        ),
        max(1, config.min_region_size // reduction**2),
    )
    regions = np.asarray(
        cv2.resize(regions, grey.shape[::-1], interpolation=cv2.INTER_NEAREST), np.int32
    )
    return Segments(regions, seed_regions(regions, stereo.disparity > 0, config.min_seed_points))


def slope_beyond_border(
    steep: NDArray[np.bool_],
    nearest: Nearest,
    disparity: NDArray[np.float32],
    camera: StereoCamera,
) -> NDArray[np.bool_]:
    """Find the pixels of a slope that the right eye does not see, beside those that it sees.

    The left border would else cut every slope off. A speck is not carried on: at the edge of what
    is seen rises are noisy.
    """
    if not steep.any():
        return np.zeros_like(steep)
    large = steep & ~small_parts(steep, round(SPECK_SHARE * steep.size))
    found = carried(large, nearest)
    right_column = nearest.pixels % camera.width - disparity.ravel()[nearest.sources]
    found.ravel()[nearest.pixels] &= right_column - camera.disparity_offset < BORDER_PX
    return found


def complete_by_regions(
    rocks: Rocks,
    nearest: Nearest,
    segments: Segments,
    stereo: Stereo,
    camera: StereoCamera,
    config: DetectorConfig,
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Find the pixels that only their region makes an obstacle: near a rock, or dark.

    A pixel without 3D in a seed region goes with the nearest measured pixel, if that is of the
    same region, unless the outline filter holds it for anything but a rock. A region without 3D,
    though the right eye sees it, is judged by its grey level.
    """
    unmatched = stereo.disparity == 0
    near_rock, dark = np.zeros_like(rocks.high), np.zeros_like(rocks.high)
    if not unmatched.any():
        return near_rock, dark
    regions, is_seed = segments.regions, segments.is_seed
    beside = carried(rocks.high, nearest, regions) & ~(rocks.probability < REGION_PROBABILITY)
    near_rock[unmatched] = beside[unmatched] & is_seed[regions[unmatched]]
    is_dark = dark_regions(stereo.pair[0], regions, is_seed, config.dark_grey_level)
    if is_dark.any():
        expected = stereo.expected[unmatched]
        right_column = np.nonzero(unmatched)[1] - expected - camera.disparity_offset
        shared_view = (right_column >= 0) & (right_column <= camera.width - 1)
        shared_view &= expected > camera.disparity_at(config.max_range)
        dark[unmatched] = is_dark[regions[unmatched]] & shared_view
    return near_rock, dark


def without_doubtful(detection: Detection) -> Detection:
    """Take back specks of ground too steep or low that are hardly one; they are not free either.

    Noise makes far ground steep here and there. What stands up is never taken back, nor a large
    slope, however noisy.
    """
    by_ground = np.uint8(Cue.SLOPE | Cue.DROP)
    doubtful = (detection.cues > 0) & (detection.cues & ~by_ground == 0)
    doubtful &= small_parts(doubtful, round(SPECK_SHARE * doubtful.size))
    if not doubtful.any():
        return detection
    doubtful &= detection.confidence < detection.config.min_confidence
    if not doubtful.any():
        return detection
    judged = detection.products['known']

    def known() -> NDArray[np.bool_]:
        return np.asarray((judged() if callable(judged) else judged) & ~doubtful)

    products: dict[str, Product] = {
        'cues': np.where(doubtful, 0, detection.cues).astype(np.uint8),
        'mask': np.where(doubtful, FREE, detection.mask).astype(np.uint8),
        'known': known,
    }
    return replace(detection, products={**detection.products, **products})


def _detection(
    stereo: Stereo,
    terrain: Terrain,
    segments: Segments,
    rocks: Rocks,
    cues: NDArray[np.uint8],
    mask: NDArray[np.uint8],
    rover_mask: NDArray[np.bool_] | None,
    camera: StereoCamera,
    config: DetectorConfig,
) -> Detection:
    # What is made on request must not hold on to maps and planes: a node keeps detections.
    disparity, ground = stereo.disparity, stereo.ground
    rock_probability = rocks.probability
    height_m, noise_m = terrain.height_m, terrain.noise_m
    regions, is_seed = segments.regions, segments.is_seed

    def step() -> NDArray[np.float32]:
        elevation_m = elevation_along(reproject(disparity, camera), ground.up_vector)
        return window_step(elevation_m, config.window_size)

    def known() -> NDArray[np.bool_]:
        # Noise that hides a step hides an obstacle; what stands out of it is one all the same.
        found = np.isfinite(height_m) & (noise_m < KNOWN_SHARE * config.max_step)
        found |= mask == OBSTACLE
        return np.asarray(found if rover_mask is None else found & ~rover_mask)

    return Detection(
        camera=camera,
        config=config,
        ground=ground,
        alignment=stereo.alignment,
        lenses=stereo.lenses,
        products={
            'grey': stereo.pair[0],
            'disparity': disparity,
            'regions': regions,
            'seeds': lambda: is_seed[regions],
            'roughness': lambda: window_roughness(disparity, camera, config.window_size),
            'step': step,
            'height': height_m,
            'height_noise': noise_m,
            'rock_probability': rock_probability,
            'cues': cues,
            'known': known,
            'mask': mask,
        },
    )
