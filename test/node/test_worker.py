"""The worker without ROS, with a fake detector that the test controls."""

from __future__ import annotations

import threading
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

import rover_obstacle_detection.node.worker as module
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.rectification.lens_distortion import LensDistortion, Lenses
from rover_obstacle_detection.detection.rectification.row_alignment import RowAlignment
from rover_obstacle_detection.errors import CameraError, ImageError, UnjudgeablePairError
from rover_obstacle_detection.messages.calibration import CameraInfo
from rover_obstacle_detection.messages.rectification import Rectification
from rover_obstacle_detection.node.calibration import LiveCalibration
from rover_obstacle_detection.node.settings import Settings
from rover_obstacle_detection.node.statistics import NodeStatistics

SHAPE = (12, 16)


def info(*, right: bool = False) -> Any:
    p = [10.0, 0, 7.5, -1.0 if right else 0, 0, 10.0, 5.5, 0, 0, 0, 1, 0]
    roi = SimpleNamespace(x_offset=0, y_offset=0, width=0, height=0)
    bent = {'distortion_model': 'plumb_bob', 'd': (-0.3, 0.1, 0.0, 0.0, 0.0)}
    matrices = {'k': (10.0, 0, 7.5, 0, 10, 5.5, 0, 0, 1), 'r': np.identity(3).reshape(-1), 'p': p}
    return SimpleNamespace(
        width=16, height=12, binning_x=0, binning_y=0, roi=roi, **bent, **matrices
    )


PIXELS = np.random.default_rng(0).integers(0, 255, SHAPE, np.uint8)


def image() -> Any:
    return SimpleNamespace(
        header=object(), encoding='mono8', width=16, height=12, step=16, is_bigendian=0,
        data=PIXELS.tobytes(),
    )  # fmt: skip


class Detections:
    """Replaces Detector; each `detect` waits until the test releases it."""

    def __init__(self) -> None:
        self.made: list[DetectorConfig] = []
        self.entered = threading.Semaphore(0)
        self.go_on = threading.Semaphore(0)
        self.failures: list[Exception] = []
        self.no_detector: list[Exception] = []
        self.ground = GroundPlane((0.0, -1.0, 0.0), 0.8, (0.0, -1.0, 0.0))
        self.warnings: tuple[str, ...] = ()

    def __call__(self, camera: Any, config: DetectorConfig, rover_mask: Any) -> Detections:
        if self.no_detector:
            raise self.no_detector.pop()
        self.camera = camera
        self.made.append(config)
        return self

    def detect(self, left: Any, right: Any, *, gravity: Any, on_stage: Any) -> Any:
        self.images = left, right
        self.entered.release()
        assert self.go_on.acquire(timeout=30)
        if self.failures:
            raise self.failures.pop()
        return SimpleNamespace(
            disparity=np.ones(SHAPE),
            mask=np.zeros(SHAPE, np.uint8),
            alignment=RowAlignment(0.5),
            lenses=Lenses(LensDistortion(0.01)),
            ground=self.ground,
            warnings=self.warnings,
        )


class Bench:
    """A worker with its surroundings."""

    def __init__(self) -> None:
        self.settings = Settings.from_values({})
        self.calibration = LiveCalibration('/left/info', '/right/info')
        self.statistics = NodeStatistics()
        self.warnings: list[str] = []
        self.published: list[Any] = []
        self.unknown: list[Any] = []
        self.failures: list[Exception] = []
        self.done = threading.Semaphore(0)
        sources = module.Sources(
            settings=lambda: self.settings,
            gravity=lambda header: None,
            topics=lambda: ('/left', '/right'),
        )
        self.worker = module.DetectionWorker(
            sources,
            calibration=self.calibration,
            outputs=self,
            statistics=self.statistics,
            warn=self._warn,
        )

    def calibrate(self) -> None:
        self.calibration.update(0, info())
        self.calibration.update(1, info(right=True))

    def submit(self, fault: str = '') -> Any:
        left = image()
        self.worker.submit(module.ImagePair(left, image(), 0.0, fault))
        return left.header

    def publish(self, detection: Any, header: Any) -> None:
        if self.failures:
            raise self.failures.pop()
        self.published.append(header)
        self.done.release()

    def publish_unknown(self, shape: tuple[int, int], config: Any, header: Any) -> None:
        assert shape == SHAPE
        assert config == self.settings.config
        if self.failures:
            raise self.failures.pop()
        self.unknown.append(header)
        self.done.release()

    def _warn(self, line: str) -> None:
        self.warnings.append(line)
        self.done.release()


@pytest.fixture
def detections(monkeypatch: pytest.MonkeyPatch) -> Detections:
    detections = Detections()
    monkeypatch.setattr(module, 'Detector', detections)
    return detections


@pytest.fixture
def bench(detections: Detections) -> Any:
    bench = Bench()
    yield bench
    detections.go_on.release(100)
    bench.worker.stop()


def test_newest_pair_is_detected_and_the_others_are_counted(
    bench: Bench, detections: Detections
) -> None:
    bench.calibrate()
    first = bench.submit()
    assert detections.entered.acquire(timeout=30)
    headers = [bench.submit() for _ in range(4)]
    detections.go_on.release(2)
    assert bench.done.acquire(timeout=30)
    assert bench.done.acquire(timeout=30)

    assert bench.published == [first, headers[-1]]
    assert bench.statistics.snapshot().dropped == 3
    assert bench.statistics.snapshot().latest.rows_off_px == 0.5
    assert bench.statistics.snapshot().latest.lens_bend_px > 0


def test_raw_images_are_rectified_and_no_others(bench: Bench, detections: Detections) -> None:
    bench.calibrate()
    detections.go_on.release(2)
    rectified = Rectification(CameraInfo.from_message(info()), 'left')(PIXELS)
    assert not np.array_equal(rectified, PIXELS)
    for names, expected in (('', PIXELS), ('left and right', rectified)):
        bench.calibration.set_raw_images(names)
        bench.submit()
        assert bench.done.acquire(timeout=30)
        for seen in detections.images:
            np.testing.assert_array_equal(seen, expected)


def test_changed_settings_apply_to_the_next_pair(bench: Bench, detections: Detections) -> None:
    bench.calibrate()
    detections.go_on.release(3)
    for max_step in (0.1, 0.1, 0.3):
        if max_step != bench.settings.config.max_step:
            bench.settings = Settings.from_values({'max_step': max_step})
        bench.submit()
        assert bench.done.acquire(timeout=30)

    assert [config.max_step for config in detections.made] == [0.1, 0.3]


def test_detector_error_costs_one_pair(bench: Bench, detections: Detections) -> None:
    bench.calibrate()
    detections.failures.append(ZeroDivisionError('unforeseen'))
    detections.go_on.release(2)

    bench.submit()
    # Once for the outputs and once for the log.
    assert bench.done.acquire(timeout=30)
    assert bench.done.acquire(timeout=30)
    good = bench.submit()
    assert bench.done.acquire(timeout=30)

    assert bench.published == [good]
    assert 'ZeroDivisionError: unforeseen' in bench.warnings[0]
    assert bench.statistics.snapshot().bad == {'ZeroDivisionError': 1}


def opencv_error() -> Exception:
    try:
        cv2.resize(np.zeros((0, 0), np.uint8), (2, 2))
    except cv2.error as error:
        return error
    raise AssertionError


@pytest.mark.parametrize(
    ('error', 'name', 'words'),
    [
        (opencv_error(), 'cv2.error', 'resize'),
        (MemoryError('no memory'), 'MemoryError', 'MemoryError: no memory'),
        (CameraError('image is 8 x 8'), 'CameraError', 'image is 8 x 8'),
        (ImageError('data is short'), 'ImageError', 'data is short'),
    ],
)
@pytest.mark.parametrize('where', ['constructor', 'detect', 'publish'])
def test_pair_that_fails_is_published_as_unknown(
    bench: Bench, detections: Detections, where: str, error: Exception, name: str, words: str
) -> None:
    bench.calibrate()
    failures = {
        'constructor': detections.no_detector,
        'detect': detections.failures,
        'publish': bench.failures,
    }
    failures[where].append(error)
    detections.go_on.release(2)

    bad = bench.submit()
    # Once for the outputs and once for the log.
    assert bench.done.acquire(timeout=30)
    assert bench.done.acquire(timeout=30)
    good = bench.submit()
    assert bench.done.acquire(timeout=30)

    assert (bench.published, bench.unknown) == ([good], [bad])
    assert words in bench.warnings[0]
    snapshot = bench.statistics.snapshot()
    assert snapshot.bad == {name: 1}
    assert words in snapshot.recent.problem
    assert '\n' not in snapshot.recent.problem


def test_worker_survives_outputs_that_always_fail(bench: Bench, detections: Detections) -> None:
    bench.calibrate()
    bench.failures += [RuntimeError('context is invalid')] * 2
    detections.go_on.release(2)

    bench.submit()
    assert bench.done.acquire(timeout=30)
    assert bench.done.acquire(timeout=30)
    good = bench.submit()
    assert bench.done.acquire(timeout=30)

    assert (bench.published, bench.unknown) == ([good], [])
    assert bench.warnings[0].startswith(
        'nothing is published for a failed pair: detection failed: RuntimeError: context'
    )
    assert bench.statistics.snapshot().bad == {'RuntimeError': 1}


def test_time_of_the_running_detection_is_known(bench: Bench, detections: Detections) -> None:
    bench.calibrate()
    assert bench.worker.detecting_s == 0.0

    bench.submit()
    assert detections.entered.acquire(timeout=30)
    assert bench.worker.detecting_s > 0.0

    detections.go_on.release()
    bench.worker.stop()
    assert bench.worker.detecting_s == 0.0


def test_unjudgeable_pair_is_published_as_unknown_and_counted(
    bench: Bench, detections: Detections
) -> None:
    bench.calibrate()
    detections.failures.append(UnjudgeablePairError('lens covered'))
    detections.go_on.release(2)

    bad = bench.submit()
    # Once for the outputs and once for the log.
    assert bench.done.acquire(timeout=30)
    assert bench.done.acquire(timeout=30)
    good = bench.submit()
    assert bench.done.acquire(timeout=30)
    bench.worker.stop()

    assert (bench.published, bench.unknown) == ([good], [bad])
    assert bench.warnings == ['/left, /right: lens covered']
    snapshot = bench.statistics.snapshot()
    assert snapshot.bad == {'unjudgeable pair': 1}
    assert (snapshot.recent.judged, snapshot.recent.failed) == (1, 1)
    assert snapshot.recent.problem == '/left, /right: lens covered'


def test_pair_of_a_frozen_camera_is_not_detected(bench: Bench, detections: Detections) -> None:
    bench.calibrate()

    header = bench.submit(fault='left image has not changed')
    assert bench.done.acquire(timeout=30)
    bench.worker.stop()

    assert (bench.published, bench.unknown) == ([], [header])
    assert not detections.made
    snapshot = bench.statistics.snapshot()
    assert snapshot.bad == {'frozen image': 1}
    assert snapshot.recent.problem == 'left image has not changed'


def test_warnings_are_logged_and_counted(bench: Bench, detections: Detections) -> None:
    bench.calibrate()
    detections.warnings = ('dark', 'blurred')
    detections.go_on.release()

    bench.submit()
    for _ in range(3):
        assert bench.done.acquire(timeout=30)

    assert bench.warnings == ['dark', 'blurred']
    snapshot = bench.statistics.snapshot()
    assert snapshot.warned == 1
    assert snapshot.recent.warnings == ('dark', 'blurred')


@pytest.mark.parametrize(
    ('measured', 'values', 'expected'),
    [
        (True, {}, (0.8, 0.0)),
        (False, {}, (None, None)),
        (False, {'gravity_source': 'parameters'}, (None, 0.0)),
    ],
)
def test_pose_of_the_camera_is_reported_only_if_measured(
    bench: Bench,
    detections: Detections,
    measured: bool,
    values: dict[str, Any],
    expected: tuple[float | None, float | None],
) -> None:
    bench.calibrate()
    bench.settings = Settings.from_values(values)
    detections.ground = replace(detections.ground, measured=measured)
    detections.go_on.release()

    bench.submit()
    assert bench.done.acquire(timeout=30)
    bench.worker.stop()

    latest = bench.statistics.snapshot().latest
    assert (latest.camera_height_m, latest.camera_pitch_deg) == expected


def test_worker_waits_for_a_late_calibration(
    bench: Bench, detections: Detections, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, 'CALIBRATION_TIMEOUT_S', 30.0)
    detections.go_on.release()

    header = bench.submit()
    bench.calibrate()

    assert bench.done.acquire(timeout=30)
    assert bench.published == [header]


def test_missing_calibration_is_named_and_counted(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, 'CALIBRATION_TIMEOUT_S', 0.0)

    bench.submit()
    assert bench.done.acquire(timeout=30)

    assert bench.warnings[0].startswith('no calibration: nothing received on /left/info')
    assert bench.statistics.snapshot().bad == {'no calibration': 1}


def test_stop_waits_for_the_running_detection(bench: Bench, detections: Detections) -> None:
    bench.calibrate()
    header = bench.submit()
    assert detections.entered.acquire(timeout=30)
    stopping = threading.Thread(target=bench.worker.stop)
    stopping.start()

    detections.go_on.release()
    stopping.join(30)

    assert not stopping.is_alive()
    assert bench.published == [header]
