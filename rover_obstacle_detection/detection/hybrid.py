"""The hybrid method: terrain above the local ground, image regions where there is no 3D."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.camera import StereoCamera
from rover_obstacle_detection.detection.clearance import grown_from_cores, small_parts
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detection import FREE, OBSTACLE, Cue, Detection
from rover_obstacle_detection.detection.disparity import Penalties, penalties
from rover_obstacle_detection.detection.elevation_map import (
    Grid,
    MapPositions,
    cell_depths,
    cell_means,
    map_positions,
    sample_map,
)
from rover_obstacle_detection.detection.gravity import Gravity, GroundPlane
from rover_obstacle_detection.detection.grey_level import dark_regions
from rover_obstacle_detection.detection.ground_plane import DisparityPlane, estimate_ground
from rover_obstacle_detection.detection.image import GreyPair
from rover_obstacle_detection.detection.local_ground import local_ground, smoothed
from rover_obstacle_detection.detection.noise import DISPARITY_NOISE_PX, height_noise_m
from rover_obstacle_detection.detection.outline import guided_filter, texture_level, untextured
from rover_obstacle_detection.detection.regions import nearest_values, seed_regions
from rover_obstacle_detection.detection.reprojection import reproject
from rover_obstacle_detection.detection.segmentation import mean_shift_regions
from rover_obstacle_detection.detection.slope import dropped_cells, steep_cells
from rover_obstacle_detection.detection.terrain import (
    elevation_along,
    window_roughness,
    window_step,
)
from rover_obstacle_detection.detection.warped_matching import (
    coarse_disparity,
    residual_range,
    warped_disparity,
)

PENALTIES = Penalties(one=300, more=1200)
COARSE_REDUCTION = 4
REGION_REDUCTION = 4

# Scales of the terrain, in metres: what a wheel feels, what a rock is, what the ground does.
CELL_PER_STEP = 0.4
MAX_MAP_CELLS = 400
OPENING_M = 0.7
TREND_M = 0.4
SMOOTHING_M = 0.08
RELIEF_M = 0.10
WIDE_RELIEF_M = 0.30
QUIET_M = 0.01
NOISY_M = 0.03
DROP_SURROUNDINGS_M = 1.8

# Chosen, not derived: at 1.00 a 0.09 m rock on real gravel measured 0.10 m and was flagged.
CORE_SHARE = 1.05
NOISE_SHARE = 0.5
FOOT_M = 0.03
FOOT_NOISES = 2.0
MIN_CORE_PIXELS = 5
GROUND_SHARE = 0.5

MIN_TEXTURE = 2.0
TEXTURE_WINDOW = 9
TEXTURE_BANDWIDTH = 3.0
OUTLINE_RADIUS = 4


@dataclass(frozen=True, eq=False)
class Stereo:
    """Disparity at full resolution and the ground plane it was matched against."""

    ground: GroundPlane
    expected: NDArray[np.float32]
    disparity: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Terrain:
    """The scene at half resolution, in metres over the ground plane, and seen from above."""

    shared_view: NDArray[np.bool_]
    matched: NDArray[np.bool_]
    judged: NDArray[np.bool_]
    height_m: NDArray[np.float32]
    noise_m: NDArray[np.float32]
    positions: MapPositions
    pixels_per_metre: NDArray[np.float32]
    ground_map: Grid
    seen_cells: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Segments:
    """Mean-shift regions at half resolution and what is known of each."""

    regions: NDArray[np.int32]
    is_seed: NDArray[np.bool_]


def detect_hybrid(
    pair: GreyPair,
    camera: StereoCamera,
    config: DetectorConfig,
    gravity: Gravity | None,
    rover_mask: NDArray[np.bool_] | None,
    finished: Callable[[str], None],
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
    """
    stereo = match_against_ground(pair, camera, config, gravity, rover_mask, finished)
    terrain = survey(stereo, camera, config)
    finished('local ground')
    rocks = exceeds_clearance(terrain, config)
    steep, dropped = impassable_ground(terrain, stereo, camera, config)
    cues = (
        np.uint8(Cue.HEIGHT) * rocks + np.uint8(Cue.SLOPE) * steep + np.uint8(Cue.DROP) * dropped
    )
    finished('height, slope, drop')
    segments = segment(pair[0], terrain, config)
    finished('segmentation')
    near_rock, dark = complete_by_regions(rocks, terrain, segments, pair[0], config)
    cues += np.uint8(Cue.REGION) * near_rock + np.uint8(Cue.GREY_LEVEL) * dark
    finished('regions')
    mask = draw_outlines(cues > 0, terrain, pair[0], config)
    if rover_mask is not None:
        mask[rover_mask] = FREE
    finished('outlines')
    return _detection(stereo, terrain, segments, cues, mask, rover_mask, pair[0], camera, config)


def match_against_ground(
    pair: GreyPair,
    camera: StereoCamera,
    config: DetectorConfig,
    gravity: Gravity | None,
    rover_mask: NDArray[np.bool_] | None,
    finished: Callable[[str], None],
) -> Stereo:
    """Find the ground plane at a quarter of the resolution, then match relative to it."""
    penalty = penalties(config, PENALTIES)
    coarse = coarse_disparity(*pair, camera, config, penalty, COARSE_REDUCTION)
    if rover_mask is not None:
        coarse.disparity[_decimated(rover_mask, coarse.disparity.shape)] = 0
    finished('coarse disparity')
    ground = estimate_ground(coarse.disparity, coarse.camera, config, gravity)
    finished('ground plane')
    expected = DisparityPlane.from_ground(ground, camera).disparity(camera)
    search = residual_range(coarse, DisparityPlane.from_ground(ground, coarse.camera))
    disparity = warped_disparity(*pair, camera, np.maximum(expected, 0), search, config, penalty)
    # A bare sky takes the disparity of the hills before it; on the ground that is a fair guess.
    disparity[(expected <= 0) & untextured(pair[0], TEXTURE_WINDOW, MIN_TEXTURE)] = 0
    if rover_mask is not None:
        disparity[rover_mask] = 0
    finished('disparity')
    return Stereo(ground, expected, disparity)


def survey(stereo: Stereo, camera: StereoCamera, config: DetectorConfig) -> Terrain:
    """Measure the height of every second pixel and the ground under it."""
    half = camera.decimated(2)
    disparity = cv2.medianBlur(np.ascontiguousarray(stereo.disparity[::2, ::2]), 5)
    disparity = np.asarray(disparity, np.float32) * np.float32(0.5)
    expected = stereo.expected[::2, ::2] * np.float32(0.5)
    noise_m = height_noise_m(disparity, stereo.ground.height_m, DISPARITY_NOISE_PX / 2)
    cell_m = max(CELL_PER_STEP * config.max_step, config.max_range / MAX_MAP_CELLS)
    max_range_m = min(config.max_range, quiet_range_m(camera, stereo.ground.height_m, config))
    positions = map_positions(disparity, half, stereo.ground, cell_m, max_range_m)
    height_m = np.zeros_like(disparity)
    judged = positions.inside
    np.divide(
        np.float32(stereo.ground.height_m) * (disparity - expected),
        disparity,
        out=height_m,
        where=judged,
    )
    # A cell is trusted by its noise, down to what relief there is within a cell anyway.
    trust = np.zeros_like(height_m)
    np.divide(FOOT_M**2, FOOT_M**2 + noise_m * noise_m, out=trust, where=judged)
    # Ground is what could be driven up to: false matches in the sky would make some nearby.
    rise = math.tan(math.radians(config.max_slope))
    trust[height_m > rise * (positions.row + positions.first_row) * cell_m + config.max_step] = 0
    mean_m, weight = cell_means(height_m, trust, positions)
    ground_map = local_ground(
        mean_m,
        weight,
        cell_m,
        opening_m=OPENING_M,
        trend_m=TREND_M,
        smoothing_m=SMOOTHING_M,
        tolerance_m=GROUND_SHARE * config.max_step,
    )
    height_m -= sample_map(ground_map, positions)
    height_m[~judged] = np.nan
    column = np.arange(half.width, dtype=np.float32)[np.newaxis] - np.float32(
        half.disparity_offset
    )
    shared_view = (expected > 0) & (expected <= column)
    return Terrain(
        shared_view,
        disparity > 0,
        judged,
        height_m,
        noise_m,
        positions,
        disparity / np.float32(half.baseline_m),
        ground_map,
        weight > 0,
    )


def quiet_range_m(camera: StereoCamera, height_m: float, config: DetectorConfig) -> float:
    """Find how far away the noise of heights is still a small part of the rover's step."""
    return camera.depth_m(height_m * DISPARITY_NOISE_PX / (NOISE_SHARE * config.max_step))


def exceeds_clearance(terrain: Terrain, config: DetectorConfig) -> NDArray[np.bool_]:
    """Find what stands higher above the local ground than the rover can step."""
    foot_m = np.maximum(FOOT_M, FOOT_NOISES * terrain.noise_m)
    return grown_from_cores(
        terrain.height_m, CORE_SHARE * config.max_step, foot_m, MIN_CORE_PIXELS
    )


def impassable_ground(
    terrain: Terrain, stereo: Stereo, camera: StereoCamera, config: DetectorConfig
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Find ground that is too steep at rover scale, and ground that drops away."""
    cell_m = terrain.positions.cell_m
    relief_m = relief_at_rover_scale(terrain, stereo, camera)
    steep = steep_cells(relief_m, cell_m, stereo.ground, config.max_slope)
    dropped = dropped_cells(
        relief_m, terrain.seen_cells, cell_m, DROP_SURROUNDINGS_M, config.max_step
    )
    in_steep, in_dropped = (
        (sample_map(cells.astype(np.float32), terrain.positions) > 0.5) & terrain.judged
        for cells in (steep, dropped)
    )
    return in_steep, in_dropped


def relief_at_rover_scale(terrain: Terrain, stereo: Stereo, camera: StereoCamera) -> Grid:
    """Smooth the ground to what a rover feels, and wider where noise would look like a slope."""
    cell_m = terrain.positions.cell_m
    fine, wide = (
        smoothed(terrain.ground_map, (scale_m**2 - SMOOTHING_M**2) ** 0.5 / cell_m)
        for scale_m in (RELIEF_M, WIDE_RELIEF_M)
    )
    depth_m = cell_depths(terrain.positions, stereo.ground)
    noise_m = depth_m * (stereo.ground.height_m * DISPARITY_NOISE_PX / camera.disparity_at(1.0))
    share = np.clip((noise_m - QUIET_M) / (NOISY_M - QUIET_M), 0, 1)
    return np.asarray(fine + share * (wide - fine), np.float32)


def segment(grey: NDArray[np.uint8], terrain: Terrain, config: DetectorConfig) -> Segments:
    """Divide the image into mean-shift regions, and find which of them are seeds.

    The grey-level bandwidth follows the texture: ground of one kind should be one region.
    """
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
        cv2.resize(regions, terrain.judged.shape[::-1], interpolation=cv2.INTER_NEAREST), np.int32
    )
    # Half resolution has a quarter of the points.
    is_seed = seed_regions(regions, terrain.matched, max(1, config.min_seed_points // 4))
    return Segments(regions, is_seed)


def complete_by_regions(
    rocks: NDArray[np.bool_],
    terrain: Terrain,
    segments: Segments,
    grey: NDArray[np.uint8],
    config: DetectorConfig,
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Find the pixels that only their region makes an obstacle: near a rock, or dark.

    A pixel without 3D in a seed region goes with the nearest judged pixel, if that is of the same
    region. A region without 3D, though the right eye sees it, is judged by its grey level.
    """
    nearest = nearest_values(
        terrain.judged, rocks, segments.regions, OPENING_M / 2 * terrain.pixels_per_metre
    )
    dark = dark_regions(grey[::2, ::2], segments.regions, segments.is_seed, config.dark_grey_level)
    near_rock = nearest & segments.is_seed[segments.regions] & ~terrain.matched
    return near_rock, dark[segments.regions] & terrain.shared_view & ~terrain.matched


def draw_outlines(
    obstacle: NDArray[np.bool_],
    terrain: Terrain,
    grey: NDArray[np.uint8],
    config: DetectorConfig,
) -> NDArray[np.uint8]:
    """Bring the map to the image's outlines and to full resolution."""
    small = np.ascontiguousarray(grey[::2, ::2])
    soft = guided_filter(
        small, obstacle.astype(np.float32), OUTLINE_RADIUS, 0.5 * texture_level(small)
    )
    with np.errstate(invalid='ignore'):
        core = obstacle & (terrain.height_m > CORE_SHARE * config.max_step)
    soft[core] = 1.0
    soft[small_parts(soft > 0.5, MIN_CORE_PIXELS)] = 0.0
    full = _at_full_resolution(soft, grey.shape)
    return (full > 0.5).astype(np.uint8) * np.uint8(OBSTACLE)


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
    shape = camera.shape

    def large(image: NDArray[np.generic]) -> NDArray[np.generic]:
        return np.repeat(np.repeat(image, 2, axis=0), 2, axis=1)[: shape[0], : shape[1]]

    def height() -> NDArray[np.float32]:
        return np.asarray(large(terrain.height_m), np.float32)

    def step() -> NDArray[np.float32]:
        elevation_m = elevation_along(reproject(stereo.disparity, camera), stereo.ground.up_vector)
        return window_step(elevation_m, config.window_size)

    def known() -> NDArray[np.bool_]:
        found = large(terrain.judged | (cues > 0)) | (mask == OBSTACLE)
        return np.asarray(found if rover_mask is None else found & ~rover_mask)

    return Detection(
        camera=camera,
        config=config,
        ground=stereo.ground,
        products={
            'grey': grey,
            'disparity': stereo.disparity,
            'regions': lambda: large(segments.regions),
            'seeds': lambda: large(segments.is_seed[segments.regions]),
            'roughness': lambda: window_roughness(stereo.disparity, camera, config.window_size),
            'step': step,
            'height': height,
            'height_noise': lambda: large(terrain.noise_m),
            'cues': lambda: large(cues),
            'known': known,
            'mask': mask,
        },
    )


def _at_full_resolution(image: NDArray[np.float32], shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Interpolate between every second pixel, which stand at the even places."""
    return np.asarray(
        cv2.warpAffine(
            image,
            np.array([[0.5, 0, 0], [0, 0.5, 0]], np.float32),
            (shape[1], shape[0]),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        ),
        np.float32,
    )


def _decimated(mask: NDArray[np.bool_], shape: tuple[int, ...]) -> NDArray[np.bool_]:
    small = cv2.resize(mask.astype(np.float32), shape[::-1], interpolation=cv2.INTER_AREA)
    return np.asarray(small > 0.5)
