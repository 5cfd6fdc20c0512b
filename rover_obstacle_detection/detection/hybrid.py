"""The hybrid method: terrain above the local ground, outlines where image and 3D agree."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.camera import StereoCamera
from rover_obstacle_detection.detection.clearance import high_holes, small_parts
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.cue import Cue
from rover_obstacle_detection.detection.detection import FREE, OBSTACLE, Detection
from rover_obstacle_detection.detection.gravity import Gravity
from rover_obstacle_detection.detection.grey_level import dark_regions
from rover_obstacle_detection.detection.ground_matching import Stereo, match_against_ground
from rover_obstacle_detection.detection.hazards import (
    FOOT_M,
    FOOT_SHARE,
    KNOWN_SHARE,
    MIN_CORE_PIXELS,
    Standing,
    impassable_ground,
    rough_ground,
    standing_parts,
)
from rover_obstacle_detection.detection.image import GreyPair
from rover_obstacle_detection.detection.outline import texture_level
from rover_obstacle_detection.detection.outline_model import outline_model
from rover_obstacle_detection.detection.outline_planes import PLANES, outline_planes
from rover_obstacle_detection.detection.regions import nearest_values, seed_regions
from rover_obstacle_detection.detection.reprojection import reproject
from rover_obstacle_detection.detection.segmentation import mean_shift_regions
from rover_obstacle_detection.detection.survey import OPENING_M, Terrain, survey
from rover_obstacle_detection.detection.terrain import (
    elevation_along,
    window_roughness,
    window_step,
)
from rover_obstacle_detection.detection.vertical import estimate_vertical

OPTIONAL_STAGES = (
    'noise',
    'rows',
    'subpixel',
    'layers',
    'vertical',
    'slope',
    'drop',
    'outlines',
    'regions',
    'grey level',
)
"""Stages that the chain can do without, for the ablation."""

REGION_REDUCTION = 4
TEXTURE_BANDWIDTH = 3.0
MIN_PIXELS = 12
HOLE_SHARE = 0.5
STANDING_SHARE = 0.3
FULL_STEP_PX = 20.0
LEAST_SEEN_SHARE = 0.7
CERTAIN_SHARE = 1.5
CERTAIN_NOISE_SHARE = 0.15
CERTAIN_PIXELS = 40
DRAWN_SHARE = 0.3
UPRIGHT_RATIO = 1.5
OUTLINE_MARGIN = 24


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
    rocks = outlined_rocks(stereo, terrain, standing, config, learned='outlines' not in leave_out)
    finished('outlines')
    rough = rough_ground(terrain, rocks | steep | dropped, config)
    finished('roughness')
    segments = segment(stereo, terrain, config)
    finished('segmentation')
    near_rock, dark = complete_by_regions(rocks, terrain, segments, stereo, camera, config)
    near_rock &= 'regions' not in leave_out
    dark &= 'grey level' not in leave_out
    finished('regions')
    cues = np.uint8(Cue.HEIGHT) * rocks
    for cue, where in (
        (Cue.SLOPE, steep),
        (Cue.DROP, dropped),
        (Cue.ROUGHNESS_STEP, rough),
        (Cue.REGION, near_rock),
        (Cue.GREY_LEVEL, dark),
    ):
        cues += np.uint8(cue) * where
    obstacle = cues > 0
    obstacle &= ~small_parts(obstacle, MIN_PIXELS)
    if rover_mask is not None:
        obstacle &= ~rover_mask
    cues[~obstacle] = 0
    mask = np.where(obstacle, OBSTACLE, FREE).astype(np.uint8)
    finished('mask')
    return _detection(stereo, terrain, segments, cues, mask, rover_mask, pair[0], camera, config)


def outlined_rocks(
    stereo: Stereo,
    terrain: Terrain,
    standing: Standing,
    config: DetectorConfig,
    *,
    learned: bool = True,
) -> NDArray[np.bool_]:
    """Draw the outlines of what stands higher above the local ground than the rover can step.

    Parameters
    ----------
    stereo : Stereo
    terrain : Terrain
    standing : Standing
    config : DetectorConfig
    learned : bool
        Whether the filter draws them; else a threshold at half the height beside.

    Notes
    -----
    Disparity blurs outlines by the size of its blocks, and the foot of a rock is as high as the
    ground. The filter sees height, noise and grey level together. What it draws is an
    obstacle only with a core about as high as the step and over the noise, and only if it stands;
    and what stands far over both is one whatever the filter says.
    """
    if not standing.top_m.any():
        return np.zeros(stereo.disparity.shape, np.bool_)
    if learned:
        planes = outline_planes(terrain, stereo.noise_px, standing, stereo.pair[0], config)
        rocks = np.zeros(stereo.disparity.shape, np.bool_)
        window = around(planes[PLANES.index('standing part')] > 0, OUTLINE_MARGIN)
        probability = outline_model().probability(planes[(slice(None), *window)])
        rocks[window] = probability > config.outline_probability
        rocks |= denied_parts(rocks, terrain, standing, config)
    else:
        rocks = half_height_outlines(terrain, standing)
    height_m = np.asarray(cv2.blur(np.nan_to_num(terrain.height_m, nan=0.0), (3, 3)), np.float32)
    rocks |= high_holes(rocks, height_m, HOLE_SHARE * config.max_step)
    # Matching blocks flatten the tops of what is not much larger than they are.
    step_px = terrain.pixels_per_metre * np.float32(config.max_step)
    seen_share = np.clip(step_px / FULL_STEP_PX, LEAST_SEEN_SHARE, 1)
    core_m = np.maximum(
        config.core_share * seen_share * config.max_step, config.core_noises * terrain.noise_m
    )
    core = rocks & (height_m > core_m)
    count, labels = cv2.connectedComponents(rocks.astype(np.uint8), connectivity=8)
    inside = labels[terrain.measured]
    foot_m = min(FOOT_M, FOOT_SHARE * config.max_step)
    # Most of what was measured of an obstacle has to stand up: a core may touch a false outline.
    measured = np.bincount(inside, minlength=count)
    stands = np.bincount(labels[terrain.measured & (height_m > foot_m)], minlength=count)
    cores = np.bincount(labels[core], minlength=count)
    kept = (cores >= MIN_CORE_PIXELS) & (stands >= STANDING_SHARE * measured)
    kept[0] = False
    return np.asarray(kept[labels])


def denied_parts(
    rocks: NDArray[np.bool_], terrain: Terrain, standing: Standing, config: DetectorConfig
) -> NDArray[np.bool_]:
    """Find what stands so high over step and noise that the filter may not deny it.

    The filter has seen rocks, not the legs of a lander: what is upright. What is wider than high
    and not drawn is mostly ground that was taken for too low.
    """
    limit_m = CERTAIN_SHARE * config.max_step
    quiet = terrain.noise_m < CERTAIN_NOISE_SHARE * config.max_step
    high = terrain.measured & quiet & (terrain.height_m > limit_m)
    count = len(standing.top_m)
    pixels = np.bincount(standing.parts[high], minlength=count)
    drawn = np.bincount(standing.parts[high & rocks], minlength=count)
    certain = (pixels >= CERTAIN_PIXELS) & (drawn < DRAWN_SHARE * pixels)
    certain[0] = False
    return upright_parts(certain[standing.parts] & half_height_outlines(terrain, standing))


def upright_parts(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Keep the connected parts that are clearly higher than wide in the image."""
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    upright = boxes[:, cv2.CC_STAT_HEIGHT] >= UPRIGHT_RATIO * boxes[:, cv2.CC_STAT_WIDTH]
    upright[0] = False
    return np.asarray(upright[labels])


def around(where: NDArray[np.bool_], margin: int) -> tuple[slice, slice]:
    """Give the window of the image that holds all such pixels and a margin."""
    rows, columns = np.flatnonzero(where.any(1)), np.flatnonzero(where.any(0))
    return (
        slice(max(int(rows[0]) - margin, 0), int(rows[-1]) + margin + 1),
        slice(max(int(columns[0]) - margin, 0), int(columns[-1]) + margin + 1),
    )


def half_height_outlines(terrain: Terrain, standing: Standing) -> NDArray[np.bool_]:
    """Cut off what is under half as high as what stands just below it in the image.

    Above and beside a rock, where disparity blurs, height falls over a few pixels to that of the
    ground far behind; at its foot it does so for good reason.
    """
    height_m = np.nan_to_num(terrain.height_m, nan=0.0)
    kernel = np.zeros((11, 11), np.uint8)
    kernel[5:] = 1
    beside_m = cv2.dilate(height_m, kernel)
    return np.asarray((standing.parts > 0) & (height_m > 0.5 * beside_m))


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


def complete_by_regions(
    rocks: NDArray[np.bool_],
    terrain: Terrain,
    segments: Segments,
    stereo: Stereo,
    camera: StereoCamera,
    config: DetectorConfig,
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Find the pixels that only their region makes an obstacle: near a rock, or dark.

    A pixel without 3D in a seed region goes with the nearest measured pixel, if that is of the
    same region. A region without 3D, though the right eye sees it, is judged by its grey level.
    """
    matched = stereo.disparity > 0
    nearest = nearest_values(
        terrain.measured, rocks, segments.regions, OPENING_M / 2 * terrain.pixels_per_metre
    )
    dark = dark_regions(stereo.pair[0], segments.regions, segments.is_seed, config.dark_grey_level)
    column = np.arange(matched.shape[1], dtype=np.float32)[np.newaxis]
    right_column = column - stereo.expected - np.float32(camera.disparity_offset)
    shared_view = (right_column >= 0) & (right_column <= camera.width - 1)
    shared_view &= stereo.expected > camera.disparity_at(config.max_range)
    near_rock = nearest & segments.is_seed[segments.regions] & ~matched
    return near_rock, dark[segments.regions] & shared_view & ~matched


def _detection(
    stereo: Stereo,
    terrain: Terrain,
    segments: Segments,
    cues: NDArray[np.uint8],
    mask: NDArray[np.uint8],
    rover_mask: NDArray[np.bool_] | None,
    grey: NDArray[np.uint8],
    camera: StereoCamera,
    config: DetectorConfig,
) -> Detection:
    # What is made on request must not hold on to maps and planes: a node keeps detections.
    disparity, ground = stereo.disparity, stereo.ground
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
        products={
            'grey': grey,
            'disparity': disparity,
            'regions': regions,
            'seeds': lambda: is_seed[regions],
            'roughness': lambda: window_roughness(disparity, camera, config.window_size),
            'step': step,
            'height': height_m,
            'height_noise': noise_m,
            'cues': cues,
            'known': known,
            'mask': mask,
        },
    )
