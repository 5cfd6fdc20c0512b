"""Hazards of the ground itself: drops, steps, slopes; and ground that must stay free."""

from __future__ import annotations

import math
from collections.abc import Iterator

from hazard_scene import HazardScene, band_px
from scene_parts import FAR_M, RIGS, level, line_across, make_scene, profile, row_of
from surfaces import FREE, OBSTACLE, UNCOUNTED

# Not counted on either side of a step or the foot of a slope.
STEP_MARGIN_M = 0.2


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
        yield _drop(f'drop_edge_{depth_m:.2f}', name, depth_m, distance_m, yaw_deg)
    for name, depth_m, distance_m, yaw_deg in (
        ('rover', 0.15, 1.2, 0),
        ('rover', 0.30, 2.0, 20),
        ('low', 0.15, 0.9, -20),
        ('low', 0.30, 1.5, 0),
        ('mast', 0.15, 2.0, 0),
        ('wide', 0.30, 1.0, 0),
        ('study', 0.15, 1.0, 0),
    ):
        yield _drop(f'drop_kerb_{depth_m:.2f}', name, depth_m, distance_m, yaw_deg)
    for name, distance_m, yaw_deg in (
        ('rover', 2.0, 0),
        ('low', 1.2, 25),
        ('mast', 3.5, 0),
        ('wide', 1.0, -30),
        ('study', 1.3, 0),
    ):
        # Nothing lies below but the sky.
        yield _over_brim('drop_cliff', name, [(-FAR_M, 0), (distance_m, 0)], 1, yaw_deg)
    for name, distance_m, rise_m, tread_m in (
        ('rover', 1.5, 0.17, 0.28),
        ('low', 1.2, 0.15, 0.30),
        ('mast', 2.5, 0.18, 0.27),
        ('wide', 0.9, 0.17, 0.30),
    ):
        points = [(-FAR_M, 0.0), (distance_m, 0.0)]
        for step in range(1, 9):
            y = distance_m + (step - 1) * tread_m
            points += [(y, -step * rise_m), (y + tread_m, -step * rise_m)]
        points.append((FAR_M, points[-1][1]))
        yield _over_brim('drop_stairs', name, points, 1)
    for name, distance_m, width_m, depth_m, yaw_deg in (
        ('rover', 1.5, 0.8, 0.5, 0),
        ('rover', 2.2, 0.5, 1.0, 15),
        ('mast', 2.0, 1.2, 0.4, 0),
        ('mast', 3.0, 0.6, 0.8, -20),
        ('low', 1.0, 0.7, 0.25, 0),
        ('low', 1.4, 0.4, 0.6, 0),
        ('wide', 0.9, 0.6, 0.3, 20),
        ('study', 1.0, 0.5, 0.3, 0),
    ):
        rig = RIGS[name]
        # From over the brim, does the line of sight reach the floor before the far wall?
        floor = depth_m * distance_m / rig.height_m < width_m
        far = distance_m + width_m
        points = [(-FAR_M, 0.0), (distance_m, 0.0), (distance_m, -depth_m)]
        points += [(far, -depth_m), (far, 0.0), (FAR_M, 0.0)]
        what = 'floor' if floor else 'nofloor'
        yield _over_brim(f'drop_trench_{what}', name, points, 1, yaw_deg)


def _drop(what: str, name: str, depth_m: float, distance_m: float, yaw_deg: float):
    brim = [(-FAR_M, 0.0), (distance_m, 0.0)]
    return _over_brim(what, name, [*brim, (distance_m, -depth_m), (FAR_M, -depth_m)], 1, yaw_deg)


def _over_brim(what, name, points, brim, yaw_deg=0, expects=None) -> HazardScene:
    """Ground whose point number ``brim`` is the brim of a drop across the view, or oblique."""
    distance_m = points[brim][0]
    expects = expects or [FREE] * brim + [UNCOUNTED] * (len(points) - 1 - brim)
    parts = (*profile(points, expects), line_across(*points[brim]))
    return make_scene(f'{what}_at_{distance_m:.1f}', name, parts, distance_m, yaw_deg)


def harmless() -> Iterator[HazardScene]:
    for name, distance_m in (('rover', 1.8), ('low', 1.2), ('mast', 2.5), ('wide', 1.0)):
        fall = math.tan(math.radians(10))
        points = [(-FAR_M, 0.0), (distance_m, 0.0), (FAR_M, (distance_m - FAR_M) * fall)]
        yield _free(f'free_ramp_down_10_at_{distance_m:.1f}', name, points)
    for name, distance_m, step_m, yaw_deg in (
        ('rover', 1.5, -0.05, 0),
        ('low', 1.0, -0.05, 20),
        ('mast', 2.2, -0.05, 0),
        ('study', 1.0, -0.05, 0),
        ('rover', 1.5, 0.05, 0),
        ('wide', 1.0, 0.05, 0),
    ):
        points = [(-FAR_M, 0.0), (distance_m, 0.0), (distance_m, step_m), (FAR_M, step_m)]
        yield _free(f'free_kerb_{step_m:+.2f}_at_{distance_m:.1f}', name, points, yaw_deg)
    for name, distance_m, rise_deg in (
        ('rover', 2.5, 5.0),
        ('low', 1.8, 4.0),
        ('mast', 3.5, 6.0),
        ('wide', 1.6, 5.0),
    ):
        yield _free(f'free_crest_at_{distance_m:.1f}', name, _hill(distance_m, rise_deg))
    for name, distance_m, angle_deg in (
        ('rover', 1.8, 12),
        ('mast', 2.5, 12),
        ('low', 1.2, -12),
        ('study', 1.0, 12),
    ):
        points = _bank(distance_m, angle_deg)
        yield _free(f'free_slope_{angle_deg:+d}_at_{distance_m:.1f}', name, points)
    for name in RIGS:
        yield make_scene('free_level', name, level(), float('nan'))


def _free(what, name, points, yaw_deg=0) -> HazardScene:
    parts = profile(points, [FREE] * (len(points) - 1))
    return make_scene(what, name, parts, points[1][0], yaw_deg)


def _hill(crest_m: float, rise_deg: float) -> list[tuple[float, float]]:
    """A rounded hill whose sides have a slope: up to the crest, and down behind it."""
    rise, half = math.tan(math.radians(rise_deg)), 0.5
    points = [(-FAR_M, 0.0), (0.4 * crest_m, 0.0)]
    y, z = points[-1]
    z += rise * (crest_m - half - y)
    points.append((crest_m - half, z))
    pieces = 10
    for piece in range(1, pieces + 1):
        slope = rise * (1 - 2 * (piece - 0.5) / pieces)
        z += slope * 2 * half / pieces
        points.append((crest_m - half + piece * 2 * half / pieces, z))
    return [*points, (FAR_M, z - rise * (FAR_M - points[-1][0]))]


def _bank(distance_m: float, angle_deg: float, length_m: float = 4.0):
    angle = math.radians(angle_deg)
    y, z = distance_m + length_m * math.cos(angle), length_m * math.sin(angle)
    return [(-FAR_M, 0.0), (distance_m, 0.0), (y, z), (FAR_M, z)]


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
        yield _terraces(f'step_ledge_{step_m:.2f}', name, [step_m], distance_m, 1.0, yaw_deg)
    for name, step_m, distance_m, tread_m, yaw_deg in (
        ('rover', 0.15, 1.4, 0.9, 0),
        ('mast', 0.20, 2.0, 1.2, 15),
        ('low', 0.15, 1.0, 0.8, -20),
        ('study', 0.20, 0.9, 0.7, 0),
    ):
        steps = [step_m] * 3
        yield _terraces(f'step_terraces_{step_m:.2f}', name, steps, distance_m, tread_m, yaw_deg)


def _terraces(what, name, steps_m, distance_m, tread_m, yaw_deg) -> HazardScene:
    """Steps up, one behind the other. Low faces are bands, taller ones obstacles."""
    rig = RIGS[name]
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
    points.append((FAR_M, foot))
    expects.append(FREE)
    parts = (*profile(points, expects), *bands)
    return make_scene(f'{what}_at_{distance_m:.1f}', name, parts, distance_m, yaw_deg)


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
    ):
        points = _bank(distance_m, angle_deg)
        margin = [(distance_m - STEP_MARGIN_M, 0.0), *_on_slope(points[1], angle_deg)]
        points = [points[0], margin[0], points[1], margin[1], *points[2:]]
        expects = [FREE, UNCOUNTED, UNCOUNTED, OBSTACLE, UNCOUNTED]
        what = f'slope_up_{angle_deg}_at_{distance_m:.1f}'
        yield make_scene(what, name, profile(points, expects), distance_m, yaw_deg)
    for name, angle_deg, distance_m, yaw_deg in (
        ('rover', 28, 1.5, 0),
        ('rover', 35, 2.5, 20),
        ('rover', 46, 2.0, 0),
        ('low', 28, 1.0, 0),
        ('low', 35, 1.4, -25),
        ('mast', 28, 1.8, 0),
        ('mast', 46, 2.5, 0),
        ('wide', 35, 1.0, 0),
        ('study', 28, 0.8, 0),
        ('study', 35, 0.9, 0),
    ):
        yield _slope_down(name, angle_deg, distance_m, yaw_deg)


def _slope_down(name, angle_deg, distance_m, yaw_deg) -> HazardScene:
    """Ground that falls away: an obstacle where it is seen well, else a brim."""
    rig = RIGS[name]
    points = _bank(distance_m, -angle_deg)
    sight_deg = math.degrees(math.atan2(rig.height_m, distance_m))
    if sight_deg < angle_deg + 8:
        what = f'slope_down_{angle_deg}_hidden_at_{distance_m:.1f}'
        return _over_brim(what.removesuffix(f'_at_{distance_m:.1f}'), name, points, 1, yaw_deg)
    margin = [(distance_m - STEP_MARGIN_M, 0.0), *_on_slope(points[1], -angle_deg)]
    points = [points[0], margin[0], points[1], margin[1], *points[2:]]
    expects = [FREE, UNCOUNTED, UNCOUNTED, OBSTACLE, UNCOUNTED]
    what = f'slope_down_{angle_deg}_seen_at_{distance_m:.1f}'
    return make_scene(what, name, profile(points, expects), distance_m, yaw_deg)


def _on_slope(foot: tuple[float, float], angle_deg: float) -> list[tuple[float, float]]:
    angle = math.radians(angle_deg)
    return [
        (
            foot[0] + STEP_MARGIN_M * math.cos(angle),
            foot[1] + STEP_MARGIN_M * math.sin(angle),
        )
    ]
