"""Parts of the hazard scenes: profiles of the ground, walls and boxes, and the rigs."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
from hazard_scene import Band, HazardScene
from surfaces import FREE, OBSTACLE, UNBOUNDED, Ellipsoid, Look, Patch, Rig, Surface

Line = list[tuple[float, float]]

RIGS = {
    rig.name: rig
    for rig in (
        Rig(name='rover'),
        Rig(640, 480, 420, baseline_m=0.10, height_m=0.5, pitch_deg=18, name='low'),
        Rig(640, 480, 450, baseline_m=0.20, height_m=1.3, pitch_deg=32, name='mast'),
        Rig(640, 400, 330, baseline_m=0.09, height_m=0.45, pitch_deg=22, name='wide'),
        Rig(640, 480, 415, baseline_m=0.06, height_m=1.0, pitch_deg=46, name='study'),
        Rig(640, 480, 700, baseline_m=0.5, height_m=1.6, pitch_deg=5, name='car'),
    )
}

GROUND = Look()
WALL = Look(grey=95.0)
ROCK = Look(grey=95.0, contrast=0.25)
FAR_M = 60.0

X, UP = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def profile(
    points: Line,
    expects: list[int],
    look: Look = GROUND,
    across: tuple[float, float] = UNBOUNDED,
) -> tuple[Patch, ...]:
    """Ground whose height depends on the distance ahead alone: a polyline of (y, z).

    One value is expected on each piece. The texture runs on from piece to piece.
    """
    patches, run = [], 0.0
    for (start, end), expect in zip(itertools.pairwise(points), expects, strict=True):
        step = np.subtract(end, start)
        length = float(np.hypot(*step))
        v = (0.0, *(step / length))
        corner = np.array([0.0, *start]) - run * np.asarray(v)
        piece = (run, run + length)
        patches.append(Patch(tuple(corner), X, v, across, piece, look, expect, skin=0))
        run += length
    return tuple(patches)


def level(expect: int = FREE, look: Look = GROUND) -> tuple[Patch, ...]:
    """Level ground everywhere."""
    return profile([(-FAR_M, 0.0), (FAR_M, 0.0)], [expect], look)


def wall(
    distance_m: float,
    yaw_deg: float = 0.0,
    *,
    height_m: float = 30.0,
    look: Look = WALL,
    expect: int = OBSTACLE,
) -> Patch:
    """An upright wall; with a positive yaw its right end is farther."""
    yaw = math.radians(yaw_deg)
    along = (math.cos(yaw), math.sin(yaw), 0.0)
    return Patch((0.0, distance_m, 0.0), along, UP, UNBOUNDED, (0.0, height_m), look, expect)


def box(
    x: float,
    y: float,
    size: tuple[float, float, float],
    *,
    yaw_deg: float = 0.0,
    base: float = 0.0,
    look: Look = ROCK,
    expect: int = OBSTACLE,
) -> tuple[Patch, ...]:
    """A block of a width, depth and height, centred at x, y, standing on ``base``."""
    width, depth, height = size
    yaw = math.radians(yaw_deg)
    right = np.array([math.cos(yaw), math.sin(yaw), 0.0])
    ahead = np.array([-math.sin(yaw), math.cos(yaw), 0.0])
    up = np.array(UP)
    foot = np.array([x, y, base])
    sides = [
        (foot - ahead * depth / 2, right, up, width, (0.0, height)),
        (foot + ahead * depth / 2, right, up, width, (0.0, height)),
        (foot - right * width / 2, ahead, up, depth, (0.0, height)),
        (foot + right * width / 2, ahead, up, depth, (0.0, height)),
        (foot + up * height, right, ahead, width, (-depth / 2, depth / 2)),
    ]
    return tuple(
        Patch(tuple(corner), tuple(u), tuple(v), (-half / 2, half / 2), v_range, look, expect)
        for corner, u, v, half, v_range in sides
    )


def dome(x: float, y: float, radius: float, height: float | None = None, **kwargs) -> Ellipsoid:
    """The visible half of a round boulder."""
    look = kwargs.pop('look', ROCK)
    return Ellipsoid((x, y, 0.0), (radius, radius, height or radius), look, **kwargs)


def turned(parts: tuple[Surface | Band, ...], yaw_deg: float, about: tuple[float, float]) -> tuple:
    """Turn patches and bands anticlockwise, seen from above, about a place on the ground."""
    yaw = math.radians(yaw_deg)
    turn = np.array(
        [[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]]
    )
    centre = np.array([*about, 0.0])

    def moved(point):
        return tuple(turn @ (np.asarray(point) - centre) + centre)

    def of(part):
        if isinstance(part, Band):
            return replace(part, start=moved(part.start), end=moved(part.end))
        if isinstance(part, Ellipsoid):
            return replace(part, centre=moved(part.centre))
        return replace(
            part,
            corner=moved(part.corner),
            u=tuple(turn @ np.asarray(part.u)),
            v=tuple(turn @ np.asarray(part.v)),
        )

    return tuple(of(part) for part in parts)


def line_across(y: float, z: float = 0.0, *, hides: bool = True) -> Band:
    return Band((-FAR_M, y, z), (FAR_M, y, z), hides)


def row_of(rig: Rig, y: float, z: float = 0.0) -> float:
    """Image row that shows a height z at a distance y ahead."""
    _, down, ahead = rig.in_camera(np.array([0.0, y, z]))
    return rig.camera.cy + rig.focal_px * down / ahead


def pitch_for_row(rig: Rig, row: float, y: float, z: float = 0.0) -> float:
    """Pitch, degrees, at which the image row shows a height z at a distance y ahead."""
    below_horizon = math.atan2(rig.height_m - z, y)
    return math.degrees(below_horizon - math.atan((row - rig.camera.cy) / rig.focal_px))


def make_scene(
    what: str, rig: Rig, parts: tuple, distance_m: float, yaw_deg: float = 0, **fields
) -> HazardScene:
    """A scene before a rig, its patches and bands turned about the hazard."""
    if yaw_deg:
        parts = turned(parts, yaw_deg, (0.0, distance_m))
        what = f'{what}_oblique{yaw_deg:+.0f}'
    surfaces = tuple(part for part in parts if not isinstance(part, Band))
    bands = tuple(part for part in parts if isinstance(part, Band))
    return HazardScene(f'{what}_{rig.name}', rig, surfaces, bands, distance_m, **fields)
