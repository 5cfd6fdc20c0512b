"""Draw random scenes and print them as lines of a suite.

    python scripts/draw_scenes.py 2001 222 >> training.yaml

Rig, light, sensor and terrain vary continuously, so that a model trained on the scenes
generalises beyond the named rigs and conditions.
"""

from __future__ import annotations

import argparse
import math
import sys
from typing import Any

import numpy as np
from ruamel.yaml import YAML

from rover_obstacle_detection.simulation.presets import scene_of
from rover_obstacle_detection.simulation.rigs import RIGS

TERRAIN_WEIGHTS = {
    'noon': 6, 'moon': 2, 'slope_up_12': 2, 'slope_down_12': 2, 'slope_up_26': 1,
    'slope_down_26': 2, 'crater': 2, 'dunes': 2, 'dense_rocks': 4, 'pebbles': 3,
    'low_texture': 2,
}  # fmt: skip
SENSOR_WEIGHTS = {
    '': 5, 'dark_noisy': 2, 'over_exposed': 1, 'exposure_mismatch': 1, 'rectification_off': 1,
    'motion_blur': 1.5, 'dust_spots': 0.5,
}  # fmt: skip


def main() -> None:
    """Print the scenes of consecutive seeds."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('first', type=int, help='seed of the first scene')
    parser.add_argument('count', type=int, help='number of scenes')
    parser.add_argument('--prefix', default='train', help='prefix of the scene names')
    arguments = parser.parse_args()
    yaml = YAML()
    yaml.default_flow_style = True
    yaml.width = 10_000
    for seed in range(arguments.first, arguments.first + arguments.count):
        sys.stdout.write('  - ')
        yaml.dump(random_scene(seed, arguments.prefix), sys.stdout)


def random_scene(seed: int, prefix: str) -> dict[str, Any]:
    """Draw one scene, as an entry of a suite.

    Raises
    ------
    ConfigurationError
        If a drawn value is not allowed.
    """
    generator = np.random.default_rng(seed)

    def between(low: float, high: float) -> float:
        return float(generator.uniform(low, high))

    def log_between(low: float, high: float) -> float:
        return math.exp(between(math.log(low), math.log(high)))

    def one_of(weights: dict[str, float]) -> str:
        share = np.array(list(weights.values()))
        return str(generator.choice(list(weights), p=share / share.sum()))

    base = RIGS[str(generator.choice(list(RIGS)))]
    place, sensor = one_of(TERRAIN_WEIGHTS), one_of(SENSOR_WEIGHTS)
    height_m = round(base.camera_height_m * log_between(0.7, 1.4), 2)
    pitch_deg = round(base.pitch_deg * log_between(0.75, 1.3), 1)
    rig = {
        'width': int(generator.choice([512, 640, 640, 800])),
        'pitch_deg': pitch_deg,
        'camera_height_m': height_m,
        'baseline_m': round(base.baseline_m * log_between(0.7, 1.6), 3),
        'horizontal_view_deg': round(base.horizontal_view_deg * log_between(0.8, 1.15), 1),
    }
    light = {
        'sun_elevation_deg': round(log_between(6, 75), 1),
        'sun_azimuth_deg': round(between(-180, 180), 1),
        'sky': round(log_between(0.15, 0.5), 2),
    }
    if place == 'moon':
        light.pop('sky')
    terrain: dict[str, Any] = {'relief_m': round(log_between(0.006, 0.05), 4)}
    if place not in ('dunes', 'low_texture'):
        terrain['roughness_m'] = round(log_between(0.002, 0.009), 4)
        terrain['clods_m'] = round(log_between(0.0006, 0.006), 4)
    if place.startswith('slope'):
        view_m = height_m / math.tan(math.radians(pitch_deg))
        terrain['slope_start_m'] = round(max(view_m * between(0.7, 1.6), 0.9), 2)
        terrain['slope_turn_deg'] = round(between(-30, 30), 1)
    rocks: dict[str, Any] = {}
    if place != 'pebbles':
        rocks['placed'] = int(generator.integers(5, 15))
        rocks['placed_smallest_m'] = round(between(0.14, 0.3), 2)
        rocks['placed_largest_m'] = round(between(0.35, 0.8), 2)
    if place not in ('pebbles', 'dense_rocks'):
        rocks['cover'] = round(log_between(0.01, 0.2), 3)
    electronics: dict[str, Any] = {
        'blur_px': round(between(0.3, 0.9), 2),
        'vignetting': round(between(0, 0.4), 2),
    }
    if sensor != 'dark_noisy':
        electronics['full_well'] = round(log_between(2500, 20000))
    if sensor == 'motion_blur':
        electronics['motion_blur_px'] = round(between(2, 6), 1)
        electronics['motion_blur_deg'] = round(between(-90, 90), 1)
    parameters: dict[str, Any] = {
        **rig, 'terrain': terrain, 'rocks': rocks, 'light': light, 'sensor': electronics,
    }  # fmt: skip
    if place not in ('low_texture', 'moon'):
        parameters['soil'] = {'contrast': round(log_between(0.25, 1.3), 2)}
    scene = {
        'name': f'{prefix}_{seed}_{base.name}_{place}',
        'seed': seed,
        'rig': base.name,
        'conditions': [place, sensor] if sensor else [place],
        'parameters': parameters,
    }
    scene_of(**scene)
    return scene


if __name__ == '__main__':
    main()
