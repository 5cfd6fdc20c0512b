"""Hazards of the ground itself: drops, steps, slopes; and ground that must stay free."""

from __future__ import annotations

import math
from collections.abc import Iterator

import ground_hazards as make
from hazard_scene import HazardScene
from scene_parts import FAR_M, RIGS, level, make_scene
from surfaces import Light, Look, Shadow


def drops() -> Iterator[HazardScene]:
    for name, depth_m, distance_m, yaw_deg in (
        ('rover', 0.3, 1.5, 0),
        ('rover', 0.5, 2.0, 30),
        ('rover', 0.8, 2.5, 0),
        ('rover', 2.0, 3.0, -25),
        ('low', 0.3, 1.0, 20),
        ('low', 0.5, 1.6, 0),
        ('low', 0.8, 2.2, -40),
        ('mast', 0.5, 2.2, -20),
        ('mast', 0.8, 4.0, 0),
        ('mast', 2.0, 3.0, 35),
        ('wide', 0.3, 1.2, 0),
        ('wide', 2.0, 1.5, 25),
        ('study', 0.5, 1.2, 0),
        ('study', 0.3, 1.0, 30),
        ('car', 0.8, 5.0, 0),
    ):
        yield make.drop(RIGS[name], depth_m, distance_m, yaw_deg)
    for name, depth_m, distance_m, yaw_deg in (
        ('rover', 0.15, 1.2, 0),
        ('rover', 0.30, 2.0, 20),
        ('low', 0.15, 0.9, -20),
        ('low', 0.30, 1.5, 0),
        ('mast', 0.15, 2.0, 0),
        ('wide', 0.30, 1.0, 0),
        ('study', 0.15, 1.0, 0),
    ):
        yield make.drop(RIGS[name], depth_m, distance_m, yaw_deg, what='drop_kerb')
    for name, distance_m, yaw_deg in (
        ('rover', 2.0, 0),
        ('low', 1.2, 25),
        ('mast', 3.5, 0),
        ('wide', 1.0, -30),
        ('study', 1.3, 0),
    ):
        yield make.cliff(RIGS[name], distance_m, yaw_deg)
    for name, distance_m, yaw_deg in (('rover', 1.6, 0), ('low', 1.2, -20), ('mast', 3.0, 10)):
        yield make.cliff_before_hills(RIGS[name], distance_m, yaw_deg)
    for name, distance_m, rise_m, tread_m in (
        ('rover', 1.5, 0.17, 0.28),
        ('low', 1.2, 0.15, 0.30),
        ('mast', 2.5, 0.18, 0.27),
        ('wide', 0.9, 0.17, 0.30),
    ):
        yield make.stairs_down(RIGS[name], distance_m, rise_m, tread_m)
    for name, depth_m, width_m, distance_m, yaw_deg in (
        ('rover', 0.5, 0.8, 1.5, 0),
        ('rover', 1.0, 0.5, 2.2, 15),
        ('rover', 0.3, 1.0, 1.4, 0),
        ('mast', 0.4, 1.2, 2.0, 0),
        ('mast', 0.8, 0.6, 3.0, -20),
        ('low', 0.25, 0.7, 1.0, 0),
        ('low', 0.6, 0.4, 1.4, 0),
        ('wide', 0.3, 0.6, 0.9, 20),
        ('study', 0.3, 0.5, 1.0, 0),
    ):
        yield make.trench(RIGS[name], depth_m, width_m, distance_m, yaw_deg)


def harmless() -> Iterator[HazardScene]:
    for name, distance_m in (('rover', 1.8), ('low', 1.2), ('mast', 2.5), ('wide', 1.0)):
        fall = math.tan(math.radians(10))
        points = [(-FAR_M, 0.0), (distance_m, 0.0), (FAR_M, (distance_m - FAR_M) * fall)]
        yield make.free_ground('ramp_down_10', RIGS[name], points)
    for name, distance_m, step_m, yaw_deg in (
        ('rover', 1.5, -0.05, 0),
        ('low', 1.0, -0.05, 20),
        ('mast', 2.2, -0.05, 0),
        ('study', 1.0, -0.05, 0),
        ('rover', 1.5, 0.05, 0),
        ('wide', 1.0, 0.05, 0),
    ):
        points = make.step(step_m, distance_m)
        yield make.free_ground(f'kerb_{step_m:+.2f}', RIGS[name], points, yaw_deg)
    for name, crest_m, rise_deg in (
        ('rover', 2.5, 5.0),
        ('low', 1.8, 4.0),
        ('mast', 3.5, 6.0),
        ('wide', 1.6, 5.0),
    ):
        yield make.free_ground('crest', RIGS[name], make.hill(rise_deg, crest_m))
    for name, distance_m, angle_deg in (
        ('rover', 1.8, 12),
        ('mast', 2.5, 12),
        ('low', 1.2, -12),
        ('study', 1.0, 12),
    ):
        points = make.bank(angle_deg, distance_m)
        yield make.free_ground(f'slope_{angle_deg:+d}', RIGS[name], points)
    for rig in RIGS.values():
        yield make_scene('free_level', rig, level(), float('nan'))
    for name in ('rover', 'mast', 'study'):
        # The rover's own shadow on sand with hardly any texture.
        light = Light(noise=1.0, shadows=(Shadow((-0.4, 0.4), (0.0, 1.6), 0.4),))
        sand = level(look=Look(170.0, 0.02))
        yield make_scene('free_shadow_on_sand', RIGS[name], sand, 1.0).with_(light=light)


def steps_up() -> Iterator[HazardScene]:
    for name, step_m, distance_m, yaw_deg in (
        ('rover', 0.15, 1.5, 0),
        ('rover', 0.25, 2.5, 30),
        ('rover', 0.40, 2.0, 0),
        ('low', 0.15, 1.0, 0),
        ('low', 0.25, 1.8, -25),
        ('mast', 0.15, 2.0, 20),
        ('mast', 0.40, 3.5, -30),
        ('wide', 0.20, 1.0, 0),
        ('study', 0.15, 1.0, 0),
        ('study', 0.30, 1.2, 35),
        ('car', 0.25, 5.0, 0),
    ):
        yield make.ledges(RIGS[name], [step_m], distance_m, yaw_deg=yaw_deg)
    for name, step_m, distance_m, tread_m, yaw_deg in (
        ('rover', 0.15, 1.4, 0.9, 0),
        ('mast', 0.20, 2.0, 1.2, 15),
        ('low', 0.15, 1.0, 0.8, -20),
        ('study', 0.20, 0.9, 0.7, 0),
    ):
        steps = [step_m] * 3
        yield make.ledges(RIGS[name], steps, distance_m, tread_m, yaw_deg, what='step_terraces')


def slopes() -> Iterator[HazardScene]:
    for name, angle_deg, distance_m, yaw_deg in (
        ('rover', 28, 1.5, 0),
        ('rover', 35, 2.5, 25),
        ('rover', 46, 2.0, 0),
        ('low', 28, 1.0, 0),
        ('low', 46, 1.5, -20),
        ('mast', 28, 2.5, 0),
        ('mast', 35, 3.5, -30),
        ('wide', 35, 1.0, 0),
        ('study', 28, 1.0, 0),
        ('car', 28, 5.0, 0),
        ('rover', -28, 1.5, 0),
        ('rover', -35, 2.5, 20),
        ('rover', -46, 2.0, 0),
        ('low', -28, 1.0, 0),
        ('low', -35, 1.4, -25),
        ('mast', -28, 1.8, 0),
        ('mast', -28, 1.4, 0),
        ('mast', -46, 2.5, 0),
        ('wide', -35, 1.0, 0),
        ('study', -28, 1.0, 0),
        ('study', -35, 0.9, 0),
    ):
        yield make.slope(RIGS[name], angle_deg, distance_m, yaw_deg)
