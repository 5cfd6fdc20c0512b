"""Builders of ground hazards, for any rig: drops, trenches, stairs, ledges and slopes.

All lie ahead at ``distance_m``, across the view or turned by ``yaw_deg`` (positive: the right
end is farther).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

from hazard_scene import HazardScene, band_px
from scene_parts import FAR_M, Line, line_across, make_scene, profile, row_of, wall
from surfaces import FREE, OBSTACLE, UNCOUNTED, Look, Rig

# Not counted on either side of a step or the foot of a slope.
STEP_MARGIN_M = 0.2
# A slope that falls away is seen well if sight lines meet it at this angle or more.
MIN_INCIDENCE_DEG = 8.0


def over_brim(what: str, rig: Rig, beyond: Line, distance_m: float, yaw_deg: float = 0.0):
    """Level ground that ends in a brim; beyond it, what nothing is asked about."""
    points = [(-FAR_M, 0.0), (distance_m, 0.0), *beyond]
    expects = [FREE] + [UNCOUNTED] * len(beyond)
    parts = (*profile(points, expects), line_across(distance_m))
    return make_scene(f'{what}_at_{distance_m:.1f}', rig, parts, distance_m, yaw_deg)


def drop(
    rig: Rig, depth_m: float, distance_m: float, yaw_deg: float = 0.0, *, what: str = 'drop_edge'
) -> HazardScene:
    """A lower floor behind an edge: platform, kerb."""
    floor = [(distance_m, -depth_m), (FAR_M, -depth_m)]
    return over_brim(f'{what}_{depth_m:.2f}', rig, floor, distance_m, yaw_deg)


def cliff(rig: Rig, distance_m: float, yaw_deg: float = 0.0) -> HazardScene:
    """An edge below which there is only sky."""
    return over_brim('drop_cliff', rig, [], distance_m, yaw_deg)


def cliff_before_hills(rig: Rig, distance_m: float, yaw_deg: float = 0.0) -> HazardScene:
    """An edge behind which only hills beyond the range are seen."""
    # The texture repeats farther away.
    hills = replace(wall(8.0, look=Look(140.0, 0.25)), corner=(0.0, 8.0, -15.0), expect=UNCOUNTED)
    scene = over_brim('drop_cliff_before_hills', rig, [], distance_m, yaw_deg)
    return scene.with_(surfaces=(*scene.surfaces, hills), config={'max_range': 5.0})


def stairs_down(
    rig: Rig, distance_m: float, rise_m: float, tread_m: float, *, steps: int = 8
) -> HazardScene:
    beyond = []
    for step in range(1, steps + 1):
        y = distance_m + (step - 1) * tread_m
        beyond += [(y, -step * rise_m), (y + tread_m, -step * rise_m)]
    return over_brim('drop_stairs', rig, [*beyond, (FAR_M, -steps * rise_m)], distance_m)


def trench(
    rig: Rig, depth_m: float, width_m: float, distance_m: float, yaw_deg: float = 0.0
) -> HazardScene:
    # From over the brim, does the line of sight reach the floor before the far wall?
    floor = depth_m * distance_m / rig.height_m < width_m
    what = f'drop_trench_{"floor" if floor else "nofloor"}'
    return over_brim(what, rig, trench_line(depth_m, width_m, distance_m), distance_m, yaw_deg)


def trench_line(depth_m: float, width_m: float, distance_m: float) -> Line:
    """Near wall, floor, far wall, and the ground beyond."""
    far = distance_m + width_m
    return [(distance_m, -depth_m), (far, -depth_m), (far, 0.0), (FAR_M, 0.0)]


def ledges(
    rig: Rig,
    steps_m: list[float],
    distance_m: float,
    tread_m: float = 1.0,
    yaw_deg: float = 0.0,
    *,
    what: str = 'step_ledge',
) -> HazardScene:
    """Steps up, one behind the other. Low faces are bands, taller ones obstacles."""
    points, expects, bands = [(-FAR_M, 0.0)], [], []
    foot = 0.0
    for number, step_m in enumerate(steps_m):
        y, top = distance_m + number * tread_m, foot + step_m
        tall = row_of(rig, y, foot) - row_of(rig, y, top) > 2 * band_px(rig)
        points += [(y - STEP_MARGIN_M, foot), (y, foot), (y, top), (y + STEP_MARGIN_M, top)]
        expects += [FREE, UNCOUNTED, OBSTACLE if tall else UNCOUNTED, UNCOUNTED]
        if not tall:
            bands.append(line_across(y, (foot + top) / 2, hides=False))
        foot = top
    parts = (*profile([*points, (FAR_M, foot)], [*expects, FREE]), *bands)
    what = f'{what}_{steps_m[0]:.2f}_at_{distance_m:.1f}'
    return make_scene(what, rig, parts, distance_m, yaw_deg)


def slope(rig: Rig, angle_deg: float, distance_m: float, yaw_deg: float = 0.0) -> HazardScene:
    """A slope too steep to drive, up or (negative) down.

    Down, it is an obstacle where it is seen well, else its brim is.
    """
    level, foot, *beyond = bank(angle_deg, distance_m)
    what = f'slope_{"up" if angle_deg > 0 else "down"}_{abs(angle_deg):.0f}'
    sight_deg = math.degrees(math.atan2(rig.height_m, distance_m))
    if sight_deg + angle_deg < MIN_INCIDENCE_DEG:
        return over_brim(f'{what}_hidden', rig, beyond, distance_m, yaw_deg)
    angle = math.radians(angle_deg)
    start = (
        distance_m + STEP_MARGIN_M * math.cos(angle),
        STEP_MARGIN_M * math.sin(angle),
    )
    points = [level, (distance_m - STEP_MARGIN_M, 0.0), foot, start, *beyond]
    parts = profile(points, [FREE, UNCOUNTED, UNCOUNTED, OBSTACLE, UNCOUNTED])
    return make_scene(f'{what}_at_{distance_m:.1f}', rig, parts, distance_m, yaw_deg)


def free_ground(what: str, rig: Rig, points: Line, yaw_deg: float = 0.0) -> HazardScene:
    """Ground that is free everywhere; its second point is where something begins."""
    distance_m = points[1][0]
    parts = profile(points, [FREE] * (len(points) - 1))
    what = f'free_{what}_at_{distance_m:.1f}'
    return make_scene(what, rig, parts, distance_m, yaw_deg)


def step(step_m: float, distance_m: float) -> Line:
    return [(-FAR_M, 0.0), (distance_m, 0.0), (distance_m, step_m), (FAR_M, step_m)]


def bank(angle_deg: float, distance_m: float, length_m: float = 4.0) -> Line:
    """Level ground, a slope, and level ground again."""
    angle = math.radians(angle_deg)
    y, z = distance_m + length_m * math.cos(angle), length_m * math.sin(angle)
    return [(-FAR_M, 0.0), (distance_m, 0.0), (y, z), (FAR_M, z)]


def hill(rise_deg: float, crest_m: float, *, start: float = 0.4, pieces: int = 10) -> Line:
    """A rounded hill whose sides have a slope: up to the crest, and down behind it."""
    rise, half = math.tan(math.radians(rise_deg)), 0.5
    slopes = [rise * (1 - 2 * (piece + 0.5) / pieces) for piece in range(pieces)]
    foot, top = start * crest_m, crest_m - half
    heights = itertools.accumulate(
        [rise * (top - foot), *(each * 2 * half / pieces for each in slopes)]
    )
    rounded = [(top + i * 2 * half / pieces, z) for i, z in enumerate(heights)]
    y, z = rounded[-1]
    return [(-FAR_M, 0.0), (foot, 0.0), *rounded, (FAR_M, z - rise * (FAR_M - y))]
