from __future__ import annotations

import math
import re
import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rover_obstacle_detection.messages.calibration import CameraInfo
from rover_obstacle_detection.messages.rectification import Rectification
from rover_obstacle_detection.node.calibration import RECTIFIED, LiveCalibration


def make_info(*, right: bool = False, fx: float = 100.0, width: int = 64, **changes: Any) -> Any:
    p = [fx, 0, 31.5, 0, 0, fx, 23.5, 0, 0, 0, 1, 0]
    if right:
        p[3] = -fx * 0.1
    fields = {
        'width': width,
        'height': 48,
        'distortion_model': 'plumb_bob',
        'd': (0.0,) * 5,
        'k': (fx, 0, 31.5, 0, fx, 23.5, 0, 0, 1),
        'r': np.identity(3).reshape(-1),
        'p': p,
        'binning_x': 0,
        'binning_y': 0,
        'roi': SimpleNamespace(x_offset=0, y_offset=0, width=0, height=0),
    }
    return SimpleNamespace(**fields | changes)


@pytest.fixture
def calibration() -> LiveCalibration:
    return LiveCalibration('/left/camera_info', '/right/camera_info')


def test_missing_camera_info_is_named(calibration: LiveCalibration) -> None:
    assert calibration.state[1].endswith(
        'nothing received on /left/camera_info and /right/camera_info yet'
    )

    calibration.update(0, make_info())

    camera, problem = calibration.state
    assert camera is None
    assert problem == 'no calibration: nothing received on /right/camera_info yet'


def test_two_camera_infos_form_a_stereo_camera(calibration: LiveCalibration) -> None:
    calibration.update(0, make_info())
    calibration.update(1, make_info(right=True))

    camera, problem = calibration.state
    assert camera is not None
    assert (camera.width, camera.fx) == (64, 100.0)
    assert camera.baseline_m == pytest.approx(0.1)
    assert problem == ''


def test_repeated_calibration_keeps_the_camera(calibration: LiveCalibration) -> None:
    calibration.update(0, make_info())
    calibration.update(1, make_info(right=True))
    camera, _ = calibration.state

    assert not calibration.update(0, make_info())
    assert not calibration.update(1, make_info(right=True))

    assert calibration.state[0] is camera


def test_changed_calibration_replaces_the_camera(calibration: LiveCalibration) -> None:
    for side in (0, 1):
        calibration.update(side, make_info(right=bool(side)))
    for side in (0, 1):
        calibration.update(side, make_info(right=bool(side), fx=200.0, width=32))

    camera, _ = calibration.state
    assert camera is not None
    assert (camera.width, camera.fx) == (32, 200.0)


@pytest.mark.parametrize(
    ('fx', 'reason'),
    [(0.0, r'P\[0\] \(fx\) is 0.0'), (math.nan, 'not finite')],
)
def test_invalid_calibration_is_named_and_the_next_good_one_used(
    calibration: LiveCalibration, fx: float, reason: str
) -> None:
    calibration.update(0, make_info())
    calibration.update(1, make_info(right=True))

    assert calibration.update(0, make_info(fx=fx))
    assert not calibration.update(0, make_info(fx=fx))
    camera, problem = calibration.state
    assert camera is None
    assert re.search(reason, problem)
    assert '/left/camera_info' in problem

    calibration.update(0, make_info())
    assert calibration.state[0] is not None


def test_calibration_is_needed_again_after_reset(calibration: LiveCalibration) -> None:
    calibration.update(0, make_info())
    calibration.update(1, make_info(right=True))

    calibration.reset()

    assert calibration.state[0] is None
    assert calibration.update(0, make_info())


def test_wait_ends_when_the_camera_is_replaced_or_confirmed(
    calibration: LiveCalibration,
) -> None:
    for side in (0, 1):
        calibration.update(side, make_info(right=bool(side)))
    calibration.expect_confirmation()
    other = threading.Thread(
        target=lambda: [calibration.update(s, make_info(right=bool(s), fx=200.0)) for s in (0, 1)]
    )
    other.start()

    calibrated = calibration.wait_for_camera(30.0)

    other.join()
    assert calibrated is not None
    assert calibrated.camera.fx == 200.0
    calibration.expect_confirmation()
    calibration.confirm(0)
    calibration.confirm(1)
    assert calibration.wait_for_camera(30.0) is calibrated


def test_known_camera_is_used_if_nothing_confirms_it(calibration: LiveCalibration) -> None:
    for side in (0, 1):
        calibration.update(side, make_info(right=bool(side)))
    calibrated = calibration.calibrated
    calibration.expect_confirmation()

    assert calibrated is not None
    assert calibration.wait_for_camera(0.0) is calibrated
    # The second call does not wait.
    assert calibration.wait_for_camera(30.0) is calibrated


RAW = '/left/image_raw and /right/image_raw'
BENT = (-0.2, 0.05, 0.0, 0.0, 0.0)


def update_both(calibration: LiveCalibration, **changes: Any) -> None:
    for side in (0, 1):
        calibration.update(side, make_info(right=bool(side), **changes))


def test_only_raw_images_are_rectified(calibration: LiveCalibration) -> None:
    update_both(calibration, d=BENT)
    assert calibration.calibrated is not None
    assert calibration.calibrated[1:] == (None, RECTIFIED)

    assert calibration.set_raw_images(RAW)

    camera, rectify, treatment = calibration.calibrated
    assert camera.fx == 100.0
    assert treatment.startswith(f'{RAW} are raw images: rectifying them with K, D, R and P')
    image = np.random.default_rng(0).integers(0, 255, (48, 64), np.uint8)
    left, right = make_info(d=BENT), make_info(d=BENT, right=True)
    expected = Rectification(CameraInfo.from_message(left), 'left')(image)
    assert not np.array_equal(expected, image)
    assert rectify is not None
    for seen in rectify(image, image):
        np.testing.assert_array_equal(seen, expected)
    # A calibration that repeats costs no new maps.
    assert not calibration.update(0, left)
    assert not calibration.update(1, right)
    assert calibration.calibrated.rectify is rectify

    assert calibration.set_raw_images('')
    assert not calibration.set_raw_images('')
    assert calibration.calibrated[1:] == (None, RECTIFIED)


@pytest.mark.parametrize(
    'changes',
    [
        {'d': BENT},
        {'k': (90.0, 0, 31.5, 0, 90, 23.5, 0, 0, 1)},
        {'r': (1.0, 0, 0, 0, -1, 0, 0, 0, -1)},
    ],
)
def test_change_of_the_raw_camera_is_noticed(
    calibration: LiveCalibration, changes: dict[str, Any]
) -> None:
    calibration.set_raw_images(RAW)
    update_both(calibration, d=(-0.1, 0.0, 0.0, 0.0, 0.0))
    before = calibration.calibrated

    update_both(calibration, **changes)

    assert calibration.calibrated is not before


def test_raw_images_without_distortion_are_used_as_they_are_and_it_is_said(
    calibration: LiveCalibration,
) -> None:
    calibration.set_raw_images(RAW)
    update_both(calibration)

    assert calibration.calibrated is not None
    _, rectify, treatment = calibration.calibrated
    assert rectify is None
    assert treatment == (
        f'{RAW} are raw images, but there is no distortion or rotation in /left/camera_info, '
        '/right/camera_info: they are used as they are'
    )


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'k': (0.0,) * 9}, 'K is (0.0'),
        ({'distortion_model': 'scaramuzza', 'd': BENT}, "distortion_model is 'scaramuzza'"),
        ({'d': (math.nan,) * 5}, 'D is (nan'),
    ],
)
def test_raw_images_that_cannot_be_rectified_are_refused(
    calibration: LiveCalibration, changes: dict[str, Any], words: str
) -> None:
    calibration.set_raw_images(RAW)
    update_both(calibration, **changes)

    camera, problem = calibration.state
    assert camera is None
    assert problem.startswith(
        f'{RAW} are raw images and cannot be rectified: /left/camera_info, /right/camera_info: '
        + words
    )
    assert problem.endswith('if they are rectified, set rectify to never')

    update_both(calibration, d=BENT)
    assert calibration.calibrated is not None
    assert calibration.calibrated.rectify is not None
