"""Why a pair cannot be judged, in words."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
import waves

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane
from rover_obstacle_detection.detection.stereo.pair_check import check_pair, row_offset
from rover_obstacle_detection.detection.stereo.parameters import SupportParameters
from rover_obstacle_detection.detection.stereo.support import Support
from rover_obstacle_detection.errors import UnjudgeablePairError

CAMERA = StereoCamera(240, 180, 150.0, 150.0, 119.5, 89.5, 0.1)
PARAMETERS = SupportParameters()
NOTHING = np.zeros(CAMERA.shape, bool)
GOOD = Support(
    supported=~NOTHING,
    plain=NOTHING,
    left_textured_share=0.9,
    right_textured_share=0.9,
    agreeing_share=0.9,
    same_share=0.05,
)
DISAGREEING = replace(GOOD, agreeing_share=0.1)


@cache
def good_pair():
    return waves.stereo_pair(CAMERA, DisparityPlane(0.004, 0.01, 12.0), noise=1.0)


def check(support, pair=None, matched_share=0.9, reduction=1.0):
    return check_pair(pair or good_pair(), support, matched_share, reduction, PARAMETERS)


def refusal(support, pair=None, matched_share=0.9, reduction=1.0):
    with pytest.raises(UnjudgeablePairError) as caught:
        check(support, pair, matched_share, reduction)
    return str(caught.value)


def unrelated(seed):
    return tuple(np.random.default_rng(seed).integers(0, 256, (2, *CAMERA.shape)).astype(np.uint8))


def flat(level):
    return np.full(CAMERA.shape, level, np.uint8)


def test_a_good_pair_is_accepted_without_a_word():
    assert check(GOOD) == ()


def test_a_pair_that_agrees_is_not_searched_for_faults():
    left, right = good_pair()
    assert check(replace(GOOD, agreeing_share=0.6), (cv2.blur(left, (9, 9)), right)) == ()


@pytest.mark.parametrize(('same_share', 'refused'), [(0.89, False), (0.91, True)])
def test_the_same_image_twice_is_named(same_share, refused):
    support = replace(GOOD, same_share=same_share)
    if refused:
        assert refusal(support) == 'both images are the same: is one camera on both sides?'
    else:
        assert check(support) == ()


@pytest.mark.parametrize(
    ('level', 'words'),
    [
        (0, 'it is black, check the lens cap, the light and the exposure'),
        (14, 'it is black, check the lens cap, the light and the exposure'),
        (15, 'check for a covered or fogged lens'),
        (240, 'check for a covered or fogged lens'),
        (241, 'it is white, check the exposure'),
        (255, 'it is white, check the exposure'),
    ],
)
def test_images_without_texture_are_named(level, words):
    bare = replace(GOOD, left_textured_share=0.01, right_textured_share=0.0, agreeing_share=1.0)
    pair = flat(level), flat(level)
    said = refusal(bare, pair, matched_share=0.29)
    assert said == f'neither image shows any texture: {words}'
    # Faint texture, as in fog, may still support matches.
    assert check(bare, pair, matched_share=0.31) == ()


@pytest.mark.parametrize('side', ['left', 'right'])
@pytest.mark.parametrize(
    ('level', 'words'),
    [(3, 'it is black'), (90, 'covered or fogged lens'), (250, 'it is white')],
)
def test_one_image_without_texture_is_named(side, level, words):
    pair = [*good_pair()]
    pair[side == 'right'] = flat(level)
    said = refusal(replace(DISAGREEING, **{f'{side}_textured_share': 0.04}), tuple(pair))
    assert said.startswith(f'the {side} image shows hardly any texture, the other does: ')
    assert words in said


@pytest.mark.parametrize('side', ['left', 'right'])
def test_one_image_may_show_less_texture(side):
    assert check(replace(GOOD, **{f'{side}_textured_share': 0.1})) == ()


def test_images_that_do_not_belong_together_are_named():
    said = refusal(DISAGREEING, unrelated(0))
    assert said.startswith('the right image does not belong to the left one, check that both come')
    assert said.endswith('10% of the textured pixels match')


@pytest.mark.parametrize(('share', 'refused'), [(0.44, True), (0.46, False), (0.59, False)])
def test_a_pair_that_half_agrees_gets_a_warning(share, refused):
    support = replace(GOOD, agreeing_share=share)
    if refused:
        assert '44% of the textured pixels match' in refusal(support)
    else:
        (said,) = check(support)
        assert said.startswith('the right image does not belong to the left one')
        assert said.endswith(f'only {share:.0%} of the textured pixels match')


@pytest.mark.parametrize('share', [0.1, 0.55])
@pytest.mark.parametrize('side', ['left', 'right'])
def test_the_image_out_of_focus_is_named(side, share):
    pair = [*good_pair()]
    pair[side == 'right'] = cv2.GaussianBlur(pair[side == 'right'], (0, 0), 3)
    said = refusal(replace(GOOD, agreeing_share=share), tuple(pair))
    assert said == (
        f'the {side} image is out of focus or smeared: {share:.0%} of the textured pixels match'
    )


def test_a_flat_image_is_not_out_of_focus():
    faint = waves.as_image(90 + 0.1 * (good_pair()[1] - 90.0))
    for pair in ((flat(90), faint), (faint, flat(90))):
        assert 'out of focus' not in refusal(DISAGREEING, pair)


def test_light_that_falls_off_across_an_image_is_no_blur():
    left, right = (0.4 * image for image in good_pair())
    pair = waves.as_image(left + np.linspace(0, 140, CAMERA.width)), waves.as_image(right)
    for each in (pair, pair[::-1]):
        assert 'out of focus' not in refusal(DISAGREEING, each)


def test_both_images_out_of_focus_are_alike():
    pair = tuple(cv2.GaussianBlur(image, (0, 0), 3) for image in good_pair())
    assert 'out of focus' not in refusal(DISAGREEING, pair)


@pytest.mark.parametrize(('rows', 'where'), [(9, 'lower'), (-6, 'higher'), (25, 'lower')])
@pytest.mark.parametrize('share', [0.1, 0.55])
def test_rows_that_are_off_are_named(rows, where, share):
    left, right = good_pair()
    down = np.roll(right, rows, axis=0)
    said = refusal(replace(GOOD, agreeing_share=share), (left, down))
    words = rf'the right image is (\d+) rows {where} than the left one, rectify them: {share:.0%}'
    found = re.match(words, said)
    assert found, said
    # Strips shift against each other by the disparity, so that slanted texture adds a row.
    assert int(found[1]) == pytest.approx(abs(rows), abs=2)


def test_rows_are_counted_in_the_images_as_recorded():
    left, right = good_pair()
    reduced = left, np.roll(right, 6, axis=0)
    rows = row_offset(reduced, PARAMETERS)
    assert rows == pytest.approx(6, abs=2)
    said = refusal(DISAGREEING, reduced, reduction=2.5)
    assert said.startswith(f'the right image is {round(2.5 * rows)} rows lower')


@pytest.mark.parametrize(('rows', 'found'), [(10, 10), (-10, -10), (11, 0), (-11, 0), (0, 0)])
def test_row_offsets_are_searched_up_to_a_limit(rows, found):
    levels = np.random.default_rng(6).integers(0, 256, CAMERA.height).astype(np.uint8)
    left = np.repeat(levels[:, np.newaxis], CAMERA.width, axis=1)
    parameters = replace(PARAMETERS, max_row_offset_px=10)
    assert row_offset((left, np.roll(left, rows, axis=0)), parameters) == found


@pytest.mark.parametrize('seed', range(8))
def test_unrelated_images_have_no_row_offset(seed):
    assert refusal(DISAGREEING, unrelated(seed)).startswith('the right image does not belong')


def test_small_images_are_checked_as_well():
    pair = tuple(np.ascontiguousarray(image[:16, :20]) for image in good_pair())
    assert refusal(DISAGREEING, pair)
