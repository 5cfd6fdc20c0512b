"""Pairs that cannot be judged, or only with care: a good scene, and a fault of the camera."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import degrade
from hazard_scene import Fault, HazardScene
from scene_parts import RIGS, box, dome, level, make_scene
from surfaces import BLIND, NOT_FREE

RIG_NAMES = ('rover', 'low', 'mast', 'study')


def blind() -> Iterator[HazardScene]:
    """Nothing may be said of these pairs, or only that nothing is free."""
    faults = {
        'both_black': degrade.black,
        'left_black': partial(degrade.black, side='left'),
        'right_black': partial(degrade.black, side='right'),
        'left_white': partial(degrade.white, side='left'),
        'right_white': partial(degrade.white, side='right'),
        'both_white': degrade.white,
        'both_covered': degrade.covered,
        'left_covered': partial(degrade.covered, side='left'),
        'right_covered': partial(degrade.covered, side='right'),
        'same_image_twice': degrade.same_twice,
        'same_camera_twice': partial(degrade.same_twice, noise=2.0),
        'exchanged': degrade.exchanged,
        'overexposed_8': partial(degrade.exposed, gain=8.0),
        'underexposed_0.005': partial(degrade.exposed, gain=0.005),
    }
    for number, (what, apply) in enumerate(faults.items()):
        # Two rigs each, so that all rigs meet most kinds.
        for name in (RIG_NAMES[number % 4], RIG_NAMES[(number + 2) % 4]):
            fault = Fault(apply, expect_all=BLIND)
            yield _boxes(f'blind_{what}', name).with_(fault=fault)
    for what, name, moved_m in (
        ('ahead', 'rover', (0.0, 0.3)),
        ('ahead', 'low', (0.0, 0.25)),
        ('aside', 'mast', (0.5, 0.6)),
        ('aside', 'study', (-0.3, 0.3)),
        ('far', 'rover', (3.0, 7.0)),
        ('far', 'wide', (5.0, 9.0)),
    ):
        scene = _boxes(f'blind_another_moment_{what}', name)
        yield scene.with_(fault=Fault(expect_all=BLIND), right_moved_m=moved_m)
    for name in RIG_NAMES:
        upside_down = Fault(degrade.upside_down, expect_all=NOT_FREE, upside_down=True)
        yield _boxes('blind_upside_down', name).with_(fault=upside_down)


def faulty() -> Iterator[HazardScene]:
    """Pairs that are worse than they should be. What is said of them must still be right."""
    # Refusing these is right as well.
    bad = {
        'defocused_left_2': partial(degrade.defocused, sigma_px=2.0),
        'defocused_left_3': partial(degrade.defocused, sigma_px=3.0),
        'defocused_left_4': partial(degrade.defocused, sigma_px=4.0),
        'defocused_right_3': partial(degrade.defocused, side='right', sigma_px=3.0),
        'defocused_both_3': partial(degrade.defocused, side='both', sigma_px=3.0),
        'defocused_both_4': partial(degrade.defocused, side='both', sigma_px=4.0),
        'rows_off_4': partial(degrade.shifted, down_px=4.0),
        'rows_off_8': partial(degrade.shifted, down_px=-8.0),
        'rows_off_12': partial(degrade.shifted, down_px=12.0),
        'columns_off_left_4': partial(degrade.shifted, right_px=-4.0),
        'columns_off_right_4': partial(degrade.shifted, right_px=4.0),
        'turned_2': partial(degrade.turned, angle_deg=2.0),
        'overexposed_2.5': partial(degrade.exposed, gain=2.5),
        'underexposed_0.08': partial(degrade.exposed, gain=0.08),
        'smudged_left': degrade.smudged,
    }
    for number, (what, apply) in enumerate(bad.items()):
        for name in (RIG_NAMES[number % 4], RIG_NAMES[(number + 1) % 4]):
            scene = _boxes(f'faulty_{what}', name)
            yield scene.with_(fault=Fault(apply), may_refuse=True)
    for side in ('left', 'right'):
        for name in RIG_NAMES:
            half = Fault(partial(degrade.half_covered, side=side), half_covered=side)
            yield _boxes(f'faulty_half_covered_{side}', name).with_(fault=half, may_refuse=True)
    # These are everyday; the detector must judge them.
    mild = {
        'rows_off_2': partial(degrade.shifted, down_px=2.0),
        'overexposed_1.6': partial(degrade.exposed, gain=1.6),
        'underexposed_0.3': partial(degrade.exposed, gain=0.3),
        'right_darker': partial(degrade.exposed, side='right', gain=0.7),
        'right_brighter': partial(degrade.exposed, side='right', gain=1.4),
        'jpeg_30': degrade.compressed,
        'gamma_2': degrade.gamma,
        'gamma_right_1.3': partial(degrade.gamma, side='right', exponent=1.3),
        'vignetted': degrade.vignetted,
    }
    for number, (what, apply) in enumerate(mild.items()):
        for name in (RIG_NAMES[number % 4], RIG_NAMES[(number + 1) % 4]):
            yield _boxes(f'faulty_{what}', name).with_(fault=Fault(apply))


def _boxes(what: str, name: str) -> HazardScene:
    """Two obstacles on level ground, sized for the camera."""
    rig = RIGS[name]
    unit = rig.height_m
    near, far = 1.6 * unit, 2.6 * unit
    parts = (
        *level(),
        *box(-0.2 * unit, near, (0.3 * unit, 0.25 * unit, 0.3 * unit), yaw_deg=10),
        dome(0.6 * unit, far, 0.25 * unit, 0.35 * unit),
    )
    return make_scene(what, rig, parts, near)
