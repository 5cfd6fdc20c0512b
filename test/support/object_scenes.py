"""Hazards that stand on the ground, and grounds that mislead stereo."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from ground_hazards import trench_line
from hazard_scene import EDGE_M, HazardScene
from scene_parts import (
    FAR_M,
    GROUND,
    RIGS,
    ROCK,
    X,
    box,
    dome,
    level,
    make_scene,
    pitch_for_row,
    profile,
    turned,
    wall,
)
from surfaces import (
    FREE,
    NOT_FREE,
    UNCOUNTED,
    Light,
    Look,
    Patch,
    Rig,
    Shadow,
)


def walls() -> Iterator[HazardScene]:
    for name, distance_m, pitch_deg in (
        ('rover', 1.5, 0.0),
        ('low', 0.7, 0.0),
        ('wide', 0.6, -5.0),
        ('mast', 1.8, 2.0),
        ('car', 2.5, -8.0),
    ):
        rig = RIGS[name].with_(pitch_deg=pitch_deg)
        surfaces = (*level(), wall(distance_m, expect=NOT_FREE))
        yield make_scene('wall_fills', rig, surfaces, distance_m)
    for name, distance_m, share, yaw_deg in (
        ('rover', 2.0, 0.10, 0),
        ('low', 1.2, 0.20, 0),
        ('mast', 3.0, 0.30, 0),
        ('wide', 1.0, 0.40, 0),
        ('car', 5.0, 0.25, 0),
        ('rover', 2.0, 0.30, 30),
        ('low', 1.5, 0.20, -35),
        ('mast', 3.0, 0.35, 50),
        ('wide', 1.2, 0.30, -20),
    ):
        rig = RIGS[name]
        rig = rig.with_(pitch_deg=pitch_for_row(rig, (1 - share) * rig.height, distance_m))
        surfaces = (*level(), wall(distance_m, yaw_deg))
        what = f'oblique{yaw_deg:+d}' if yaw_deg else 'strip'
        yield make_scene(f'wall_{what}_{share:.2f}', rig, surfaces, distance_m)
    for name, side_m, pitch_deg in (
        ('car', -3.0, 5.0),
        ('car', 2.5, 2.0),
        ('rover', -1.2, 12.0),
        ('low', 0.9, 10.0),
        ('wide', -0.6, 15.0),
    ):
        rig = RIGS[name].with_(pitch_deg=pitch_deg)
        side = turned((wall(0.0, height_m=6.0),), 90, (0, 0))[0]
        surfaces = (*level(), replace(side, corner=(side_m, 0.0, 0.0)))
        yield make_scene(f'wall_beside_{side_m:+.1f}', rig, surfaces, abs(side_m))
    for name, distance_m, pitch_deg, size in (
        ('rover', 1.6, 20.0, (0.8, 0.03, 1.0)),
        ('low', 1.1, 15.0, (0.6, 0.02, 0.7)),
        ('mast', 2.0, 25.0, (1.0, 0.05, 1.2)),
        ('wide', 1.0, 18.0, (1.2, 0.03, 0.5)),
        ('study', 1.2, 40.0, (0.7, 0.03, 0.6)),
    ):
        surfaces = (*level(), *box(0.05, distance_m, size, yaw_deg=8))
        rig = RIGS[name].with_(pitch_deg=pitch_deg)
        yield make_scene('wall_board', rig, surfaces, distance_m)


def rocks() -> Iterator[HazardScene]:
    for name, what, x, distance_m, size_m in (
        ('rover', 'box', 0.1, 1.5, 0.15),
        ('rover', 'box', -0.3, 2.5, 0.35),
        ('low', 'box', 0.0, 1.0, 0.20),
        ('mast', 'box', 0.3, 2.5, 0.25),
        ('study', 'box', 0.1, 1.0, 0.15),
        ('rover', 'dome', 0.2, 1.8, 0.25),
        ('low', 'dome', 0.2, 1.4, 0.20),
        ('mast', 'dome', -0.3, 2.0, 0.30),
        ('wide', 'dome', 0.1, 0.9, 0.20),
        ('car', 'dome', 0.5, 5.0, 0.60),
    ):
        yield _rock(f'rock_{what}_{size_m:.2f}', RIGS[name], what, (x, distance_m, size_m))
    # Their sides are nearly black, with little contrast.
    for name, what, x, distance_m, size_m, grey in (
        ('rover', 'box', 0.1, 1.5, 0.25, 18.0),
        ('low', 'box', -0.1, 1.0, 0.20, 14.0),
        ('mast', 'dome', 0.2, 2.2, 0.30, 16.0),
        ('wide', 'dome', 0.0, 1.0, 0.25, 12.0),
        ('study', 'box', 0.0, 1.0, 0.25, 20.0),
    ):
        look, where = Look(grey, 0.10), (x, distance_m, size_m)
        yield _rock(f'rock_dark_{what}_{size_m:.2f}', RIGS[name], what, where, look)
    for name, x, distance_m, yaw_deg, size in (
        ('rover', 0.1, 1.5, 0, (0.30, 0.02, 0.35)),
        ('rover', -0.1, 2.0, 55, (0.30, 0.02, 0.40)),
        ('low', 0.1, 1.1, 75, (0.30, 0.03, 0.30)),
        ('mast', 0.0, 2.2, 20, (0.15, 0.02, 0.45)),
        ('study', 0.0, 1.0, -40, (0.25, 0.02, 0.30)),
        ('wide', 0.1, 1.0, 0, (0.06, 0.02, 0.30)),
    ):
        plate = box(x, distance_m, size, yaw_deg=yaw_deg)
        what = f'rock_plate_{size[0]:.2f}_turned{yaw_deg:+d}'
        yield make_scene(what, RIGS[name], (*level(), *plate), distance_m)
    # The rover drives over steps of 0.25 m; these are taller and wider than its view of them.
    for name, what, x, distance_m, size_m in (
        ('rover', 'box', 0.1, 2.2, 0.60),
        ('rover', 'dome', -0.2, 3.0, 0.90),
        ('mast', 'dome', 0.2, 3.0, 0.70),
        ('mast', 'box', -0.3, 3.5, 0.90),
        ('low', 'dome', 0.3, 2.4, 0.75),
    ):
        scene = _rock(
            f'rock_boulder_{what}_{size_m:.2f}', RIGS[name], what, (x, distance_m, size_m)
        )
        yield scene.with_(config={'max_step': 0.25})
    # The same for a rover that drives over 0.5 m, and looks down from higher up.
    high = RIGS['car'].with_(width=1280, height=960, focal_px=1000.0, baseline_m=0.5)
    high = high.with_(height_m=3.5, pitch_deg=15.0)
    for what, distance_m, size_m in (('box', 5.0, 0.65), ('box', 9.0, 0.65), ('dome', 5.0, 1.0)):
        name = f'rock_boulder_{what}_{size_m:.2f}_at_{distance_m:.0f}_high'
        yield _rock(name, high, what, (0.3, distance_m, size_m)).with_(config={'max_step': 0.5})
    for name, distance_m, size_m in (
        ('rover', 1.3, 0.12),
        ('low', 0.7, 0.12),
        ('mast', 1.4, 0.15),
        ('wide', 0.7, 0.12),
    ):
        yield _at_left_border(name, distance_m, size_m)


def _rock(what, rig: Rig, shape, where, look: Look = ROCK, **fields) -> HazardScene:
    x, distance_m, size_m = where
    if shape == 'dome':
        rock = (dome(x, distance_m, 0.75 * size_m, size_m, look=look),)
    else:
        size = (size_m, 0.8 * size_m, size_m)
        rock = box(x, distance_m, size, yaw_deg=15, look=look)
    return make_scene(what, rig, (*level(), *rock), distance_m, **fields)


def _at_left_border(name: str, distance_m: float, size_m: float) -> HazardScene:
    """A rock that the right camera does not see: it must not be called free."""
    rig = RIGS[name]
    depth_m = rig.in_camera((0.0, distance_m, size_m / 2))[2]
    edge_m = -depth_m * (rig.camera.cx / rig.focal_px)
    x = edge_m + 0.5 * rig.baseline_m
    size = (0.6 * rig.baseline_m, size_m, size_m)
    rock = box(x, distance_m, size, expect=NOT_FREE)
    return make_scene(f'rock_border_{size_m:.2f}', rig, (*level(), *rock), distance_m)


def shadows() -> Iterator[HazardScene]:
    """Black shadow, where the images show nothing but noise."""
    for name, distance_m, light in (
        ('rover', 1.6, 0.03),
        ('low', 1.1, 0.02),
        ('mast', 2.4, 0.03),
        ('study', 1.0, 0.0),
    ):
        shadow = Shadow((-0.5, 0.6), (distance_m - 0.35, distance_m + 0.5), light)
        dark = Light(shadows=(shadow,))
        yield make_scene('free_black_shadow', RIGS[name], level(), distance_m, light=dark)
        rock = box(0.05, distance_m, (0.3, 0.25, 0.25), yaw_deg=10, expect=NOT_FREE)
        yield make_scene('shadow_rock', RIGS[name], (*level(), *rock), distance_m, light=dark)
        # With some light left, the rock is to be found.
        dim = Light(shadows=(replace(shadow, light=0.2),))
        rock = box(0.05, distance_m, (0.3, 0.25, 0.25), yaw_deg=10)
        yield make_scene('shadow_dim_rock', RIGS[name], (*level(), *rock), distance_m, light=dim)
    for name, distance_m, width_m, depth_m in (
        ('rover', 1.4, 0.7, 0.5),
        ('low', 0.9, 0.5, 0.3),
        ('mast', 2.0, 0.9, 0.6),
        ('study', 0.9, 0.5, 0.4),
    ):
        far = distance_m + width_m
        points = [(-FAR_M, 0.0), (distance_m - EDGE_M, 0.0), (distance_m, 0.0)]
        points += trench_line(depth_m, width_m, distance_m)
        expects = [FREE, UNCOUNTED, UNCOUNTED, NOT_FREE, NOT_FREE, FREE]
        dark = Light(shadows=(Shadow((-FAR_M, FAR_M), (distance_m - 0.001, far + 0.001), 0.02),))
        ground = profile(points, expects)
        yield make_scene('shadow_trench', RIGS[name], ground, distance_m, light=dark)


def slabs() -> Iterator[HazardScene]:
    """Floors that repeat themselves. Unknown is no error there, an obstacle is."""
    for name, tile_m, contrast, yaw_deg, distance_m in (
        ('rover', 0.10, 0.004, 0, 1.8),
        ('rover', 0.20, 0.010, 0, 2.0),
        ('rover', 0.10, 0.004, 30, 1.6),
        ('low', 0.05, 0.004, 0, 1.0),
        ('low', 0.10, 0.010, 20, 1.2),
        ('mast', 0.15, 0.004, 0, 2.5),
        ('mast', 0.30, 0.020, 45, 2.2),
        ('wide', 0.08, 0.004, 0, 0.9),
        ('study', 0.10, 0.004, 0, 1.0),
        ('car', 0.30, 0.004, 0, 5.0),
    ):
        look = Look(150.0, contrast, tile_m=tile_m)
        floor = turned(level(look=look), yaw_deg, (0.0, 0.0))
        parts = (*floor, *box(0.1, distance_m, (0.3, 0.25, 0.3), yaw_deg=10))
        what = f'slabs_{tile_m:.2f}_turned{yaw_deg:+d}'
        yield make_scene(what, RIGS[name], parts, distance_m)


def faint() -> Iterator[HazardScene]:
    """Obstacles on ground that shows hardly any contrast."""
    for name, distance_m in (('rover', 1.6), ('low', 1.0), ('mast', 2.2), ('study', 1.0)):
        floor = level(look=replace(GROUND, contrast=0.012))
        parts = (*floor, *box(0.1, distance_m, (0.3, 0.25, 0.3), yaw_deg=10))
        yield make_scene('faint_bare_floor', RIGS[name], parts, distance_m)
    for name, distance_m in (('rover', 1.8), ('low', 1.0), ('mast', 2.4), ('study', 1.0)):
        parts = (*level(), *box(0.1, distance_m, (0.3, 0.25, 0.3), yaw_deg=10))
        veil = Light(veil=0.88)
        yield make_scene('faint_veil_12_percent', RIGS[name], parts, distance_m, light=veil)
        fog = Light(fog=0.5 / distance_m)
        yield make_scene('faint_fog', RIGS[name], parts, distance_m, light=fog)


def mirrors() -> Iterator[HazardScene]:
    for name, distance_m, size, beyond_m in (
        ('rover', 2.0, (1.4, 0.9), 4.0),
        ('low', 1.3, (0.9, 0.7), 2.5),
        ('mast', 2.5, (1.6, 1.2), 4.5),
        ('wide', 1.0, (0.7, 0.4), 1.8),
    ):
        puddle = _puddle(0.05, distance_m, size)
        # Near enough to the puddle to be seen in it.
        parts = (*level(), puddle, wall(beyond_m))
        yield make_scene('mirror_puddle_wall', RIGS[name], parts, distance_m)
        yield make_scene('mirror_puddle_sky', RIGS[name], (*level(), puddle), distance_m)
        post = box(0.1, distance_m + size[1], (0.25, 0.2, 1.2))
        yield make_scene('mirror_puddle_post', RIGS[name], (*level(), puddle, *post), distance_m)
        # Hills beyond the range, mirrored.
        hills = replace(wall(8.0, look=Look(140.0, 0.25)), expect=UNCOUNTED)
        scene = make_scene(
            'mirror_puddle_hills', RIGS[name], (*level(), puddle, hills), distance_m
        )
        yield scene.with_(config={'max_range': 5.0})
    # The bonnet covers this share of the image.
    for name, pitch_deg, length_m, share in (
        ('car', 12.0, 1.6, 0.20),
        ('car', 5.0, 2.2, 0.12),
        ('rover', 30.0, 0.6, 0.25),
        ('wide', 28.0, 0.35, 0.20),
        ('mast', 34.0, 0.8, 0.15),
    ):
        rig = RIGS[name].with_(pitch_deg=pitch_deg)
        front = (1 - share) * rig.height
        below_axis = math.atan((front - rig.camera.cy) / rig.focal_px)
        front_m = rig.height_m - length_m * math.tan(math.radians(pitch_deg) + below_axis)
        # Asphalt, with a house ahead for the bonnet to mirror.
        look = replace(GROUND, grey=100.0, contrast=0.12)
        house = wall(7 * rig.height_m, height_m=12 * rig.height_m, expect=UNCOUNTED)
        parts = (*_bonnet(front_m, length_m), *level(look=look), house)
        yield make_scene(f'mirror_bonnet_{pitch_deg:.0f}', rig, parts, length_m)


def _puddle(x: float, y: float, size: tuple[float, float]) -> Patch:
    """A puddle, 1 mm above the ground."""
    across, ahead = (-size[0] / 2, size[0] / 2), (-size[1] / 2, size[1] / 2)
    look = Look(45.0, 0.02, mirror=0.85)
    return Patch((x, y, 0.001), X, (0.0, 1.0, 0.0), across, ahead, look, NOT_FREE)


def _bonnet(front_m: float, length_m: float, facets: int = 8) -> tuple[Patch, ...]:
    """The rover's own bonnet: it curves down to the height of its front, and mirrors."""
    points = []
    for facet in range(facets + 1):
        share = facet / facets
        points.append((share * length_m, front_m + 0.2 * length_m * (1 - share**2)))
    look = Look(45.0, 0.05, mirror=0.6)
    half = 0.6 * length_m
    return profile(points, [UNCOUNTED] * facets, look, (-half, half))
