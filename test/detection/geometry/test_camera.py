from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.errors import CameraError, ObstacleDetectionError


def camera_info(side='left', *, fx=400.0, fy=410.0, cx=319.5, cy=239.5, baseline=0.12, **fields):
    """Fields such as ``p3`` replace one number of P."""
    shift = -fx * baseline if side == 'right' else 0.0
    p = [fx, 0.0, cx, shift, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    for index in range(12):
        p[index] = fields.pop(f'p{index}', p[index])
    return SimpleNamespace(**{'width': 640, 'height': 480, 'p': p, **fields})


def pair(left=None, right=None, **both):
    return (
        camera_info('left', **{**both, **(left or {})}),
        camera_info('right', **{**both, **(right or {})}),
    )


def roi(x, y, width, height):
    return SimpleNamespace(x_offset=x, y_offset=y, width=width, height=height)


def refusal(*infos):
    with pytest.raises(CameraError) as caught:
        StereoCamera.from_camera_info(*infos)
    assert isinstance(caught.value, ObstacleDetectionError)
    return str(caught.value)


def camera(**changes):
    numbers = {'width': 640, 'height': 480, 'fx': 400.0, 'fy': 400.0, 'cx': 319.5, 'cy': 239.5}
    return StereoCamera(**{**numbers, 'baseline_m': 0.1, **changes})


def test_camera_info_gives_focal_lengths_centre_and_baseline():
    found = StereoCamera.from_camera_info(*pair())
    assert (found.width, found.height, found.shape) == (640, 480, (480, 640))
    assert (found.fx, found.fy, found.cx, found.cy) == (400.0, 410.0, 319.5, 239.5)
    assert found.baseline_m == pytest.approx(0.12)
    assert found.cx_right == 319.5
    assert found.disparity_offset == 0


@given(
    fx=st.floats(200, 5000),
    aspect=st.floats(0.3, 3),
    cx=st.floats(-100, 1000),
    offset=st.floats(-300, 300),
    cy=st.floats(-100, 570),
    baseline=st.floats(0.002, 2.9),
)
def test_camera_info_round_trip(fx, aspect, cx, offset, cy, baseline):
    fy, cx_right = fx * aspect, cx + offset
    both = {'fx': fx, 'fy': fy, 'cy': cy, 'baseline': baseline}
    found = StereoCamera.from_camera_info(*pair({'cx': cx}, {'cx': cx_right}, **both))
    assert (found.fx, found.fy, found.cx, found.cy) == (fx, fy, cx, cy)
    assert found.cx_right == cx_right
    assert found.baseline_m == pytest.approx(baseline)


def test_projection_matrix_may_be_an_array_named_upper_case_p():
    left, right = pair()
    for info in (left, right):
        info.P = np.array(info.p).reshape(3, 4)
        del info.p
    assert StereoCamera.from_camera_info(left, right).fx == 400.0


def test_binning_divides_size_and_calibration():
    found = StereoCamera.from_camera_info(*pair(binning_x=2, binning_y=4))
    assert (found.width, found.height) == (320, 120)
    assert (found.fx, found.fy, found.cx, found.cy) == (200.0, 102.5, 159.75, 59.875)
    assert found.cx_right == 159.75
    assert found.baseline_m == pytest.approx(0.12)


def test_binning_of_zero_means_no_binning():
    found = StereoCamera.from_camera_info(*pair(binning_x=0, binning_y=0))
    assert found == StereoCamera.from_camera_info(*pair())


def test_region_of_interest_moves_the_principal_point():
    found = StereoCamera.from_camera_info(*pair(roi=roi(100, 60, 320, 200)))
    assert (found.width, found.height) == (320, 200)
    assert (found.cx, found.cy, found.cx_right) == (219.5, 179.5, 219.5)


def test_region_of_interest_without_size_is_the_whole_image():
    found = StereoCamera.from_camera_info(*pair(roi=roi(0, 0, 0, 0)))
    assert (found.width, found.height, found.cx) == (640, 480, 319.5)


def test_offset_is_subtracted_before_binning():
    found = StereoCamera.from_camera_info(
        *pair(roi=roi(100, 60, 320, 200), binning_x=2, binning_y=2)
    )
    assert (found.width, found.height) == (160, 100)
    assert (found.cx, found.cy, found.fx) == (109.75, 89.75, 200.0)


def test_left_and_right_may_have_different_column_offsets():
    found = StereoCamera.from_camera_info(
        *pair({'roi': roi(100, 60, 320, 200)}, {'roi': roi(80, 60, 320, 200)})
    )
    assert (found.cx, found.cx_right) == (219.5, 239.5)
    assert found.disparity_offset == -20


def test_difference_of_principal_points_is_the_disparity_of_infinity():
    found = StereoCamera.from_camera_info(*pair({'cx': 319.5}, {'cx': 300.0}))
    assert found.disparity_offset == 19.5


@pytest.mark.parametrize(
    ('infos', 'said'),
    [
        (pair()[::-1], ['P[3] is 0.0', 'baseline', 'swapped']),
        (pair(baseline=-0.12), ['P[3] is 48.0', '-0.12 m', 'swapped']),
        (pair(baseline=0.0), ['P[3] is -0.0', 'baseline is 0 m']),
        (pair(fx=0.0), ['left camera_info', 'P[0] (fx) is 0.0', 'positive']),
        (pair(right={'fy': 0.0}), ['right camera_info', 'P[5] (fy) is 0.0']),
        (pair(left={'fx': -400.0}), ['left camera_info', 'P[0] (fx) is -400.0']),
        (pair(p=[0.0] * 12), ['left camera_info', 'P[0] (fx) is 0.0']),
        (pair(right={'cx': math.nan}), ['right camera_info', 'not finite', 'nan']),
        (pair(left={'cy': math.inf}), ['left camera_info', 'not finite', 'inf']),
        (pair(p=[1.0] * 11), ['left camera_info', 'P has 11 numbers', 'expected 12']),
        (pair(p=[]), ['P has 0 numbers', 'expected 12']),
        (pair(right={'p': None}), ['right camera_info', 'no projection matrix']),
        (pair(width=0), ['left camera_info: size is 0 x 480', 'positive width and height']),
        (pair(height=0), ['left camera_info: size is 640 x 0']),
        (pair(height=-1), ['640 x -1', 'positive width and height']),
        (pair(right={'width': 320}), ['640 x 480', '320 x 480', 'the same']),
        (pair(right={'binning_x': 2}), ['binning (1, 1)', 'binning (2, 1)']),
        (pair(right={'fx': 404.0}), ['P[0] (fx)', '400.0', '404.0', 'rectified']),
        (pair(right={'fy': 414.0}), ['P[5] (fy)', '410.0', '414.0', 'rectified']),
        (pair(right={'cy': 241.0}), ['P[6] (cy)', '239.5', '241.0', 'rectified']),
        (pair(right={'p7': -48.0}), ['P[7]', '0.0', '-48.0', 'rectified']),
        (pair(right={'p1': 3.0}), ['right camera_info', 'P[1] is 3: expected 0', 'skew']),
        (pair(right={'p8': 3.0}), ['right camera_info', 'P[8] is 3: expected 0']),
        (pair(left={'p10': 0.0}), ['left camera_info', 'P[10] is 0: expected 1']),
        (pair(fx=0.9), ['fx is 0.9 pixels', 'field of view']),
        (pair(left={'p3': -48.0}), ['P[3] is -48.0, so the baseline is 0 m', 'left one is -48']),
        (
            pair({'roi': roi(0, 60, 320, 200)}, {'roi': roi(0, 58, 320, 200)}),
            ['roi.y_offset', '60', '58', 'rows'],
        ),
    ],
)
def test_invalid_calibration_is_rejected_with_the_field_name(infos, said):
    message = refusal(*infos)
    for part in said:
        assert part in message
    assert '\n' not in message


@pytest.mark.parametrize(('missing', 'size'), [('width', '0 x 480'), ('height', '640 x 0')])
def test_a_camera_info_without_a_size_has_none(missing, size):
    infos = pair()
    for info in infos:
        delattr(info, missing)
    assert f'left camera_info: size is {size}' in refusal(*infos)


def test_an_image_may_be_one_pixel():
    one = pair(width=1, height=1, fx=1.0, fy=1.0, cx=0.0, cy=0.0)
    assert StereoCamera.from_camera_info(*one).shape == (1, 1)


@pytest.mark.parametrize('field', ['width', 'height', 'fx', 'fy', 'baseline_m'])
@pytest.mark.parametrize('value', [0, -1, math.nan, math.inf])
def test_non_positive_numbers_are_rejected(field, value):
    with pytest.raises(CameraError, match=f'{field} is {value}: expected a positive number'):
        camera(**{field: value})


@pytest.mark.parametrize('field', ['cx', 'cy', 'cx_right'])
@pytest.mark.parametrize('value', [math.nan, -math.inf])
def test_numbers_that_are_not_finite_are_rejected(field, value):
    with pytest.raises(CameraError, match=f'{field} is {value}: expected a finite number'):
        camera(**{field: value})


@pytest.mark.parametrize(
    ('changes', 'said'),
    [
        ({'fx': 1e30}, r'fx is 1e\+30 pixels and width 640, a field of view of \S+ degrees'),
        ({'fx': 1e-30, 'fy': 1e-30}, r'fx is 1e-30 .* view of 180 degrees: expected 0\.5 to 170'),
        ({'fy': 10.0}, 'fy is 10 pixels and height 480, a field of view of 175 degrees'),
        ({'width': 20000}, 'width is 20000: expected at most 16384 pixels'),
        ({'cx': 5000.0}, r'cx is 5000 and width 640, .* 85\.\d degrees off the optical axis'),
        ({'cy': -4000.0}, 'cy is -4000 and height 480'),
        (
            {'baseline_m': 12.0},
            r'the baseline is 12 m: expected 0\.001 to 5 m; is it in another unit',
        ),
        ({'baseline_m': 1e-4}, r'baseline is 0\.0001 m'),
        ({'cx_right': 800.0}, r'cx is 319\.5 on the left and 800 on the right, 480 pixels apart'),
        ({'cx_right': -10.0}, 'pixels apart: expected at most half the width, 320'),
    ],
)
def test_numbers_of_no_real_camera_are_rejected(changes, said):
    with pytest.raises(CameraError, match=said):
        camera(**changes)


@pytest.mark.parametrize(
    ('accepted', 'refused'),
    [
        ({'baseline_m': 0.001}, {'baseline_m': 0.00099}),
        ({'baseline_m': 5.0}, {'baseline_m': 5.01}),
        (
            {'width': 16384, 'cx': 8191.5, 'fx': 8192.0},
            {'width': 16385, 'cx': 8192.0, 'fx': 8192.0},
        ),
        ({'cx_right': -0.5}, {'cx_right': -0.6}),
        ({'cx_right': 639.5}, {'cx_right': 639.6}),
        ({'fy': 240 / math.tan(math.radians(84.9))}, {'fy': 240 / math.tan(math.radians(85.1))}),
        ({'fx': 320 / math.tan(math.radians(0.26))}, {'fx': 320 / math.tan(math.radians(0.24))}),
        (
            {'cx': 319.5 - 400 * math.tan(math.radians(79.9)), 'cx_right': -1900.0},
            {'cx': 319.5 - 400 * math.tan(math.radians(80.1)), 'cx_right': -1900.0},
        ),
        # Half a pixel more than the middle of 16 pixels would be 0.2 degrees.
        (
            {'width': 16, 'fx': 2.0, 'cx': 7.5 + 2 * math.tan(math.radians(79.9))},
            {'width': 16, 'fx': 2.0, 'cx': 7.5 + 2 * math.tan(math.radians(80.1))},
        ),
        (
            {'cy': 239.5 + 400 * math.tan(math.radians(79.9))},
            {'cy': 239.5 + 400 * math.tan(math.radians(80.1))},
        ),
    ],
)
def test_limits_of_a_real_camera_belong_to_it(accepted, refused):
    assert camera(**accepted)
    with pytest.raises(CameraError):
        camera(**refused)


@pytest.mark.parametrize(
    ('accepted', 'refused'),
    [
        ({'fx': 400.3}, {'fx': 400.5}),
        ({'fy': 410.4}, {'fy': 410.5}),
        ({'cy': 239.7}, {'cy': 239.8}),
        ({'p7': 0.9e-3}, {'p7': 1.1e-3}),
        ({'p1': 3.9e-4}, {'p1': 4.1e-4}),
        ({'p11': -3.9e-4}, {'p11': -4.1e-4}),
    ],
)
def test_small_differences_of_left_and_right_are_rounding(accepted, refused):
    assert StereoCamera.from_camera_info(*pair(right=accepted))
    refusal(*pair(right=refused))


def test_camera_of_reversed_rows_has_its_centre_as_far_from_the_other_border():
    upright = camera(cy=200.0, cx_right=300.0)
    assert upright.mirrored() == camera(cy=279.0, cx_right=300.0)
    assert upright.mirrored().mirrored() == upright


def test_wide_telephoto_and_converging_cameras_are_accepted():
    assert camera(fx=60.0, fy=60.0)  # 159 degrees wide
    assert camera(fx=20000.0, fy=20000.0)  # 1.8 degrees
    assert camera(cx_right=400.0).disparity_offset == -80.5


def test_baseline_counts_between_the_cameras_wherever_their_origin_is():
    left, right = pair({'p3': -20.0}, {'p3': -68.0})
    assert StereoCamera.from_camera_info(left, right).baseline_m == pytest.approx(0.12)
    left, right = pair({'p3': 24.0}, {'p3': -24.0})
    assert StereoCamera.from_camera_info(left, right).baseline_m == pytest.approx(0.12)


def test_message_for_a_negative_baseline_suggests_swapped_images():
    with pytest.raises(CameraError, match=r'P_right\[3\].*swapped'):
        camera(baseline_m=-0.1)


def test_camera_is_immutable():
    with pytest.raises(dataclasses.FrozenInstanceError):
        camera().fx = 1.0


@given(depth=st.floats(0.05, 500))
def test_depth_and_disparity_are_inverse(depth):
    each = camera()
    assert each.disparity_at(depth) == pytest.approx(400 * 0.1 / depth)
    assert each.depth_m(each.disparity_at(depth)) == pytest.approx(depth)


def project(each, x, y, z):
    return each.fx * x / z + each.cx, each.fy * y / z + each.cy, each.disparity_at(z)


@given(
    x=st.floats(-1, 1),
    y=st.floats(-1, 1),
    z=st.floats(0.3, 20),
    width=st.integers(200, 2000),
    height=st.integers(200, 1200),
)
def test_resized_camera_projects_points_to_the_same_place(x, y, z, width, height):
    each = camera(cx_right=311.5)
    small = each.resized(width, height)
    column, row, disparity = project(each, x, y, z)
    scale_x, scale_y = width / 640, height / 480
    # Pixel centres lie at integers, so the image begins at -0.5.
    assert project(small, x, y, z) == pytest.approx(
        ((column + 0.5) * scale_x - 0.5, (row + 0.5) * scale_y - 0.5, disparity * scale_x)
    )
    assert small.disparity_offset == pytest.approx(8 * scale_x)
    assert small.shape == (height, width)


def test_rays_point_through_the_pixel_centres():
    x_over_z, y_over_z = camera(width=5, height=3, fx=2.0, fy=4.0, cx=2.0, cy=1.0).rays()
    assert x_over_z.dtype == y_over_z.dtype == np.float32
    np.testing.assert_array_equal(x_over_z, [[-1.0, -0.5, 0.0, 0.5, 1.0]])
    np.testing.assert_array_equal(y_over_z, [[-0.25], [0.0], [0.25]])
