"""Hazards at several distances and from several cameras: ``HAZARD_SCENES``.

Names begin with the kind:

- wall, rock, step, slope, drop: obstacles; free: harmless counterparts;
- shadow, slabs, faint, mirror: surfaces that stereo sees badly;
- blind: pairs of which nothing may be said; faulty: pairs that are worse than they should be.
"""

from __future__ import annotations

import itertools
import zlib
from collections.abc import Iterator

from ground_scenes import drops, harmless, slopes, steps_up
from hazard_scene import HazardScene
from object_scenes import faint, mirrors, rocks, shadows, slabs, walls
from pair_scenes import blind, faulty

KINDS = (
    walls,
    drops,
    harmless,
    steps_up,
    slopes,
    rocks,
    shadows,
    slabs,
    faint,
    mirrors,
    blind,
    faulty,
)


def _with_seeds() -> Iterator[HazardScene]:
    for scene in itertools.chain.from_iterable(kind() for kind in KINDS):
        yield scene.with_(seed=zlib.crc32(scene.name.encode()) % 1000)


HAZARD_SCENES: tuple[HazardScene, ...] = tuple(_with_seeds())
