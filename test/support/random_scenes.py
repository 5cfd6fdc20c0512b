"""Hazard scenes drawn at random: other rigs, distances, angles, light and noise than the list's.

The same seed gives the same scenes, whatever number is asked for.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import ground_hazards as make
import numpy as np
from hazard_scene import HazardScene
from scene_parts import ROCK, box, dome, level, make_scene, wall
from surfaces import Light, Look, Rig


def random_scenes(count: int, seed: int = 0) -> tuple[HazardScene, ...]:
    return tuple(_draw(number, np.random.default_rng((seed, number))) for number in range(count))


def _draw(number: int, rng: np.random.Generator) -> HazardScene:
    make_one = _MAKERS[number % len(_MAKERS)]
    rig = random_rig(rng)
    # Between what the lowest rows show and what still counts.
    lowest = math.radians(rig.pitch_deg) + math.atan(rig.height / 2 / rig.focal_px)
    nearest = rig.height_m / math.tan(lowest) if lowest < math.pi / 2 else 0.0
    highest = math.radians(rig.pitch_deg) - math.atan(0.8 * rig.height / 2 / rig.focal_px)
    farthest = 5 * rig.height_m
    if highest > 0:
        farthest = min(farthest, rig.height_m / math.tan(highest))
    share = rng.uniform(0.25, 0.7)
    distance_m = nearest * (farthest / max(nearest, 0.1)) ** share if nearest else 0.5 * farthest
    light = Light(noise=float(rng.choice([0.7, 1.5, 3.0])), exposure=float(rng.uniform(0.6, 1.3)))
    scene = make_one(rig, round(distance_m, 2), rng)
    name = f'{scene.name}_{number}'
    return scene.with_(name=name, light=light, seed=int(rng.integers(1000)))


def random_rig(rng: np.random.Generator) -> Rig:
    """Draw a rig whose optical axis meets the ground at 1.2 to 4 times its height."""
    height_m = math.exp(rng.uniform(math.log(0.4), math.log(1.8)))
    focal_px = math.exp(rng.uniform(math.log(330), math.log(650)))
    return Rig(
        focal_px=focal_px,
        # Level ground on the optical axis has a disparity of some 15 to 45 pixels.
        baseline_m=height_m * rng.uniform(0.10, 0.20),
        height_m=height_m,
        pitch_deg=math.degrees(math.atan(1 / rng.uniform(1.2, 4.0))),
        roll_deg=rng.uniform(-4, 4),
        name=f'h{height_m:.1f}',
    )


def _yaw(rng: np.random.Generator) -> float:
    return float(rng.choice([0.0, rng.uniform(-40, 40)]))


def _drop(rig, distance_m, rng):
    return make.drop(rig, rng.choice([0.15, 0.2, 0.3, 0.5, 0.8, 2.0]), distance_m, _yaw(rng))


def _trench(rig, distance_m, rng):
    depth_m, width_m = rng.uniform(0.2, 1.0), rng.uniform(0.3, 1.2)
    return make.trench(rig, depth_m, width_m, distance_m, _yaw(rng))


def _cliff(rig, distance_m, rng):
    return make.cliff(rig, distance_m, _yaw(rng))


def _ledge(rig, distance_m, rng):
    return make.ledges(rig, [rng.uniform(0.15, 0.4)], distance_m, yaw_deg=_yaw(rng))


def _slope(rig, distance_m, rng):
    return make.slope(rig, rng.choice([-46, -35, -28, 28, 35, 46]), distance_m, _yaw(rng))


def _wall(rig, distance_m, rng):
    yaw_deg = _yaw(rng)
    return make_scene('wall', rig, (*level(), wall(distance_m, yaw_deg)), distance_m)


def _rocks(rig, distance_m, rng):
    look = (ROCK, Look(rng.uniform(60, 150), 0.2), Look(18.0, 0.15))[rng.integers(3)]
    size_m, x = rng.uniform(0.15, 0.5), rng.uniform(-0.1, 0.3) * distance_m
    if rng.random() < 0.5:
        rock = (dome(x, distance_m, 0.7 * size_m, size_m, look=look),)
    else:
        size = (size_m * rng.uniform(0.5, 1.5), size_m * rng.uniform(0.1, 1.0), size_m)
        rock = box(x, distance_m, size, yaw_deg=rng.uniform(-60, 60), look=look)
    return make_scene(f'rock_{size_m:.2f}', rig, (*level(), *rock), distance_m)


def _free(rig, distance_m, rng):
    points = (
        make.bank(rng.uniform(-12, 12), distance_m)
        if rng.random() < 0.5
        else make.step(rng.uniform(-0.06, 0.06), distance_m)
    )
    return make.free_ground('ground', rig, points, _yaw(rng))


_MAKERS: tuple[Callable[[Rig, float, np.random.Generator], HazardScene], ...] = (
    _drop,
    _ledge,
    _slope,
    _rocks,
    _wall,
    _trench,
    _cliff,
    _free,
)
