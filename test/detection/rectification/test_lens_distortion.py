from __future__ import annotations

import numpy as np
import pytest
import waves

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.rectification.lens_distortion import (
    NO_DISTORTION,
    STRAIGHT_LENSES,
    LensDistortion,
    Lenses,
)
from rover_obstacle_detection.detection.rectification.parameters import RectificationParameters

CAMERA = StereoCamera(240, 180, 150.0, 140.0, 125.0, 80.0, 0.1, cx_right=110.0)
WIDE = StereoCamera(401, 16, 200.0, 200.0, 200.0, 7.5, 0.1)
COLUMNS, ROWS = np.meshgrid(
    np.arange(CAMERA.width, dtype=np.float32), np.arange(CAMERA.height, dtype=np.float32)
)
INNER = np.s_[12:-12, 16:-16]
PARAMETERS = RectificationParameters()


def view(lens):
    left, _ = Lenses(lens).views(CAMERA)
    return left


def test_stretch_is_browns_polynomial():
    lens = LensDistortion(0.1, -0.02, 0.003)
    x, y = np.array([[0.0, 0.6, 3.0]], np.float32), np.array([[0.0], [0.8], [4.0]], np.float32)
    found = lens.stretch(x, y)
    assert found.dtype == np.float32
    assert found.shape == (3, 3)
    assert found[0, 0] == 0
    assert found[1, 1] == pytest.approx(0.1 - 0.02 + 0.003)
    assert found[2, 2] == pytest.approx(0.1 * 25 - 0.02 * 25**2 + 0.003 * 25**3)


def test_radial_derivative_is_the_slope_of_the_apparent_radius():
    lens = LensDistortion(0.1, -0.02, 0.003)
    radius, nothing = np.linspace(0.2, 1.5, 20, dtype=np.float32), np.zeros(20, np.float32)
    further = radius + np.float32(0.01)
    apparent, apparent_further = (r * (1 + lens.stretch(r, nothing)) for r in (radius, further))
    found = lens.radial_derivative(radius + np.float32(0.005), nothing)
    np.testing.assert_allclose(found, (apparent_further - apparent) / 0.01, atol=2e-4)
    assert np.ptp(found) > 0.1


def test_distortion_is_true_if_there_is_any():
    assert not NO_DISTORTION
    assert not LensDistortion(0.0, 0.0, 0.0)
    assert LensDistortion(0.0, 1e-6, 0.0)
    assert not STRAIGHT_LENSES
    assert Lenses(right=LensDistortion(0.1))
    assert Lenses(LensDistortion(0.1))


@pytest.mark.parametrize('side', ['left', 'right'])
@pytest.mark.parametrize('coefficients', [(0.1, 0, 0), (0, 0.1, 0), (0.1, 0.05, -0.05)])
def test_straightened_image_has_no_distortion(side, coefficients):
    lens = LensDistortion(*coefficients)
    where = waves.straight_left if side == 'left' else waves.straight_right
    straight = waves.as_image(waves.texture(COLUMNS, ROWS))
    bent = waves.as_image(waves.texture(*where(CAMERA, COLUMNS, ROWS, lens)))
    other = np.zeros_like(bent)
    pair = (bent, other) if side == 'left' else (other, bent)
    found = Lenses(**{side: lens}).straightened(pair, CAMERA)

    def error(image):
        return np.median(np.abs(image.astype(float) - straight)[INNER])

    assert error(bent) > 2
    assert error(found[pair[0] is other]) < 1
    assert found[pair[0] is bent] is other


def test_distorted_and_straight_places():
    lens = LensDistortion(0.05, -0.01, 0.0)
    columns, rows = view(lens).distorted_places()
    # Column 200 of row 150 is half a focal length to the right of the axis and half one below it.
    assert columns[150, 200] == pytest.approx(125 + 75 * (1 + 0.05 * 0.5 - 0.01 * 0.25))
    assert rows[150, 200] == pytest.approx(80 + 70 * (1 + 0.05 * 0.5 - 0.01 * 0.25))
    straight = view(lens).straight_places(PARAMETERS)
    assert all(each.dtype == np.float32 for each in (columns, rows, *straight))
    expected = waves.straight_left(CAMERA, COLUMNS, ROWS, lens)
    np.testing.assert_allclose(straight, expected, atol=0.02)


def test_straight_places_in_the_right_image():
    lens = LensDistortion(0.05, -0.01, 0.0)
    _, right = Lenses(right=lens).views(CAMERA)
    expected = waves.straight_right(CAMERA, COLUMNS, ROWS, lens)
    np.testing.assert_allclose(right.straight_places(PARAMETERS), expected, atol=0.02)


def test_places_that_no_straight_image_shows_are_nan():
    # Nothing appears farther out than at a radius of 0.384 focal lengths.
    columns, rows = view(LensDistortion(-1.0)).straight_places(PARAMETERS)
    radius = np.hypot(*CAMERA.rays())
    assert np.isfinite(columns[radius < 0.35]).all()
    assert np.isnan(columns[radius > 0.4]).mean() > 0.9
    np.testing.assert_array_equal(np.isnan(columns), np.isnan(rows))


def test_mean_and_largest_bend():
    assert STRAIGHT_LENSES.mean_bend_px(WIDE) == 0
    # Over radii of up to one focal length r^3 is a quarter on average.
    lenses = Lenses(LensDistortion(-0.004), LensDistortion(0.01))
    assert lenses.mean_bend_px(WIDE) == pytest.approx(0.01 * 200 / 4, rel=0.1)
    assert lenses.max_bend_px(WIDE) == pytest.approx(0.01 * 200, rel=0.01)


def test_each_lens_bends_about_its_own_principal_point():
    camera = StereoCamera(401, 16, 200.0, 200.0, 200.0, 7.5, 0.1, cx_right=100.0)
    assert Lenses(LensDistortion(0.01)).max_bend_px(camera) == pytest.approx(2, rel=0.01)
    right = Lenses(right=LensDistortion(0.01))
    assert right.max_bend_px(camera) == pytest.approx(2 * 1.5**3, rel=0.01)


@pytest.mark.parametrize('cx', [0.0, 63.0])
@pytest.mark.parametrize('cy', [0.0, 47.0])
def test_largest_bend_may_lie_in_any_corner(cx, cy):
    camera = StereoCamera(64, 48, 100.0, 100.0, cx, cy, 0.1)
    bend_px = 0.01 * np.hypot(0.63, 0.47) ** 3 * 100
    assert Lenses(LensDistortion(0.01)).max_bend_px(camera) == pytest.approx(bend_px, rel=1e-5)


def test_largest_bend_may_lie_between_centre_and_border():
    # r^3 - r^5 is largest at a radius of sqrt(3 / 5).
    lenses = Lenses(LensDistortion(0.01, -0.01))
    assert lenses.max_bend_px(WIDE) == pytest.approx(2 * 0.6**1.5 * 0.4, rel=0.01)


def test_change_from_former_lenses():
    former = Lenses(LensDistortion(0.02), LensDistortion(0.01))
    now = Lenses(LensDistortion(0.016), LensDistortion(0.02))
    assert now.change_px(WIDE, now) == 0
    assert now.change_px(WIDE, former) == pytest.approx(0.01 * 200 / 4, rel=0.1)


def test_pixels_that_the_image_shows_with_a_margin():
    # A barrel image shows more than the straight one.
    assert view(LensDistortion(-0.1)).seen(reach_px=4).all()
    seen = view(LensDistortion(0.1)).seen(reach_px=0)
    assert seen[20:-20, 30:-30].all()
    assert not seen[0, 0]
    with_margin = view(LensDistortion(0.1)).seen(reach_px=4)
    row = 80
    assert np.flatnonzero(with_margin[row])[0] == np.flatnonzero(seen[row])[0] + 4


def test_without_distortion_everything_is_seen_up_to_the_border():
    assert view(NO_DISTORTION).seen(reach_px=4).all()


def test_seen_is_what_the_distorted_image_contains():
    lens = LensDistortion(0.1)
    x, y = CAMERA.rays()
    stretched = 1 + lens.stretch(x, y)
    columns, rows = (
        CAMERA.cx + CAMERA.fx * x * stretched,
        CAMERA.cy + CAMERA.fy * y * stretched,
    )
    inside = (columns >= 0) & (columns <= 239) & (rows >= 0) & (rows <= 179)
    assert not inside[[0, -1], 125].any()
    np.testing.assert_array_equal(view(lens).seen(reach_px=0), inside)


def test_nothing_is_seen_beyond_the_radius_where_the_polynomial_turns_back():
    # r - 0.5 r^3 is largest at a radius of 0.82 focal lengths.
    seen = view(LensDistortion(-0.5)).seen(reach_px=4)
    radius = np.hypot(*CAMERA.rays())
    assert not seen[radius > 0.82].any()
    assert seen[radius < 0.7].all()


@pytest.mark.parametrize('disparity_px', [0, 20])
def test_matched_pixels_must_be_seen_in_the_right_image_too(disparity_px):
    lenses = Lenses(right=LensDistortion(0.1))
    disparity = np.full(CAMERA.shape, disparity_px, np.float32)
    seen = lenses.seen(disparity, CAMERA, reach_px=4)
    _, right = lenses.views(CAMERA)
    # The camera's offset is 15 px.
    shift = disparity_px + 15
    expected = np.zeros_like(seen)
    expected[:, shift:] = right.seen(4)[:, :-shift]
    assert 0.5 < expected.mean() < 0.95
    np.testing.assert_array_equal(seen, expected)
