from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
import synthetic
import waves

from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane
from rover_obstacle_detection.detection.rectification.lens_distortion import (
    STRAIGHT_LENSES,
    LensDistortion,
    Lenses,
)
from rover_obstacle_detection.detection.rectification.parameters import RectificationParameters
from rover_obstacle_detection.detection.rectification.rectify import rectify
from rover_obstacle_detection.detection.rectification.reduced_pair import ReducedPair
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT, RowAlignment

FULL = synthetic.pinhole(640, 480, 80.0, 0.06)
CAMERA = FULL.resized(160, 120)
PLANE = DisparityPlane(0.0, 0.06, 6.0)
PARAMETERS = RectificationParameters()
ROWS_ONLY = replace(PARAMETERS, min_first_lens_gain=math.inf)


class Matcher:
    """Plain SGBM; `rows` has the alignment of each call."""

    def __init__(self):
        self.rows = []

    def __call__(self, pair, rows):
        self.rows.append(rows)
        left, right = (
            cv2.copyMakeBorder(image, 0, 0, 32, 0, cv2.BORDER_REPLICATE) for image in pair
        )
        columns = np.arange(-32, CAMERA.width, dtype=np.float32)
        right = cv2.remap(
            pair[1],
            columns - rows.added_disparity(CAMERA),
            rows.rows(CAMERA, columns),
            cv2.INTER_CUBIC,
            borderMode=cv2.BORDER_REPLICATE,
        )
        matcher = cv2.StereoSGBM_create(0, 32, 3, 300, 1200, 1, 63, 8, 50, 2, mode=2)
        found = matcher.compute(left, right)[:, 32:].astype(np.float32) / 16
        return np.maximum(found, 0)


def reduced_pair(rows=STRAIGHT, lenses=STRAIGHT_LENSES):
    """Quarter-size pair of a pair whose rows are off by `rows`."""
    pair = waves.stereo_pair(CAMERA, PLANE, rows.reduced(4), lenses=lenses, noise=1.0)
    return ReducedPair(pair, CAMERA, 4.0)


def error_px(disparity):
    matched = disparity > 0
    assert matched.mean() > 0.75
    return np.quantile(np.abs(disparity - PLANE.disparity(CAMERA))[matched], 0.9)


@pytest.mark.parametrize(('offset', 'turn'), [(1.0, 0.0), (-1.0, 0.004)])
def test_rows_are_in_pixels_of_the_full_image(offset, turn):
    found = rectify(reduced_pair(RowAlignment(offset, turn)), Matcher(), PARAMETERS)
    assert found.correction.rows.offset_px == pytest.approx(offset, abs=0.2)
    assert found.correction.rows.turn == pytest.approx(turn, abs=1e-3)
    assert not found.correction.lenses
    assert (found.camera, found.reduction) == (CAMERA, 4.0)


def test_disparity_of_the_turn_is_removed():
    turned = reduced_pair(RowAlignment(0.0, 0.006))
    match = Matcher()
    raw = match(turned.pair, STRAIGHT)
    found = rectify(turned, match, PARAMETERS).disparity
    assert error_px(found) < 0.7 * error_px(raw)
    assert (found >= 0).all()
    assert not found[raw == 0].any()


def test_disparity_of_the_turn_is_removed_from_every_match_however_far():
    turned = reduced_pair(RowAlignment(0.0, 0.006))
    raw = Matcher()(turned.pair, STRAIGHT)
    raw[:8], raw[8:10] = 0.5, 0
    found = rectify(turned, lambda pair, rows: raw.copy(), ROWS_ONLY)
    straight = raw - found.correction.rows.added_disparity(CAMERA)
    np.testing.assert_array_equal(found.disparity, np.where(raw > 0, np.maximum(straight, 0), 0))
    assert (found.disparity[:8] > 0.7).all()


LENSES = [
    Lenses(LensDistortion(0.01, -0.025)),
    Lenses(right=LensDistortion(0.01, -0.025)),
    Lenses(LensDistortion(0.01, -0.025), LensDistortion(-0.02)),
]


@pytest.mark.parametrize('lenses', LENSES, ids=str)
def test_lens_distortion_is_corrected(lenses):
    match = Matcher()
    bent = reduced_pair(RowAlignment(0.8), lenses)
    found = rectify(bent, match, PARAMETERS)
    assert found.correction.lenses
    assert found.correction.parameters is PARAMETERS
    assert found.correction.rows.offset_px == pytest.approx(0.8, abs=0.2)
    straight = rectify(reduced_pair(RowAlignment(0.8)), Matcher(), PARAMETERS)
    assert error_px(found.disparity) < 1.2 * error_px(straight.disparity)
    rows_only = rectify(bent, Matcher(), ROWS_ONLY)
    assert error_px(rows_only.disparity) > 1.5 * error_px(straight.disparity)
    # The first match knows nothing, the later ones get the rows in reduced pixels.
    assert match.rows[0] == STRAIGHT
    assert match.rows[-1] == found.correction.rows.reduced(4.0)
    assert len(match.rows) <= 1 + PARAMETERS.max_lens_passes


def test_pixels_matched_beyond_the_images_have_no_disparity():
    # Rows near the top and the bottom belong outside the image.
    pincushion = Lenses(LensDistortion(0.03), LensDistortion(0.05))
    found = rectify(reduced_pair(lenses=pincushion), Matcher(), PARAMETERS)
    unseen = found.correction.unseen(PLANE.disparity(CAMERA), CAMERA)
    assert unseen.any()
    assert not found.correction.unseen(found.disparity, CAMERA).any()


@pytest.mark.parametrize('rows', [STRAIGHT, RowAlignment(1.0, 0.004)], ids=str)
def test_straight_lenses_stay_straight(rows):
    assert not rectify(reduced_pair(rows), Matcher(), PARAMETERS).correction.lenses


@pytest.mark.parametrize(
    ('field', 'value'), [('min_lens_gain', math.inf), ('min_mean_bend_px', math.inf)]
)
def test_lenses_that_do_not_stand_up_to_a_second_look_are_dropped(field, value):
    match = Matcher()
    bent = reduced_pair(lenses=LENSES[0])
    found = rectify(bent, match, replace(PARAMETERS, **{field: value}))
    assert len(match.rows) > 1
    rows_only = rectify(bent, Matcher(), ROWS_ONLY)
    assert found.correction == rows_only.correction
    np.testing.assert_array_equal(found.disparity, rows_only.disparity)


def test_passes_end_when_the_lenses_settle():
    calls = {}
    for settled_px in (0.0, 100.0):
        match = Matcher()
        rectify(
            reduced_pair(lenses=LENSES[0]), match, replace(PARAMETERS, settled_lens_px=settled_px)
        )
        calls[settled_px] = len(match.rows)
    assert calls == {0.0: 1 + PARAMETERS.max_lens_passes, 100.0: 3}


def test_last_pass_is_not_measured_again():
    match = Matcher()
    single = replace(PARAMETERS, max_lens_passes=1, min_lens_gain=math.inf)
    assert rectify(reduced_pair(lenses=LENSES[0]), match, single).correction.lenses
    assert len(match.rows) == 2


def test_a_blank_pair_is_not_corrected():
    blank = np.zeros(CAMERA.shape, np.uint8)
    found = rectify(ReducedPair((blank, blank), CAMERA, 4.0), Matcher(), PARAMETERS)
    assert found.correction.rows == STRAIGHT
    assert not found.correction.lenses
