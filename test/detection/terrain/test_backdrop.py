"""What is seen past the end of the ground: sky, and what lies beyond the range."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from relief import PARAMETERS, PosedCamera
from synthetic import pinhole

from rover_obstacle_detection.detection.terrain.backdrop import (
    sky_in_place_of_ground,
    with_backdrop,
)
from rover_obstacle_detection.detection.terrain.brims import find_brims

CAMERA = pinhole(60, 320, 60.0, 0.15)
POSED = PosedCamera(CAMERA, pitch_deg=20.0, height_m=1.2)
HORIZON = 59
SKY, GROUND = 200, 100
EDGE_M = 2.0


def plateau(x, y):
    """Level ground that ends 2 m ahead; below is nothing."""
    return np.where(y > EDGE_M, -1e3, 0.0)


@cache
def looked():
    return POSED.look(plateau)


def ground_texture():
    return np.random.default_rng(4).uniform(-40, 40, CAMERA.shape)


def view_of(*, sky=SKY, ground=GROUND, contrast=1.0, noise=0.0, disparity=None, change=None):
    """Matched ground under a plain sky; `change` edits the left image."""
    shown, _, _ = looked()
    left = np.where(shown > 0, ground + contrast * ground_texture(), sky).astype(np.float64)
    left += np.random.default_rng(5).normal(0, noise, left.shape)
    if change is not None:
        change(left)
    left = np.clip(np.rint(left), 0, 255).astype(np.uint8)
    stereo = POSED.stereo(shown if disparity is None else disparity)
    frame = replace(stereo.frame, pair=(left, np.zeros_like(left)))
    return replace(stereo, frame=frame, grey_noise=max(noise, 0.5) * 2**0.5)


def sky_in(stereo, excluded=None):
    return sky_in_place_of_ground(stereo, excluded, PARAMETERS.backdrop)


def brims_in(stereo):
    return find_brims(with_backdrop(stereo, None, PARAMETERS), PARAMETERS)


def test_sky_reaches_from_the_horizon_down_to_the_edge():
    stereo = view_of()
    sky, ground = sky_in(stereo), stereo.disparity > 0
    below = stereo.expected > 0
    assert not (sky & ~below).any()
    assert not (sky & ground).any()
    # The window that looks for texture does not reach over the edge.
    missed = below & ~ground & ~sky
    assert missed.any(axis=0).all()
    assert missed.sum(axis=0).max() <= PARAMETERS.backdrop.window_px // 2 + 1


def test_ground_that_ends_before_the_sky_has_a_brim_in_each_column():
    stereo = view_of()
    assert not find_brims(stereo, PARAMETERS).columns.size, 'without the sky'
    brims = brims_in(stereo)
    assert np.unique(brims.columns).size == CAMERA.width
    assert brims.sure.all()
    _, _, y = looked()
    before_m = EDGE_M - y[brims.rows, brims.columns]
    assert before_m.min() > 0
    assert before_m.max() < 0.1


def test_sky_is_plain_in_a_noisy_image_too():
    quiet, noisy = sky_in(view_of()), sky_in(view_of(noise=6.0))
    assert noisy.sum() > 0.9 * quiet.sum()


def test_a_brighter_sky_higher_up_does_not_matter():
    def brighten(left):
        left[:30] += 40

    assert sky_in(view_of(change=brighten)).sum() == sky_in(view_of()).sum()


@pytest.mark.parametrize(
    ('textured_rows', 'expected'), [(HORIZON - 10, True), (HORIZON - 7, False)]
)
def test_the_lowest_window_above_the_horizon_shows_whether_there_is_sky(textured_rows, expected):
    # Hills on the horizon, and above it. The window has the nine rows before the horizon.
    def add_hills(left):
        left[:textured_rows] += ground_texture()[:textured_rows]

    stereo = view_of(change=add_hills)
    assert (stereo.expected <= 0).sum(axis=0).tolist() == [HORIZON] * CAMERA.width
    assert sky_in(stereo).any() == expected


def test_the_brightness_of_the_lowest_window_counts():
    def darken(left):
        left[HORIZON - 9 : HORIZON] = SKY - 50

    assert not sky_in(view_of(change=darken)).any()

    def darken_higher(left):
        left[: HORIZON - 9] = SKY - 50

    assert sky_in(view_of(change=darken_higher)).any()


def test_sky_alone_ends_at_no_edge():
    def clear(left):
        left[:] = SKY

    assert not sky_in(view_of(change=clear)).any()


@pytest.mark.parametrize(
    ('view', 'why'),
    [
        ({'sky': 5, 'ground': 120}, 'black sky may be shadow'),
        ({'sky': 180, 'ground': 170, 'contrast': 0.1}, 'ground fades into haze'),
        ({'sky': 252, 'ground': 290}, 'clipped ground is as bright as the sky'),
    ],
)
def test_plain_areas_that_may_be_ground_are_no_sky(view, why):
    assert not sky_in(view_of(**view)).any(), why


def test_plain_ground_of_another_brightness_is_no_sky():
    below = POSED.stereo(looked()[0]).expected > 0

    def darken(left):
        left[below & (looked()[0] <= 0)] -= 50

    assert not sky_in(view_of(change=darken)).any()


def test_sky_below_an_object_is_not_seen_through_it():
    def add_beam(left):
        left[60:80, 20:40] += ground_texture()[60:80, 20:40]

    columns = sky_in(view_of(change=add_beam))[85:90].any(axis=0)
    assert not columns[24:36].any()
    assert columns[:15].all()
    assert columns[45:].all()


def test_without_the_horizon_in_view_sky_reaches_down_from_the_top_of_the_image():
    stereo = view_of()
    steep = PosedCamera(CAMERA, pitch_deg=75.0, height_m=1.2).stereo(stereo.disparity)
    assert steep.expected.min() > 0
    sky = sky_in(replace(stereo, expected=steep.expected))
    np.testing.assert_array_equal(sky[60:], sky_in(stereo)[60:])
    assert sky[PARAMETERS.backdrop.window_px : 60].all()


@pytest.mark.parametrize('pitch_deg', [20.0, 75.0])
def test_plain_ground_that_matches_is_no_sky(pitch_deg):
    # In front of a shadow, with and without the horizon in view.
    stereo = view_of()
    seen = PosedCamera(CAMERA, pitch_deg=pitch_deg, height_m=1.2).stereo(stereo.disparity)
    stereo = replace(stereo, expected=seen.expected)
    sky = sky_in(stereo)
    matches = np.random.default_rng(6).random(CAMERA.shape)
    few, many = (
        replace(stereo, disparity=np.where(sky & (matches < share), 10, stereo.disparity))
        for share in (0.1, 0.9)
    )
    np.testing.assert_array_equal(sky_in(few), sky)
    assert not sky_in(many).any()


@pytest.mark.parametrize('rows', [1, 4, 16])
def test_an_empty_border_at_the_top_does_not_hide_the_sky(rows):
    def blacken(left):
        left[:rows] = 0
        # The rim is half black.
        left[rows] /= 2

    stereo = view_of(change=blacken)
    empty = np.zeros(CAMERA.shape, np.bool_)
    empty[:rows] = True
    steep = PosedCamera(CAMERA, pitch_deg=75.0, height_m=1.2).stereo(stereo.disparity)
    for expected in (stereo.expected, steep.expected):
        sky = sky_in(replace(stereo, expected=expected), empty)
        np.testing.assert_array_equal(sky[60:], sky_in(view_of())[60:])


def test_a_mask_that_excludes_nothing_changes_nothing():
    stereo = view_of()
    steep = PosedCamera(CAMERA, pitch_deg=75.0, height_m=1.2).stereo(stereo.disparity)
    stereo = replace(stereo, expected=steep.expected)
    without = sky_in(stereo, np.zeros(CAMERA.shape, np.bool_))
    np.testing.assert_array_equal(without, sky_in(stereo))
    assert without.any()


def test_the_rover_is_no_sky():
    stereo = view_of()
    rover = np.zeros(CAMERA.shape, np.bool_)
    rover[:, :30] = True
    sky = sky_in(stereo, rover)
    assert not sky[:, :30].any()
    assert sky[:, 35:].any(axis=0).all()


def test_what_lies_beyond_the_range_shows_a_brim_before_it():
    shown, _, _ = looked()
    # Textured hills 60 m away behind the edge, where the range ends at 40 m.
    disparity = np.where(shown > 0, shown, CAMERA.disparity_at(60.0)).astype(np.float32)

    def add_texture(left):
        left += ground_texture()

    stereo = view_of(disparity=disparity, change=add_texture)
    assert not find_brims(stereo, PARAMETERS).columns.size
    assert np.unique(brims_in(stereo).columns).size == CAMERA.width


def test_only_sky_and_what_is_too_far_moves():
    stereo = view_of()
    moved = with_backdrop(stereo, None, PARAMETERS)
    sky = sky_in(stereo)
    np.testing.assert_array_equal(moved.disparity[~sky], stereo.disparity[~sky])
    np.testing.assert_array_equal(moved.noise_px[~sky], stereo.noise_px[~sky])
    np.testing.assert_allclose(moved.disparity[sky], CAMERA.disparity_at(40.0), rtol=2e-4)
    assert not moved.noise_px[sky].any()
