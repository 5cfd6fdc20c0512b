"""The table of conditions under which a detector can tell little or nothing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from rover_obstacle_detection.evaluation.blind import changes
from rover_obstacle_detection.evaluation.blind.view import View, exchanged, rotated_by_180

Change = Callable[[View], View | None]
"""Damages a view; None if the view does not allow it."""


@dataclass(frozen=True)
class Condition:
    """Something that goes wrong, and how much of it.

    Parameters
    ----------
    group : str
        Heading of the condition in the tables.
    name : str
    strengths : mapping of str to callable
        By strength, weakest first; kinds of the same condition where it has no strength.
    """

    group: str
    name: str
    strengths: Mapping[str, Change]


def undamaged(view: View) -> View:
    """Change nothing."""
    return view


def _each(text: str, change: Callable[..., View | None], *values: Any) -> dict[str, Change]:
    """Make one strength for each value of the second parameter of `change`."""
    return {text.format(value): partial(_changed, change, value) for value in values}


def _shares(text: str, change: Callable[..., View | None], *shares: float) -> dict[str, Change]:
    """Make one strength for each share, in percent."""
    return {text.format(100 * share): partial(_changed, change, share) for share in shares}


def _changed(change: Callable[..., View | None], value: Any, view: View) -> View | None:
    return change(view, value)


def _defocused(sides: str) -> dict[str, Change]:
    return {
        f'sigma {sigma_px} px': partial(changes.defocused, sides=sides, sigma_px=sigma_px)
        for sigma_px in (2, 3, 4)
    }


def _smeared(sides: str) -> dict[str, Change]:
    return {
        f'{length_px} px': partial(changes.smeared, sides=sides, length_px=length_px)
        for length_px in (5, 11, 21)
    }


def _shifted(sign: int) -> dict[str, Change]:
    return {
        f'{columns} px': partial(changes.shifted_right_image, columns=sign * columns)
        for columns in (2, 6, 15)
    }


def _pitched(sign: int) -> dict[str, Change]:
    return {
        f'{angle} deg': partial(changes.told_vertical, pitch_error_deg=sign * angle)
        for angle in (10, 20, 40)
    }


CONTROL = 'Nothing wrong'
BLIND = 'Cameras that see nothing'
UNRELATED = 'Images that do not belong together'
LENS = 'Lens and motion'
LIGHT = 'Light and noise'
ALIGNMENT = 'Images out of place'
CALIBRATION = 'Wrong calibration'
GRAVITY = 'Wrong vertical'

CONDITIONS: tuple[Condition, ...] = (
    Condition(
        CONTROL,
        'undamaged',
        {'gravity estimated': undamaged, 'true gravity given': changes.told_vertical},
    ),
    Condition(BLIND, 'both images flat', _each('grey level {}', changes.both_flat, 0, 16, 255)),
    Condition(
        BLIND,
        'both lenses covered',
        {
            f'noise {sigma}': partial(changes.both_flat, level=8, sigma=sigma)
            for sigma in (1, 2, 4)
        },
    ),
    Condition(
        BLIND,
        'right image black',
        {
            f'noise {sigma}': partial(changes.right_flat, level=8 if sigma else 0, sigma=sigma)
            for sigma in (0, 1, 4)
        },
    ),
    Condition(
        BLIND,
        'right image white',
        {
            'white': partial(changes.right_flat, level=255),
            'white, noise 4': partial(changes.right_flat, level=255, sigma=4),
            'mid-grey': partial(changes.right_flat, level=128),
        },
    ),
    Condition(
        BLIND,
        'part of the left lens covered',
        _shares('{:g} %', changes.covered_left, 0.25, 0.5, 0.75),
    ),
    Condition(
        BLIND, 'dirt on the left lens', _shares('{:g} %', changes.dirty_left, 0.05, 0.15, 0.4)
    ),
    Condition(
        UNRELATED,
        'same image twice',
        {
            'left': partial(changes.same_image, source='left'),
            'left, noise 2': partial(changes.same_image, source='left', sigma=2),
            'right': partial(changes.same_image, source='right'),
        },
    ),
    Condition(
        UNRELATED,
        'right image of another moment',
        {
            '3 % closer': partial(changes.moved_on, factor=1.03),
            '10 % closer': partial(changes.moved_on, factor=1.1),
            'another place': changes.other_moment,
            'left image mirrored': changes.mirrored_left,
        },
    ),
    Condition(
        UNRELATED, 'right image torn', _shares('lower {:g} %', changes.torn_right, 0.25, 0.5, 0.75)
    ),
    Condition(
        UNRELATED,
        'rows lost in the right image',
        _shares('{:g} % black', changes.rows_lost, 0.05, 0.15, 0.4),
    ),
    Condition(UNRELATED, 'left and right exchanged', {'images': exchanged}),
    Condition(
        UNRELATED,
        'camera upside down',
        {
            'images exchanged': changes.upside_down,
            'not exchanged': rotated_by_180,
            'right only': changes.right_upside_down,
        },
    ),
    Condition(LENS, 'left out of focus', _defocused('left')),
    Condition(LENS, 'right out of focus', _defocused('right')),
    Condition(LENS, 'both out of focus', _defocused('both')),
    Condition(LENS, 'left motion blur', _smeared('left')),
    Condition(LENS, 'right motion blur', _smeared('right')),
    Condition(LIGHT, 'over-exposed', _each('x {}', changes.over_exposed, 1.5, 2.5, 4)),
    Condition(LIGHT, 'under-exposed', _each('x {}', changes.under_exposed, 0.3, 0.1, 0.03)),
    Condition(LIGHT, 'fog', _each('contrast x {}', changes.foggy, 0.3, 0.1, 0.03)),
    Condition(LIGHT, 'noise', _each('sigma {}', changes.noisy, 10, 20, 40)),
    Condition(LIGHT, 'JPEG', _each('quality {}', changes.jpeg, 30, 10, 3)),
    Condition(
        ALIGNMENT,
        'right image too low',
        {
            f'{rows} px': partial(changes.shifted_right_image, rows=rows)
            for rows in (2, 4, 8, 12, 20)
        },
    ),
    Condition(ALIGNMENT, 'right image too far right', _shifted(1)),
    Condition(ALIGNMENT, 'right image too far left', _shifted(-1)),
    Condition(
        CALIBRATION,
        'right principal point',
        _each('{:+} px', changes.wrong_principal_point, 5, 15, 40, -5, -15, -40),
    ),
    Condition(CALIBRATION, 'baseline', _each('x {}', changes.wrong_baseline, 10)),
    Condition(CALIBRATION, 'focal length', _each('x {}', changes.wrong_focal_length, 0.7, 1.4, 2)),
    Condition(GRAVITY, 'pitch and roll', {'said to be 0': changes.told_level}),
    Condition(GRAVITY, 'pitch too small', _pitched(-1)),
    Condition(GRAVITY, 'pitch too large', _pitched(1)),
    Condition(
        GRAVITY,
        'roll wrong',
        {
            f'{angle} deg': partial(changes.told_vertical, roll_error_deg=angle)
            for angle in (10, 20, 40)
        },
    ),
)
"""Every condition, in the order of the tables."""
