from __future__ import annotations

import math
import re
import threading
from types import SimpleNamespace
from typing import Any

import pytest

from rover_obstacle_detection.node.calibration import LiveCalibration


def make_info(*, right: bool = False, fx: float = 100.0, width: int = 64) -> Any:
    p = [fx, 0, 31.5, 0, 0, fx, 23.5, 0, 0, 0, 1, 0]
    if right:
        p[3] = -fx * 0.1
    roi = SimpleNamespace(x_offset=0, y_offset=0, width=0, height=0)
    return SimpleNamespace(width=width, height=48, p=p, binning_x=0, binning_y=0, roi=roi)


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

    camera = calibration.wait_for_camera(30.0)

    other.join()
    assert camera is not None
    assert camera.fx == 200.0
    calibration.expect_confirmation()
    calibration.confirm(0)
    calibration.confirm(1)
    assert calibration.wait_for_camera(30.0) is camera


def test_known_camera_is_used_if_nothing_confirms_it(calibration: LiveCalibration) -> None:
    for side in (0, 1):
        calibration.update(side, make_info(right=bool(side)))
    camera, _ = calibration.state
    calibration.expect_confirmation()

    assert calibration.wait_for_camera(0.0) is camera
    # The second call does not wait.
    assert calibration.wait_for_camera(30.0) is camera
