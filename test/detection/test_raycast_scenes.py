"""The ray-caster and the expectations that the tests of hazards rely on."""

from __future__ import annotations

import math

import degrade
import numpy as np
import pytest
from hazard_scene import EDGE_M, Band, Fault, HazardScene, band_px
from hazard_scenes import HAZARD_SCENES
from random_scenes import random_scenes
from raycast import NOTHING, cast
from scene_parts import box, dome, level, line_across, profile, row_of, turned, wall
from surfaces import (
    BLIND,
    BRIM,
    FREE,
    NOT_FREE,
    OBSTACLE,
    UNCOUNTED,
    Light,
    Look,
    Patch,
    Rig,
    Shadow,
)

RIG = Rig(width=160, height=120, focal_px=125, baseline_m=0.12, height_m=0.9, pitch_deg=25)
DROP = ((-60.0, 0.0), (1.5, 0.0), (1.5, -0.8), (60.0, -0.8))


def _view(surfaces, *bands, **fields):
    return HazardScene('test', RIG, tuple(surfaces), tuple(bands), **fields).render()


def _drop(yaw_deg=0.0):
    parts = (*profile(list(DROP), [FREE, UNCOUNTED, UNCOUNTED]), line_across(1.5))
    parts = turned(parts, yaw_deg, (0.0, 1.5))
    return _view(parts[:-1], parts[-1])


def _disparity(depth_m):
    return RIG.focal_px * RIG.baseline_m / depth_m


def _shifted(image, disparity):
    """Read an image, column by column, so far to the left as the disparity says."""
    columns = np.arange(image.shape[1]) - disparity
    base = np.clip(np.floor(columns).astype(int), 0, image.shape[1] - 2)
    part = columns - base
    left, right = (np.take_along_axis(image.astype(float), base + add, 1) for add in (0, 1))
    return (1 - part) * left + part * right


def _right_depth(surfaces):
    """Depth of the right image: that of a left camera before which all is moved."""
    moved = tuple(
        each.__class__(**{**vars(each), name: tuple(np.subtract(vars(each)[name], (0.12, 0, 0)))})
        for each in surfaces
        for name in (('corner',) if isinstance(each, Patch) else ('centre',))
    )
    return cast(RIG, moved).depth_m


def test_disparity_of_level_ground_is_linear_in_the_rows():
    view = _view(level())
    camera, pitch = RIG.camera, math.radians(RIG.pitch_deg)
    rows = np.arange(30, 120)
    down = (rows - camera.cy) / camera.fy
    plane = camera.fx * RIG.baseline_m / RIG.height_m
    expected = plane * (math.sin(pitch) + down * math.cos(pitch))
    seen = _disparity(view.depth_m[30:])
    np.testing.assert_allclose(seen, np.broadcast_to(expected[:, None], seen.shape), rtol=1e-5)


@pytest.mark.parametrize('yaw_deg', [0.0, 35.0])
def test_depth_of_a_wall_is_that_of_its_plane(yaw_deg):
    rig = RIG.with_(pitch_deg=0.0)
    pair = cast(rig, (wall(1.4, yaw_deg, height_m=9.0),))
    across = (np.arange(160) - rig.camera.cx) / rig.focal_px
    expected = 1.4 / (1 - across * math.tan(math.radians(yaw_deg)))
    np.testing.assert_allclose(pair.depth_m[60], expected, rtol=1e-5)


def test_the_right_image_shows_the_left_one_where_the_disparity_says():
    surfaces = (*level(), wall(3.0, 20), *box(0.1, 1.3, (0.3, 0.3, 0.4)), dome(-0.4, 1.6, 0.25))
    view = _view(surfaces, light=Light(noise=0.0))
    disparity = np.nan_to_num(_disparity(view.depth_m))
    expected = _shifted(view.right, disparity)
    # What another surface hides in the right image matches nothing.
    seen = np.arange(160) - disparity > 0
    there = _shifted(_right_depth(surfaces), disparity)
    seen &= np.abs(there - view.depth_m) < 0.01 * view.depth_m
    assert seen.mean() > 0.8
    difference = np.abs(view.left.astype(float) - expected)[seen]
    assert np.median(difference) < 1.5
    assert view.left[seen].std() > 15


def test_a_nearer_surface_hides_a_farther_one_in_any_order():
    near, far = wall(1.0, expect=OBSTACLE), wall(2.0, expect=NOT_FREE)
    for surfaces in ((near, far), (far, near)):
        pair = cast(RIG.with_(pitch_deg=0), surfaces)
        assert np.nanmax(pair.depth_m) == pytest.approx(1.0, rel=1e-6)


def test_a_dome_stands_where_it_should():
    rig = RIG.with_(pitch_deg=0.0)
    ball = dome(0.0, 2.0, 0.4)
    pair = cast(rig, (*level(), ball))
    row = round(row_of(rig, 2.0, 0.2))
    middle = round(rig.camera.cx)
    z = rig.height_m - (row - rig.camera.cy) / rig.focal_px * pair.depth_m[row, middle]
    assert pair.surface[row, middle] == 1
    assert pair.depth_m[row, middle] == pytest.approx(2 - math.sqrt(0.4**2 - z**2), abs=0.01)


def test_a_mirror_shows_what_is_upright_upside_down():
    puddle = Patch((0, 2.0, 0.001), (1, 0, 0), (0, 1, 0), (-0.5, 0.5), (-0.6, 0.6))
    puddle = Patch(**{**vars(puddle), 'look': Look(60, 0.0, mirror=1.0), 'expect': NOT_FREE})
    bright = Patch((0, 3.0, 0), (1, 0, 0), (0, 0, 1), (-0.1, 0.1), (0, 3), Look(250, 0.0))
    dark = wall(3.1, look=Look(40, 0.0))
    view = _view((*level(), puddle, dark, bright), light=Light(noise=0.0))
    # The mirror image of the strip stands below the ground, at the distance of the strip.
    row = round(row_of(RIG, 3.0, -0.5))
    assert view.surface[row, 80] == len(level())
    lit = [np.flatnonzero(image[row, 60:100] > 80) for image in (view.left, view.right)]
    depth = RIG.in_camera(np.array([0.0, 3.0, -0.5]))[2]
    assert lit[0].size > 5
    assert lit[0].mean() - lit[1].mean() == pytest.approx(_disparity(depth), abs=0.6)


def test_shadow_and_fog_dim_what_they_should():
    clear = _view(level(), light=Light(noise=0.0))
    shadow = Light(noise=0.0, shadows=(Shadow((-9, 9), (1.0, 1.5)),))
    shaded = _view(level(), light=shadow)
    row = round(row_of(RIG, 1.25))
    assert shaded.left[row].max() < 15
    near = round(row_of(RIG, 0.8))
    np.testing.assert_array_equal(shaded.left[near], clear.left[near])
    foggy = _view(level(), light=Light(noise=0.0, fog=1.5))
    assert foggy.left[40].std() < 0.2 * clear.left[40].std()


def test_noise_differs_between_the_images_and_seeds():
    def noise(seed):
        light = Light(noise=2.0)
        pair = cast(RIG.with_(pitch_deg=-80), (), light, seed)
        return pair.left.astype(int) - 205, pair.right.astype(int) - 205

    (left, right), (other, _) = noise(1), noise(2)
    assert left.std() == pytest.approx(2.0, rel=0.05)
    assert abs(np.corrcoef(left.ravel(), right.ravel())[0, 1]) < 0.05
    assert abs(np.corrcoef(left.ravel(), other.ravel())[0, 1]) < 0.05


def test_band_lies_around_the_brim_and_free_ground_before_it():
    expected = _drop().expected
    brim, half = row_of(RIG, 1.5), band_px(RIG)
    rows = np.arange(120)
    np.testing.assert_array_equal(
        np.flatnonzero(expected[:, 100] == BRIM), rows[np.abs(rows - brim) < half]
    )
    free = np.flatnonzero(expected[:, 100] == FREE)
    before = max(brim + 2 * half, row_of(RIG, 1.5 - EDGE_M))
    assert free[0] == math.ceil(before)
    assert free[-1] == 119
    assert (expected[: int(brim - half), 100] == UNCOUNTED).all()


def test_band_follows_an_oblique_brim():
    straight, oblique = _drop().expected == BRIM, _drop(30.0).expected == BRIM
    first = oblique.argmax(axis=0)
    assert straight.any(axis=0).all()
    assert oblique.any(axis=0).all()
    # The right end of the brim is farther.
    assert (np.diff(first) <= 0).all()
    assert first[0] - first[-1] > 20


def test_band_ends_where_something_nearer_hides_the_brim():
    parts = (*profile(list(DROP), [FREE, UNCOUNTED, UNCOUNTED]), *box(0, 1.0, (0.3, 0.2, 0.5)))
    expected = _view(parts, Band((-60, 1.5, 0), (60, 1.5, 0))).expected
    brim = round(row_of(RIG, 1.5))
    assert expected[brim, 80] == OBSTACLE
    assert expected[brim, 10] == BRIM


def test_what_the_right_camera_does_not_see_is_not_free():
    view = _view(level())
    unseen = np.arange(160) < _disparity(view.depth_m)
    counted = view.expected == FREE
    assert counted.mean() > 0.5
    assert not counted[unseen].any()
    assert not counted[~(view.depth_m < 8 * RIG.height_m)].any()


def test_sky_is_not_counted_and_edges_have_a_margin():
    view = _view((*level(), *box(0, 1.5, (0.5, 0.3, 2.0))))
    assert (view.expected[view.surface == NOTHING] == UNCOUNTED).all()
    row = view.expected[60]
    obstacle = np.flatnonzero(row == OBSTACLE)
    stands = np.flatnonzero(view.surface[60] > 0)
    assert obstacle[0] - stands[0] == 1
    assert stands[-1] - obstacle[-1] == 1
    assert row[stands[-1] + 1] == UNCOUNTED
    assert row[stands[-1] + 2] == FREE


def test_a_dead_camera_leaves_nothing_to_judge():
    black = Fault(degrade.black, expect_all=BLIND)
    good, view = _view(level()), _view(level(), fault=black)
    assert not view.left.any()
    assert not view.right.any()
    np.testing.assert_array_equal(view.expected == BLIND, good.expected == FREE)


def test_behind_a_half_covered_right_lens_is_what_its_right_half_would_show():
    fault = Fault(lambda left, right: (left, right), half_covered='right')
    view = _view(level(), fault=fault)
    there = np.arange(160) - _disparity(view.depth_m)
    counted = (view.expected == FREE) | (view.expected == BLIND)
    assert counted.mean() > 0.5
    np.testing.assert_array_equal((view.expected == BLIND)[counted], (there >= 80)[counted])


def test_upside_down_the_right_camera_sees_the_left_image():
    stone = box(0.3, 1.5, (0.3, 0.3, 0.3))
    fault = Fault(degrade.upside_down, expect_all=NOT_FREE, upside_down=True)
    good, view = _view((*level(), *stone)), _view((*level(), *stone), fault=fault)
    np.testing.assert_array_equal(view.left[::-1, ::-1], good.right)
    np.testing.assert_array_equal(view.right[::-1, ::-1], good.left)
    seen, expected = (
        np.flatnonzero((each.surface > 0).any(axis=0)).mean() for each in (view, good)
    )
    # In the right image the stone stands farther left.
    assert 159 - seen == pytest.approx(expected - _disparity(1.6), abs=1)
    assert set(np.unique(view.expected)) == {NOT_FREE, UNCOUNTED}


def test_a_later_right_image_shows_nearer_ground():
    shown = _view((*level(), *box(0, 2.0, (0.3, 0.3, 0.3))), right_moved_m=(-RIG.baseline_m, 0.4))
    nearer = _view((*level(), *box(0, 1.6, (0.3, 0.3, 0.3))))
    dark = [image < 75 for image in (shown.right, nearer.left)]
    assert np.mean(dark[0][20:60, 70:90] == dark[1][20:60, 70:90]) > 0.8


def test_names_are_unique_and_each_kind_has_several():
    names = [scene.name for scene in HAZARD_SCENES]
    assert len(set(names)) == len(names)
    kinds = [scene.kind for scene in HAZARD_SCENES]
    assert min(kinds.count(kind) for kind in kinds) >= 4


@pytest.mark.parametrize('kind', sorted({scene.kind for scene in HAZARD_SCENES}))
def test_scenes_show_what_they_are_named_after(kind):
    asked = {
        'free': (FREE,),
        'drop': (BRIM,),
        'blind': (BLIND, NOT_FREE),
        'mirror': (FREE,),
    }.get(kind, (OBSTACLE, NOT_FREE, BRIM))
    for scene in HAZARD_SCENES:
        if scene.kind != kind:
            continue
        expected = scene.resized(160).render().expected
        values = set(np.unique(expected))
        assert np.isin(expected, asked).sum() > 15, scene.name
        if kind in ('free', 'blind'):
            assert values <= {*asked, UNCOUNTED}, scene.name
        if BRIM in values:
            assert (expected == BRIM).any(axis=0).mean() > 0.7, scene.name


def test_scenes_drawn_at_random_are_the_same_again_and_show_their_hazard():
    scenes, again = random_scenes(16, seed=3), random_scenes(8, seed=3)
    assert [each.name for each in scenes[:8]] == [each.name for each in again]
    assert scenes[4].rig == again[4].rig != random_scenes(5, seed=4)[4].rig
    for scene in scenes:
        expected = scene.resized(160).render().expected
        assert (expected == FREE).mean() > 0.005, scene.name
        hazard = np.isin(expected, (OBSTACLE, BRIM)).any()
        assert hazard == (scene.kind != 'free'), scene.name
