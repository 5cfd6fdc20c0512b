from __future__ import annotations

import numpy as np
import waves

from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.rectification.correction import UNCORRECTED, Correction
from rover_obstacle_detection.detection.rectification.lens_distortion import LensDistortion, Lenses
from rover_obstacle_detection.detection.rectification.row_alignment import RowAlignment

CAMERA = StereoCamera(240, 180, 150.0, 150.0, 119.5, 89.5, 0.1, cx_right=109.5)
COLUMNS, ROWS = np.meshgrid(
    np.arange(CAMERA.width, dtype=np.float32), np.arange(CAMERA.height, dtype=np.float32)
)
INNER = np.s_[12:-12, 16:-16]
BENT = LensDistortion(0.1)
LEFT, RIGHT = Correction(lenses=Lenses(BENT)), Correction(lenses=Lenses(right=BENT))
ROWS_ONLY = Correction(RowAlignment(0.5))


def frame(mask=None):
    left, right = np.zeros(CAMERA.shape, np.uint8), np.full(CAMERA.shape, 9, np.uint8)
    return Frame((left, right), CAMERA, excluded=mask)


def test_without_distortion_a_frame_stays_as_it_is():
    given = frame()
    assert UNCORRECTED.straightened(given) is given
    assert ROWS_ONLY.straightened(given) is given


def test_correction_of_reduced_images_has_the_same_angles():
    found = Correction(RowAlignment(0.5, 0.01), Lenses(BENT)).reduced(2.5)
    assert found == Correction(RowAlignment(0.2, 0.01), Lenses(BENT))


def test_correction_of_mirrored_images_has_the_opposite_rows():
    found = Correction(RowAlignment(0.5, 0.01), Lenses(BENT)).mirrored()
    assert found == Correction(RowAlignment(-0.5, -0.01), Lenses(BENT))


def test_images_are_straightened():
    straight = waves.as_image(waves.texture(COLUMNS, ROWS))
    bent = waves.as_image(waves.texture(*waves.straight_left(CAMERA, COLUMNS, ROWS, BENT)))
    right = frame().pair[1]
    found = LEFT.straightened(Frame((bent, right), CAMERA))
    assert np.median(np.abs(found.pair[0].astype(float) - straight)[INNER]) < 1
    assert found.pair[1] is right
    assert found.camera is CAMERA
    assert found.excluded is None


def test_excluded_is_straightened_as_the_left_image_is():
    columns, rows = waves.straight_left(CAMERA, COLUMNS, ROWS, BENT)
    mask = np.hypot(columns - 60, rows - 60) < 30
    straight = np.hypot(COLUMNS - 60, ROWS - 60) < 30
    found = LEFT.straightened(frame(mask)).excluded
    assert found.dtype == np.bool_
    assert (found & straight).sum() / (found | straight).sum() > 0.97
    assert (mask & straight).sum() / (mask | straight).sum() < 0.93
    np.testing.assert_array_equal(RIGHT.straightened(frame(mask)).excluded, mask)


def test_pixels_matched_with_what_an_image_does_not_show():
    disparity = np.full(CAMERA.shape, 20, np.float32)
    disparity[:, 100] = 0
    disparity[0] = 0.5
    for correction in (LEFT, RIGHT):
        unseen = correction.unseen(disparity, CAMERA)
        assert unseen.any()
        assert not unseen[60:120, 60:180].any()
        assert not unseen[disparity == 0].any()
    left = LEFT.unseen(disparity, CAMERA)
    assert left[0, 20]
    # Row 5 of the middle column appears 84.5 (1 + 0.1 (84.5 / 150)^2) px from the axis.
    assert left[3, 120]
    assert not left[12, 120]
    right = RIGHT.unseen(disparity, CAMERA)
    # Column 37 of the left image is matched with column 7 of the right one, 102 px from its axis.
    assert right[90, 37]
    assert not right[90, 55]


def test_nothing_is_unseen_in_full_straight_images():
    disparity = np.full(CAMERA.shape, 20, np.float32)
    assert ROWS_ONLY.unseen(disparity, CAMERA) is None
    barrel = LensDistortion(-0.1)
    unseen = Correction(lenses=Lenses(barrel, barrel)).unseen(disparity, CAMERA)
    assert not unseen[6:-6, 40:-6].any()


def test_only_a_bent_left_lens_needs_remapping():
    assert ROWS_ONLY.to_left_image(CAMERA) is None
    assert RIGHT.to_left_image(CAMERA) is None


def test_remapping_takes_the_nearest_pixel_of_the_straight_image():
    remapping = LEFT.to_left_image(CAMERA)
    columns, rows = waves.straight_left(CAMERA, COLUMNS, ROWS, BENT)
    assert remapping.shown.all()
    np.testing.assert_allclose(remapping(COLUMNS), columns, atol=0.53)
    np.testing.assert_allclose(remapping(ROWS, np.nan), rows, atol=0.53)
    points = np.stack((COLUMNS, ROWS, ROWS), axis=-1)
    np.testing.assert_array_equal(remapping(points)[..., 0], remapping(COLUMNS))


def test_pixels_that_the_straight_image_does_not_show_are_filled():
    barrel = LensDistortion(-0.1)
    remapping = Correction(lenses=Lenses(barrel)).to_left_image(CAMERA)
    columns, rows = waves.straight_left(CAMERA, COLUMNS, ROWS, barrel)
    expected = (columns >= -0.5) & (columns < CAMERA.width - 0.5)
    expected &= (rows >= -0.5) & (rows < CAMERA.height - 0.5)
    assert 0.8 < expected[90].mean() < 0.98
    assert 0.8 < expected[:, 120].mean() < 0.98
    np.testing.assert_array_equal(remapping.shown[90], expected[90])
    np.testing.assert_array_equal(remapping.shown[:, 120], expected[:, 120])
    filled = remapping(COLUMNS, -1)
    np.testing.assert_array_equal(filled == -1, ~remapping.shown)
    # Without a fill, they have what the border shows.
    assert (remapping(COLUMNS)[90, [0, -1]] == [0, CAMERA.width - 1]).all()
    assert (remapping(ROWS)[[0, -1], 120] == [0, CAMERA.height - 1]).all()
    points = remapping(np.ones((*CAMERA.shape, 3), np.float32), np.nan)
    np.testing.assert_array_equal(np.isnan(points).all(axis=-1), ~remapping.shown)


def test_every_pixel_that_the_straight_image_shows_is_shown():
    barrel = LensDistortion(-0.1)
    shown = Correction(lenses=Lenses(barrel)).to_left_image(CAMERA).shown
    places = np.stack(waves.straight_left(CAMERA, COLUMNS, ROWS, barrel), axis=-1)
    inside = (places > (-0.49, -0.49)) & (places < (CAMERA.width - 0.51, CAMERA.height - 0.51))
    outside = (places < (-0.51, -0.51)) | (places > (CAMERA.width - 0.49, CAMERA.height - 0.49))
    assert shown[inside.all(axis=-1)].all()
    assert not shown[outside.any(axis=-1)].any()
    assert shown.any(axis=0).sum() < CAMERA.width


def test_remapping_of_mirrored_images():
    remapping = Correction(lenses=Lenses(LensDistortion(-0.1))).to_left_image(CAMERA)
    image = COLUMNS + 1000 * ROWS
    mirrored = remapping.mirrored()
    np.testing.assert_array_equal(mirrored(image[::-1], -1), remapping(image, -1)[::-1])
    np.testing.assert_array_equal(mirrored(image[::-1]), remapping(image)[::-1])
    assert mirrored.pixels.dtype == np.int32


def test_where_the_inversion_fails_regions_keep_their_own_pixel():
    # Nothing appears farther out than at a radius of 0.384 focal lengths, 58 px.
    remapping = Correction(lenses=Lenses(LensDistortion(-1.0))).to_left_image(CAMERA)
    assert not remapping.shown[90, 0]
    assert remapping(COLUMNS)[90, 0] == 0
    assert remapping(ROWS)[20, 0] == 20


def test_rays_are_those_of_the_straight_image():
    x, y = LEFT.to_left_image(CAMERA).rays(CAMERA)
    columns, rows = waves.straight_left(CAMERA, COLUMNS, ROWS, BENT)
    assert x.dtype == y.dtype == np.float32
    np.testing.assert_allclose(x, (columns - CAMERA.cx) / CAMERA.fx, atol=0.53 / CAMERA.fx)
    np.testing.assert_allclose(y, (rows - CAMERA.cy) / CAMERA.fy, atol=0.53 / CAMERA.fy)
    barrel = Correction(lenses=Lenses(LensDistortion(-0.1)))
    x, y = barrel.to_left_image(CAMERA).rays(CAMERA)
    np.testing.assert_array_equal(np.isnan(x), ~barrel.to_left_image(CAMERA).shown)
    np.testing.assert_array_equal(np.isnan(x), np.isnan(y))
