"""Named conditions: parameter changes relative to the default scene."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from typing import Any

from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.simulation.description import Scene
from rover_obstacle_detection.simulation.hazard_presets import HAZARD_PRESETS
from rover_obstacle_detection.simulation.preset import Changes, Preset, for_any_rig
from rover_obstacle_detection.simulation.rigs import RIGS, Rig


def _slope(slope_deg: float) -> Changes:
    return lambda rig: {
        'terrain': {
            'slope_deg': slope_deg,
            'slope_start_m': round(max(0.9 * rig.view_distance_m, 0.9), 2),
            'slope_length_m': 12.0,
        }
    }


def _crater(rig: Rig) -> Mapping[str, Any]:
    centre = max(1.5 * rig.view_distance_m, 1.9)
    return {
        'terrain': {
            'craters': [
                {'ahead_m': round(centre, 2), 'left_m': 0.3, 'diameter_m': 2.2, 'depth_m': 0.36},
                {
                    'ahead_m': round(1.7 * centre, 2),
                    'left_m': round(-0.55 * centre, 2),
                    'diameter_m': 1.4,
                    'depth_m': 0.22,
                },
            ]
        },
        'light': {'sun_elevation_deg': 32.0},
        'rocks': {'placed': 5},
    }


PRESETS: Mapping[str, Preset] = {
    'noon': Preset('high sun, rocks on gentle relief', for_any_rig()),
    'low_sun_towards': Preset(
        'sun 8 degrees high, ahead: shadows towards the rover',
        for_any_rig(
            light={'sun_elevation_deg': 8.0, 'sun_azimuth_deg': 12.0}, sensor={'glare': 0.08}
        ),
    ),
    'low_sun_across': Preset(
        'sun 9 degrees high, left: long shadows across the view',
        for_any_rig(light={'sun_elevation_deg': 9.0, 'sun_azimuth_deg': 85.0}),
    ),
    'low_sun_away': Preset(
        'sun 8 degrees high, behind: flat light, few visible shadows',
        for_any_rig(light={'sun_elevation_deg': 8.0, 'sun_azimuth_deg': 160.0}),
    ),
    'moon': Preset(
        'no atmosphere: black sky, black shadows, grey soil',
        for_any_rig(
            soil={'world': 'moon'},
            light={'sun_elevation_deg': 12.0, 'sun_azimuth_deg': 110.0},
            rocks={'placed': 9},
            sensor={'samples': 36},
        ),
    ),
    'slope_up_12': Preset('uphill 12 degrees: free ground', _slope(12.0)),
    'slope_down_12': Preset('downhill 12 degrees: free ground', _slope(-12.0)),
    'slope_up_26': Preset('uphill 26 degrees: an obstacle', _slope(26.0)),
    'slope_down_26': Preset('downhill 26 degrees: an obstacle', _slope(-26.0)),
    'crater': Preset('small craters: steep walls and a drop', _crater),
    'dunes': Preset(
        'low dunes with wind ripples',
        for_any_rig(
            terrain={
                'dune_height_m': 0.28,
                'dune_length_m': 8.0,
                'ripple_height_m': 0.025,
                'ripple_length_m': 0.28,
                'roughness_m': 0.003,
                'clods_m': 0.0008,
            },
            light={'sun_elevation_deg': 28.0, 'sun_azimuth_deg': 40.0},
            rocks={'cover': 0.015, 'placed': 6},
        ),
    ),
    'dense_rocks': Preset(
        'rocks on a third of the ground',
        for_any_rig(rocks={'cover': 0.33, 'pebble_cover': 0.03, 'placed': 14}),
    ),
    'pebbles': Preset(
        'many pebbles, none an obstacle',
        for_any_rig(
            rocks={
                'cover': 0.15,
                'largest_m': 0.08,
                'pebble_cover': 0.14,
                'placed': 14,
                'placed_smallest_m': 0.05,
                'placed_largest_m': 0.1,
            }
        ),
    ),
    'low_texture': Preset(
        'fine sand with almost no texture',
        for_any_rig(
            soil={'contrast': 0.12, 'grain_m': 0.0001},
            terrain={'clods_m': 0.0004, 'roughness_m': 0.003},
            rocks={'cover': 0.02},
        ),
    ),
    'dark_noisy': Preset(
        'dim light and a noisy sensor',
        for_any_rig(
            light={'sun_elevation_deg': 15.0, 'sun_azimuth_deg': 60.0},
            sensor={'exposure': 0.3, 'full_well': 1500.0, 'read_noise': 12.0},
        ),
    ),
    'over_exposed': Preset(
        'exposure too long: bright ground saturates', for_any_rig(sensor={'exposure': 2.6})
    ),
    'exposure_mismatch': Preset(
        'right image exposed a third less than the left', for_any_rig(sensor={'right_gain': 0.65})
    ),
    'rectification_off': Preset(
        'right image 0.5 px too high and rolled 0.03 degrees',
        for_any_rig(sensor={'row_error_px': 0.5, 'roll_error_deg': 0.03}),
    ),
    'motion_blur': Preset(
        'five pixels of motion blur',
        for_any_rig(sensor={'motion_blur_px': 5.0, 'motion_blur_deg': 75.0}),
    ),
    'dust_spots': Preset('dust on both lenses', for_any_rig(sensor={'dust_spots': 45})),
    'empty_flat': Preset(
        'flat ground without rocks',
        for_any_rig(
            terrain={'relief_m': 0.004, 'hills_m': 1.0},
            rocks={'cover': 0.02, 'largest_m': 0.03, 'placed': 0},
        ),
    ),
    **HAZARD_PRESETS,
}


def scene_of(
    name: str,
    seed: int,
    conditions: Iterable[str] = (),
    rig: str = 'study',
    parameters: Mapping[str, Any] | None = None,
) -> Scene:
    """Make a scene from conditions and parameters; later ones override earlier ones.

    Raises
    ------
    ConfigurationError
        If a condition, rig or parameter is unknown, or a value is out of range.
    """
    if rig not in RIGS:
        msg = f'rig is {rig!r}: expected one of {", ".join(RIGS)}'
        raise ConfigurationError(msg)
    mapping: dict[str, Any] = {}
    names = tuple(conditions)
    for condition in names:
        if condition not in PRESETS:
            near = difflib.get_close_matches(condition, PRESETS, 1)
            hint = f'; did you mean {near[0]}?' if near else ''
            msg = f'unknown condition {condition!r}{hint} (expected one of {", ".join(PRESETS)})'
            raise ConfigurationError(msg)
        mapping = overlay(mapping, PRESETS[condition].changes(RIGS[rig]))
    mapping = overlay(mapping, parameters or {})
    fixed = {'name': name, 'seed': seed, 'conditions': names, 'rig': rig}
    return Scene.from_mapping({**mapping, **fixed})


def overlay(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Merge nested mappings; `changes` overrides `base`."""
    merged = dict(base)
    for name, value in changes.items():
        old = merged.get(name)
        both = isinstance(old, Mapping) and isinstance(value, Mapping)
        merged[name] = overlay(old, value) if both else value  # type: ignore[arg-type]
    return merged
