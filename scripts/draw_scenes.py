"""Draw random scenes and print them as lines of a suite.

    python scripts/draw_scenes.py 2001 222 >> training.yaml
    python scripts/draw_scenes.py 5001 120 --wide --prefix wide >> training_wide.yaml

Rig, light, sensor and terrain vary continuously, so that a model trained on the scenes
generalises beyond the named rigs and conditions. With ``--wide``, the scenes have ledges,
cliffs, trenches, plates, tracks, black shadows and unusual rocks and cameras.
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
LANDFORM_WEIGHTS = {
    'ledge_up': 5, 'ledge_down': 5, 'cliff': 5, 'trench': 5, 'fractured_bedrock': 3,
    'cracked_mud': 2, 'ripples': 1, 'wheel_tracks': 2, 'slabs': 2, '': 3,
}  # fmt: skip
"""Without the kinds of ground of the scenes hazard_report_*."""


def main() -> None:
    """Print the scenes of consecutive seeds."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('first', type=int, help='seed of the first scene')
    parser.add_argument('count', type=int, help='number of scenes')
    parser.add_argument('--prefix', default='train', help='prefix of the scene names')
    parser.add_argument('--wide', action='store_true', help='edges, shadows, unusual cameras')
    arguments = parser.parse_args()
    draw = random_wide_scene if arguments.wide else random_scene
    yaml = YAML()
    yaml.default_flow_style = True
    yaml.width = 10_000
    for seed in range(arguments.first, arguments.first + arguments.count):
        sys.stdout.write('  - ')
        yaml.dump(draw(seed, arguments.prefix), sys.stdout)


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


def random_wide_scene(seed: int, prefix: str) -> dict[str, Any]:
    """Draw a scene with edges, shadows, unusual rocks or an unusual camera.

    Raises
    ------
    ConfigurationError
        If a drawn value is not allowed.
    """
    generator = np.random.default_rng([seed, 1])
    scene = random_scene(seed, prefix)
    parameters = scene['parameters']
    place = scene['conditions'][0]
    if place.startswith('slope') or place in ('crater', 'dunes', 'pebbles'):
        scene['conditions'][0] = 'noon'
        for name in ('slope_start_m', 'slope_turn_deg'):
            parameters['terrain'].pop(name, None)
    share = np.array(list(LANDFORM_WEIGHTS.values()))
    landform = str(generator.choice(list(LANDFORM_WEIGHTS), p=share / share.sum()))
    extra = [name for name in ('dark_rocks', 'albedo_patches') if generator.uniform() < 0.2]
    scene['conditions'][1:1] = [landform, *extra] if landform else extra
    view_m = parameters['camera_height_m'] / math.tan(math.radians(parameters['pitch_deg']))
    parameters['terrain'].update(_landform(landform, view_m, generator))
    _vary_rocks_and_light(parameters, scene['conditions'][0] == 'moon', view_m, generator)
    _vary_camera(parameters['sensor'], generator)
    scene['name'] = f'{prefix}_{seed}_{scene["rig"]}_{landform or "rocks"}'
    scene_of(**scene)
    return scene


def _landform(kind: str, view_m: float, generator: np.random.Generator) -> dict[str, Any]:
    """Return terrain parameters that vary a condition."""

    def between(low: float, high: float) -> float:
        return round(float(generator.uniform(low, high)), 3)

    def log_between(low: float, high: float) -> float:
        return round(math.exp(generator.uniform(math.log(low), math.log(high))), 3)

    if kind == 'fractured_bedrock':
        return {
            'plate_size_m': log_between(0.5, 1.4),
            'plate_cover': between(0.35, 0.8),
            'plate_height_m': log_between(0.08, 0.32),
            'plate_tilt_deg': between(1, 7),
            'crack_width_m': log_between(0.03, 0.1),
            'crack_depth_m': log_between(0.02, 0.09),
        }
    if kind == 'cracked_mud':
        return {
            'plate_size_m': log_between(0.1, 0.35),
            'crack_width_m': log_between(0.012, 0.035),
            'crack_depth_m': log_between(0.01, 0.03),
        }
    if kind == 'ripples':
        length_m = between(0.22, 0.45)
        return {'ripple_length_m': length_m, 'ripple_height_m': round(0.1 * length_m, 3)}
    if kind == 'wheel_tracks':
        return {
            'track_depth_m': between(0.03, 0.06),
            'track_width_m': between(0.1, 0.2),
            'track_left_m': between(-0.6, 0.6),
            'track_turn_deg': between(-25, 25),
        }
    rise = {
        'ledge_up': lambda: log_between(0.1, 0.45),
        'ledge_down': lambda: -log_between(0.1, 0.5),
        'cliff': lambda: -log_between(0.5, 2.2),
        'trench': lambda: -log_between(0.18, 0.7),
    }
    if kind not in rise:
        return {}
    step = {
        'ahead_m': round(max(view_m * log_between(0.65, 1.7), 1.0), 2),
        'turn_deg': between(-55, 55),
        'rise_m': rise[kind](),
        'run_m': log_between(0.02, 0.15),
        'waviness_m': log_between(0.01, 0.14),
    }
    if kind == 'trench':
        step['width_m'] = between(0.3, 0.9)
    return {'steps': [step]}


def _vary_rocks_and_light(
    parameters: dict[str, Any], moon: bool, view_m: float, generator: np.random.Generator
) -> None:
    rocks, light = parameters['rocks'], parameters['light']
    if generator.uniform() < 0.3:
        rocks['angular'] = round(float(generator.uniform(0.3, 1)), 2)
    if generator.uniform() < 0.2:
        rocks['slabs'] = round(float(generator.uniform(0.2, 0.8)), 2)
    if generator.uniform() < 0.35:
        # A lower sun would put what casts the shadow into the view.
        light['sun_elevation_deg'] = round(float(generator.uniform(18, 60)), 1)
        light['shade_m'] = round(view_m * float(generator.uniform(0.8, 2.2)), 2)
        light['shade_ahead_m'] = round(view_m * float(generator.uniform(0.8, 1.8)), 2)
        light['shade_left_m'] = round(view_m * float(generator.uniform(-0.6, 0.6)), 2)
        if not moon:
            light['sky'] = round(math.exp(generator.uniform(math.log(0.01), math.log(0.3))), 3)


def _vary_camera(sensor: dict[str, Any], generator: np.random.Generator) -> None:
    if generator.uniform() < 0.3:
        sensor['jpeg_quality'] = int(generator.integers(55, 96))
    if generator.uniform() < 0.3:
        sensor['sharpening'] = round(float(generator.uniform(0.2, 1.5)), 2)
    if generator.uniform() < 0.4:
        sensor['gamma'] = round(float(generator.uniform(1.0, 2.8)), 2)
    if generator.uniform() < 0.3:
        sensor['right_gain'] = round(math.exp(generator.uniform(-0.3, 0.3)), 2)
    if generator.uniform() < 0.2:
        sensor['right_blur_px'] = round(float(generator.uniform(0.3, 1.1)), 2)
    sensor['vignetting'] = round(float(generator.uniform(0, 0.6)), 2)


if __name__ == '__main__':
    main()
