from dataclasses import replace
from types import SimpleNamespace

import pytest

from rover_obstacle_detection.calibration_files.numbers import CameraNumbers, rectified_camera
from rover_obstacle_detection.calibration_files.request import CalibrationRequest
from rover_obstacle_detection.errors import CameraError
from rover_obstacle_detection.messages.rectification import StereoRectification

LEFT = rectified_camera((640, 480), (400, 0, 310, 0, 0, 410, 230, 0, 0, 0, 1, 0))
RIGHT = rectified_camera((640, 480), (400, 0, 305, -48, 0, 410, 230, 0, 0, 0, 1, 0))


def calibration(numbers, recorded=None):
    request = CalibrationRequest(numbers=CameraNumbers(**numbers))
    return request.calibration(lambda: (640, 480), 'left.png', recorded)


def camera(numbers, recorded=None):
    return calibration(numbers, recorded).camera


def test_numbers_give_a_camera_with_its_centre_in_the_image():
    one = camera({'fx': 500.0, 'baseline_m': 0.12})
    assert (one.width, one.height) == (640, 480)
    assert (one.fx, one.fy, one.cx, one.cy) == (500, 500, 319.5, 239.5)
    assert (one.cx_right, one.baseline_m) == (319.5, pytest.approx(0.12))


def test_every_number_is_used():
    numbers = {'fx': 500.0, 'fy': 490.0, 'cx': 310.0, 'cy': 230.0, 'cx_right': 305.0}
    one = camera({**numbers, 'baseline_m': 0.12})
    assert (one.fx, one.fy, one.cx, one.cy, one.cx_right) == (500, 490, 310, 230, 305)


def test_the_field_of_view_gives_the_focal_length():
    assert camera({'hfov_deg': 90.0, 'baseline_m': 0.12}).fx == pytest.approx(320)


@pytest.mark.parametrize(
    ('numbers', 'changed'),
    [
        ({'baseline_m': 0.2}, {'baseline_m': 0.2}),
        ({'fx': 480.0}, {'fx': 480, 'fy': 492}),
        ({'fy': 400.0}, {'fy': 400}),
        ({'cx': 320.0}, {'cx': 320, 'cx_right': 315}),
        ({'cx_right': 320.0}, {'cx_right': 320}),
        ({'cy': 240.0}, {'cy': 240}),
        ({'hfov_deg': 90.0}, {'fx': 320, 'fy': 328}),
    ],
)
def test_numbers_replace_values_of_a_calibration(numbers, changed):
    before = {'fx': 400, 'fy': 410, 'cx': 310, 'cy': 230, 'cx_right': 305, 'baseline_m': 0.12}
    one = camera(numbers, lambda: ((LEFT, RIGHT), 'topics'))
    after = {name: getattr(one, name) for name in before}
    assert after == pytest.approx({**before, **changed})


def test_numbers_are_those_of_cropped_and_binned_images():
    roi = SimpleNamespace(x_offset=40, y_offset=20, width=400, height=300)
    infos = tuple(replace(each, binning_x=2, binning_y=2, roi=roi) for each in (LEFT, RIGHT))
    one = camera({'fx': 100.0, 'cx': 99.5, 'cy': 70.0}, lambda: (infos, 'topics'))
    assert (one.width, one.fx, one.cx, one.cy) == (200, 100, 99.5, 70)
    assert camera({'hfov_deg': 90.0}, lambda: (infos, 'topics')).fx == pytest.approx(100)


@pytest.mark.parametrize('numbers', [{'fx': 480.0}, {'hfov_deg': 90.0}, {'cx': 300.0, 'cy': 9.0}])
def test_images_that_are_rectified_stay_as_they_are(numbers):
    found = calibration(numbers, lambda: ((LEFT, RIGHT), 'topics'))
    assert not StereoRectification(found).is_needed


def test_a_lens_keeps_its_focal_length():
    bent = replace(LEFT, d=(-0.1, 0.0, 0.0, 0.0, 0.0))
    found = calibration({'fx': 480.0}, lambda: ((bent, RIGHT), 'topics'))
    assert (found.left.k, found.left.d, found.left.p[0]) == (LEFT.k, bent.d, 480)
    assert (found.right.k, found.right.p[0]) == (RIGHT.k, 480)


def test_a_missing_baseline_is_filled_in():
    right = replace(RIGHT, p=LEFT.p)
    assert camera({'baseline_m': 0.3}, lambda: ((LEFT, right), 'topics')).baseline_m == 0.3


@pytest.mark.parametrize(
    ('numbers', 'words'),
    [
        ({}, 'lacks fx (or hfov) and baseline: expected --fx or --hfov, --baseline, or'),
        ({'fx': 500.0, 'cx': 3.0}, 'lacks baseline: expected --baseline, or --calibration'),
        ({'baseline_m': 0.1}, 'lacks fx (or hfov): expected'),
        (
            {'fx': 500.0, 'baseline_m': 60.0},
            '--fx 500 --baseline 60: the baseline is 60 m: expected',
        ),
        ({'hfov_deg': 190.0, 'baseline_m': 0.1}, '--hfov 190: hfov is 190 degrees: expected 0.5'),
        ({'fx': 500.0, 'cx': 9e9, 'baseline_m': 0.1}, 'off the optical axis'),
    ],
)
def test_what_is_missing_or_wrong_is_said(numbers, words):
    with pytest.raises(CameraError) as caught:
        camera(numbers)
    assert words in str(caught.value)
