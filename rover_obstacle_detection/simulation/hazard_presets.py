"""Conditions with ledges, cliffs, trenches, plates, tracks, unusual rocks, light and cameras."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rover_obstacle_detection.simulation.preset import Changes, Preset, for_any_rig
from rover_obstacle_detection.simulation.rigs import Rig

_NEAREST_EDGE_M = 1.1
"""Edges stay clear of the wheels."""


def _edge_m(rig: Rig, share: float) -> float:
    """Return a distance ahead, relative to where the optical axis meets the ground."""
    return round(max(share * rig.view_distance_m, _NEAREST_EDGE_M), 2)


def _steps(share: float, *steps: Mapping[str, float]) -> Changes:
    """Place steps; their `ahead_m` is relative to the first one."""

    def changes(rig: Rig) -> Mapping[str, Any]:
        first = _edge_m(rig, share)
        placed = [
            {**step, 'ahead_m': round(first + step.get('ahead_m', 0.0), 2)} for step in steps
        ]
        return {'terrain': {'steps': placed}}

    return changes


HAZARD_PRESETS: Mapping[str, Preset] = {
    'ledge_up': Preset(
        'rock ledge 0.25 m up across the view: an obstacle',
        _steps(1.1, {'rise_m': 0.25, 'turn_deg': 20.0}),
    ),
    'ledge_down': Preset(
        'rock ledge 0.3 m down across the view: its edge is an obstacle',
        _steps(1.0, {'rise_m': -0.3, 'turn_deg': -15.0}),
    ),
    'cliff': Preset(
        'cliff 1.2 m down across the view: its edge is an obstacle',
        _steps(1.0, {'rise_m': -1.2, 'turn_deg': 12.0, 'run_m': 0.12, 'waviness_m': 0.12}),
    ),
    'trench': Preset(
        'trench 0.5 m wide and 0.4 m deep across the view: an obstacle',
        _steps(1.0, {'rise_m': -0.4, 'width_m': 0.5, 'turn_deg': 25.0}),
    ),
    'terraces': Preset(
        'three terraces up, each 0.16 m high',
        _steps(
            0.9,
            {'rise_m': 0.16, 'turn_deg': -10.0, 'waviness_m': 0.1},
            {'rise_m': 0.16, 'turn_deg': -4.0, 'ahead_m': 0.7, 'waviness_m': 0.1},
            {'rise_m': 0.16, 'turn_deg': -14.0, 'ahead_m': 1.5, 'waviness_m': 0.1},
        ),
    ),
    'stairs_down': Preset(
        'three steps down, each 0.2 m high',
        _steps(
            1.0,
            {'rise_m': -0.2, 'waviness_m': 0.02},
            {'rise_m': -0.2, 'ahead_m': 0.6, 'waviness_m': 0.02},
            {'rise_m': -0.2, 'ahead_m': 1.2, 'waviness_m': 0.02},
        ),
    ),
    'gully': Preset(
        'winding gully 0.35 m deep with sloping walls: an obstacle',
        _steps(
            1.0,
            {
                'rise_m': -0.35,
                'width_m': 0.8,
                'run_m': 0.3,
                'waviness_m': 0.18,
                'turn_deg': -30.0,
            },
        ),
    ),
    'dike': Preset(
        'wall of rock 0.25 m high and 0.5 m thick across the view: an obstacle',
        _steps(1.1, {'rise_m': 0.25, 'width_m': 0.5, 'turn_deg': -35.0, 'waviness_m': 0.03}),
    ),
    'canyon_rim': Preset(
        'rounded rim on the left of the way and ground 1.5 m below: an obstacle',
        _steps(
            1.3,
            {
                'rise_m': -1.5,
                'run_m': 0.5,
                'turn_deg': 62.0,
                'waviness_m': 0.15,
            },
        ),
    ),
    'layered_outcrop': Preset(
        'layers of rock that crop out as ledges 0.14 m high',
        for_any_rig(terrain={'layer_m': 0.14, 'layer_relief_m': 0.14}),
    ),
    'fractured_bedrock': Preset(
        'broken plates of bedrock up to 0.2 m above the soil',
        for_any_rig(
            terrain={
                'plate_size_m': 0.8,
                'plate_cover': 0.55,
                'plate_height_m': 0.2,
                'plate_tilt_deg': 4.0,
                'crack_width_m': 0.06,
                'crack_depth_m': 0.05,
            }
        ),
    ),
    'cracked_mud': Preset(
        'dry mud in polygons with cracks 2 cm deep: free ground',
        for_any_rig(
            terrain={
                'plate_size_m': 0.22,
                'plate_height_m': 0.006,
                'plate_tilt_deg': 0.8,
                'crack_width_m': 0.025,
                'crack_depth_m': 0.02,
                'clods_m': 0.0006,
            },
            rocks={'placed': 3},
        ),
    ),
    'ripples': Preset(
        'wind ripples 4 cm high: free ground',
        for_any_rig(
            terrain={'ripple_height_m': 0.04, 'ripple_length_m': 0.36, 'clods_m': 0.0008},
            rocks={'cover': 0.02, 'placed': 4},
            light={'sun_elevation_deg': 30.0, 'sun_azimuth_deg': 35.0},
        ),
    ),
    'wheel_tracks': Preset(
        'wheel tracks 5 cm deep: free ground',
        for_any_rig(terrain={'track_depth_m': 0.05, 'track_turn_deg': 8.0}, rocks={'placed': 4}),
    ),
    'slabs': Preset(
        'thin upright plates of rock',
        for_any_rig(rocks={'slabs': 0.85, 'placed': 12, 'cover': 0.03, 'placed_smallest_m': 0.2}),
    ),
    'angular_rocks': Preset(
        'rocks with flat faces and sharp edges',
        for_any_rig(rocks={'angular': 1.0, 'placed': 10}),
    ),
    'dark_rocks': Preset(
        'black rocks without dust', for_any_rig(rocks={'tone': 0.3, 'dust': 0.2, 'placed': 10})
    ),
    'albedo_patches': Preset(
        'dark patches with sharp outlines: free ground', for_any_rig(soil={'patch_cover': 0.35})
    ),
    'black_shadow': Preset(
        'shadow of a cliff outside the view, with almost no skylight',
        lambda rig: {
            'light': {
                'sun_elevation_deg': 24.0,
                'sun_azimuth_deg': 125.0,
                'sky': 0.015,
                'shade_m': round(1.6 * rig.view_distance_m, 2),
                'shade_ahead_m': _edge_m(rig, 1.2),
                'shade_left_m': round(0.3 * rig.view_distance_m, 2),
            },
            'rocks': {'placed': 10},
        },
    ),
    'consumer_camera': Preset(
        'strong vignetting, sharpening and JPEG compression',
        for_any_rig(
            sensor={
                'vignetting': 0.55,
                'sharpening': 0.8,
                'jpeg_quality': 70,
                'right_gain': 1.15,
                'gamma': 1.8,
            }
        ),
    ),
    'right_blurred': Preset(
        'right lens slightly out of focus', for_any_rig(sensor={'right_blur_px': 0.9})
    ),
}
