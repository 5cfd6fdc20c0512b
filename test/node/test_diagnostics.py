from __future__ import annotations

import dataclasses
from typing import Any

import pytest

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.node.connections import Connections
from rover_obstacle_detection.node.diagnostics import (
    ERROR,
    OK,
    WARN,
    NodeState,
    Status,
    figures_of_late,
    statuses,
    worth_logging,
)
from rover_obstacle_detection.node.load import Load
from rover_obstacle_detection.node.pairing_watch import PairingWatch
from rover_obstacle_detection.node.statistics import DetectionFigures, Recent, Snapshot
from rover_obstacle_detection.node.watchdog import Faults, WatchdogLimits
from rover_obstacle_detection.pairing import PairingStatistics

CAMERA = StereoCamera(width=64, height=48, fx=100.0, fy=100.0, cx=31.5, cy=23.5, baseline_m=0.1)
COUNTS = Snapshot(
    pair_rate_hz=10.0,
    detection_rate_hz=4.0,
    detected=40,
    dropped=60,
    lost=2,
    bad={'ImageError': 1},
    latency_p50_ms=81.25,
    latency_p95_ms=99.0,
    latest=DetectionFigures(
        valid_share=0.963, obstacle_share=0.0514, rows_off_px=0.62, lens_bend_px=0.25,
        camera_height_m=0.987, camera_pitch_deg=31.26,
    ),
    recent=Recent(judged=4),
    load=Load(pairs=100),
)  # fmt: skip
PAIRING = PairingStatistics(
    left=103, right=102, pairs=101, unmatched_left=2, unmatched_right=1, pending_left=0,
    pending_right=0, smallest_gap_ns=0, recent_gap_ns=1_500_000, spacing_ns=100_000_000,
    pair_gap_ns=2_000_000,
)  # fmt: skip
LIMITS = WatchdogLimits(frozen_after=10, stale_after_s=2.0, max_image_age_s=2.0)
ONE_CAMERA = Connections(publishers={'/left': 'published by /camera'})
GOOD = NodeState(
    lifecycle='active',
    subscribed=True,
    counts=COUNTS,
    pairing=PAIRING,
    camera=CAMERA,
    calibration_problem='',
    image_age_s=0.0213,
)


def judged(**changes: Any) -> dict[str, Status]:
    return {each.task: each for each in statuses(dataclasses.replace(GOOD, **changes))}


def counts(**changes: Any) -> dict[str, Snapshot]:
    return {'counts': dataclasses.replace(COUNTS, **changes)}


def figures(**changes: Any) -> dict[str, Snapshot]:
    return counts(latest=dataclasses.replace(COUNTS.latest, **changes))


def recent(**changes: Any) -> dict[str, Snapshot]:
    return counts(recent=Recent(**changes))


def load(**changes: Any) -> dict[str, Snapshot]:
    return counts(load=Load(**changes))


def faults(**texts: str) -> dict[str, Any]:
    return {'faults': Faults(**texts)}


def test_good_state_is_ok_with_all_values() -> None:
    status = judged()

    assert {each.level for each in status.values()} == {OK}
    assert status['stereo input'].values == {
        'pair rate (Hz)': '10.00',
        'images lost on the way': '2',
        'image age (ms)': '21.3',
        'left images': '103',
        'right images': '102',
        'pairs': '101',
        'unmatched left': '2',
        'unmatched right': '1',
        'smallest stamp gap (ms)': '1.500',
        'stamp gap of recent pairs (ms)': '2.000',
    }
    assert status['calibration'].message == 'calibrated'
    assert status['calibration'].values['baseline (m)'] == '0.1000'
    assert status['calibration'].values['rows off (px)'] == '0.62'
    assert status['calibration'].values['lenses bend (px)'] == '0.25'
    detection = status['detection'].values
    assert (detection['latency p50 (ms)'], detection['latency p95 (ms)']) == ('81.2', '99.0')
    assert (detection['dropped frames'], detection['bad frames']) == ('60', '1')
    assert detection['bad frames: ImageError'] == '1'
    assert detection['frames with warnings'] == '0'
    assert detection['valid disparity (%)'] == '96.3'
    assert (detection['camera height (m)'], detection['camera pitch (deg)']) == ('0.99', '31.3')
    assert detection['obstacles (% of pixels)'] == '5.1'


@pytest.mark.parametrize(
    ('changes', 'task', 'level', 'message'),
    [
        ({'subscribed': False}, 'detection', OK, 'idle'),
        ({'subscribed': False}, 'stereo input', OK, 'idle'),
        ({'lifecycle': 'inactive', 'pairing': None}, 'stereo input', OK, 'inactive'),
        ({'camera': None, 'calibration_problem': 'P is zero'}, 'calibration', ERROR, 'P is zero'),
        (
            load() | {'topics': ('/left', '/right'), 'connections': ONE_CAMERA},
            'stereo input',
            WARN,
            'no pair of /left (published by /camera) and /right (no publisher)',
        ),
        (
            load(pairs=9, images=160, lost=224),
            'stereo input',
            WARN,
            '58% of the images of the last 10 s were lost on the way (224 of 384): give the '
            'camera driver the Fast DDS profile',
        ),
        (
            {'pairing': dataclasses.replace(PAIRING, pair_gap_ns=700_000_000)},
            'stereo input',
            WARN,
            'differ by up to 700 ms: moments differ; synchronise',
        ),
        ({'pairing_problem': '9 left, 9 right'}, 'stereo input', WARN, '9 left, 9 right'),
        (counts(detection_rate_hz=0.0, recent=Recent()), 'detection', OK, '0.0 detections'),
        ({'detecting_s': 12.3}, 'detection', ERROR, 'of one pair has been running for 12 s'),
        (
            load(latency_p95_s=2.4, pairs=9) | {'limits': LIMITS},
            'detection',
            WARN,
            'results come 2.4 s after their images (95th percentile of the last 10 s): expected '
            'at most max_image_age, 2 s; set speed to fast, or lower working_scale',
        ),
        (
            load(seconds=10.0, pairs=100, dropped=77, ended=23),
            'detection',
            WARN,
            "2.3 of 10.0 pairs per second are judged: lower the camera's rate, set speed to fast, "
            'or lower working_scale',
        ),
        ({'connections': Connections(errors=('two', 'more'))}, 'connections', ERROR, 'two; more'),
        ({'connections': Connections(warnings=('nothing',))}, 'connections', WARN, 'nothing'),
        (figures(valid_share=0.12), 'detection', WARN, 'only 12%'),
        ({'gravity_problem': 'no IMU'}, 'detection', WARN, 'no IMU'),
        (
            recent(judged=5, failed=2, problem='lens covered'),
            'detection',
            WARN,
            '2 of the last 7 pairs could not be judged: lens covered',
        ),
        (
            recent(failed=3, problem='lens covered'),
            'detection',
            ERROR,
            'none of the last 3 pairs could be judged: lens covered',
        ),
        (
            recent(failed=1, problem='lens covered'),
            'detection',
            ERROR,
            'none of the last 1 pair could be judged: lens covered',
        ),
        (recent(judged=3, warnings=('dark', 'blurred')), 'detection', WARN, 'dark; blurred'),
        (faults(input='no pair for 3.0 s'), 'stereo input', ERROR, 'no pair for 3.0 s'),
        (
            faults(input='no pair for 3.0 s') | {'pairing_problem': '9 left, 0 right'},
            'stereo input',
            ERROR,
            'no pair for 3.0 s: 9 left, 0 right',
        ),
        (faults(input='no pair for 3.0 s') | {'subscribed': False}, 'stereo input', OK, 'idle'),
        (
            faults(detection='no pair could be judged for 3.2 s: lens covered'),
            'detection',
            ERROR,
            'no pair could be judged for 3.2 s: lens covered',
        ),
        (figures(rows_off_px=1.2), 'calibration', WARN, 'rows off by 1.2 px'),
        (figures(lens_bend_px=3.4), 'calibration', WARN, 'lens distortion 3.4 px'),
        (figures(lens_bend_px=3.4) | {'lifecycle': 'inactive'}, 'calibration', OK, 'calibrated'),
    ],
)
def test_each_problem_has_its_level_and_message(
    changes: dict[str, Any], task: str, level: int, message: str
) -> None:
    status = judged(**changes)[task]

    assert status.level == level
    assert message in status.message


@pytest.mark.parametrize(
    'changes',
    [
        load(pairs=9, images=90, lost=10),
        load(pairs=9, images=2, lost=3),
        load(pairs=9, latency_p95_s=1.9) | {'limits': LIMITS},
        load(pairs=9, latency_p95_s=9.0),
        load(pairs=100, dropped=50),
        load(seconds=4.0, pairs=100, dropped=80),
        {'detecting_s': 9.0},
        {'pairing': dataclasses.replace(PAIRING, pair_gap_ns=50_000_000)},
    ],
)
def test_what_is_normal_is_ok(changes: dict[str, Any]) -> None:
    assert {each.level for each in judged(**changes).values()} == {OK}
    assert not list(worth_logging(dataclasses.replace(GOOD, **changes)))


def test_numbers_of_two_publishers_are_no_loss() -> None:
    changes = load(pairs=9, images=1, lost=9) | {'connections': Connections(errors=('two',))}

    assert judged(**changes)['stereo input'].level == OK


def test_problems_are_logged_with_their_level() -> None:
    changes = load(pairs=10, dropped=9) | {
        'detecting_s': 60.0,
        'connections': Connections(errors=('two nodes',), warnings=('not heard',)),
        'pairing': dataclasses.replace(PAIRING, pair_gap_ns=60_000_000),
    }

    logged = list(worth_logging(dataclasses.replace(GOOD, **changes)))

    assert [level for level, _ in logged] == [ERROR, WARN, WARN, ERROR, WARN]
    words = ['two nodes', 'not heard', 'moments differ', 'running for 60 s', 'are judged']
    assert all(word in text for word, (_, text) in zip(words, logged, strict=True))
    unmatched = dataclasses.replace(GOOD, **faults(input='no pair'), pairing_problem='0 pairs')
    assert list(worth_logging(unmatched)) == [(WARN, '0 pairs')]
    nothing = dataclasses.replace(GOOD, **load())
    assert [text for _, text in worth_logging(nothing)] == ['no pair of ']
    assert not list(worth_logging(dataclasses.replace(nothing, limits=LIMITS)))
    idle = dataclasses.replace(GOOD, **changes, subscribed=False)
    assert [text for _, text in worth_logging(idle)] == ['two nodes', 'not heard']
    assert not list(worth_logging(dataclasses.replace(idle, lifecycle='inactive')))


def test_images_on_other_topics_are_proposed_while_no_pair_arrives() -> None:
    others = {'connections': Connections(other_images=('/cam0/image_raw', '/cam1/image_raw'))}

    logged = list(worth_logging(dataclasses.replace(GOOD, **load() | others)))

    assert logged[0] == (
        WARN,
        'there are images on /cam0/image_raw, /cam1/image_raw: to use them, remap the inputs, '
        'such as -r left/image_rect:=/cam0/image_raw',
    )
    assert not list(worth_logging(dataclasses.replace(GOOD, **others)))


def test_figures_of_the_last_seconds_are_one_line() -> None:
    busy = load(seconds=10.0, pairs=98, ended=41, dropped=57, lost=3, latency_p95_s=0.4216)

    assert figures_of_late(dataclasses.replace(GOOD, **busy)) == (
        '9.8 pairs/s, 4.1 judged/s, latency 422 ms (95th percentile), obstacles on 5.1 % of the '
        'latest image, 57 pairs dropped, 3 images lost'
    )
    single = busy | load(seconds=10.0, pairs=98, dropped=1, lost=1)
    assert figures_of_late(dataclasses.replace(GOOD, **single)).endswith(
        ', 1 pair dropped, 1 image lost'
    )
    assert figures_of_late(dataclasses.replace(GOOD, **load())) == ''
    assert figures_of_late(dataclasses.replace(GOOD, **busy, subscribed=False)) == ''


def test_values_before_the_first_detection_are_unknown() -> None:
    nothing = counts(latency_p50_ms=None, latency_p95_ms=None, latest=DetectionFigures())

    status = judged(**nothing, pairing=None)

    assert status['detection'].values['latency p50 (ms)'] == 'unknown'
    for key in ('valid disparity (%)', 'camera height (m)', 'camera pitch (deg)'):
        assert status['detection'].values[key] == 'unknown'
    calibration = status['calibration']
    assert calibration.values['rows off (px)'] == 'unknown'
    assert calibration.level == OK


class Images:
    """Pairing counts that grow as images arrive."""

    def __init__(self) -> None:
        self.counts = dataclasses.replace(PAIRING, left=0, right=0, pairs=0)
        self.watch = PairingWatch(patience_s=3.0)

    def check(self, now_s: float, **more: int) -> str:
        changes = {name: getattr(self.counts, name) + number for name, number in more.items()}
        self.counts = dataclasses.replace(self.counts, **changes)
        return self.watch.check(self.counts, now_s)


def test_images_that_never_match_are_reported_after_three_seconds() -> None:
    images = Images()

    lines = [images.check(float(second), left=10, right=10) for second in range(6)]

    assert lines[:4] == [''] * 4
    assert lines[4].startswith('40 left, 40 right, 0 pairs, smallest gap 1.5 ms; try approximate')


@pytest.mark.parametrize(('gap_ms', 'spacing_ms'), [(300, 1000), (60, 1000), (15, 33), (51, None)])
def test_images_of_different_moments_are_not_to_be_paired(
    gap_ms: int, spacing_ms: int | None
) -> None:
    images = Images()
    images.counts = dataclasses.replace(
        images.counts,
        recent_gap_ns=gap_ms * 1_000_000,
        spacing_ns=None if spacing_ms is None else spacing_ms * 1_000_000,
    )

    lines = [images.check(float(second), left=1, right=1) for second in range(6)]

    assert lines[-1].endswith(
        f'0 pairs, smallest gap {gap_ms}.0 ms: the images show different moments; synchronise '
        'the cameras'
    )


def test_images_of_one_camera_only_are_reported() -> None:
    images = Images()

    lines = [images.check(float(second), left=10) for second in range(6)]

    assert lines[-1] == '50 left, 0 right, 0 pairs: no images from the right camera'


def test_pairs_and_silence_are_not_reported() -> None:
    images = Images()

    assert not any(images.check(float(s), left=1, right=1, pairs=1) for s in range(10))
    assert not any(images.check(10.0 + s) for s in range(10))
