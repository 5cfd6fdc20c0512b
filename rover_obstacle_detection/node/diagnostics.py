"""What the node says of itself on /diagnostics (REP-107), as plain values."""

from __future__ import annotations

from dataclasses import dataclass, field

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.node.statistics import Snapshot
from rover_obstacle_detection.pairing import PairingStatistics

OK, WARN, ERROR, STALE = range(4)
# Under this share of pixels with a disparity, most of the ground is not judged by 3D.
LOW_VALID_SHARE = 0.3
# What is made good is still the worse for it, and a sign that something was moved.
WORN_CALIBRATION_PX = 1.0


@dataclass(frozen=True)
class Status:
    """One ``diagnostic_msgs/DiagnosticStatus``.

    Parameters
    ----------
    task : str
        What of the node it is about.
    level : int
        0 OK, 1 WARN, 2 ERROR, 3 STALE.
    message : str
        The state in a few words.
    values : dict of str to str
    """

    task: str
    level: int
    message: str
    values: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class NodeState:
    """Everything that the statuses are made of, at one moment.

    Parameters
    ----------
    lifecycle : str
        Label of the lifecycle state.
    listening : bool
        Whether anybody listens to a detection, so that images are taken.
    counts : Snapshot
    pairing : PairingStatistics or None
        None while there are no inputs.
    camera : StereoCamera or None
    calibration_problem : str
        Why there is no camera.
    pairing_problem : str
        Why images come and no pairs; '' if they do.
    gravity_problem : str
        Why the configured source of gravity gives none; '' if it does.
    """

    lifecycle: str
    listening: bool
    counts: Snapshot
    pairing: PairingStatistics | None
    camera: StereoCamera | None
    calibration_problem: str
    pairing_problem: str = ''
    gravity_problem: str = ''


def statuses(state: NodeState) -> tuple[Status, ...]:
    """Judge the state: input, calibration, detection."""
    return _input(state), _calibration(state), _detection(state)


def _input(state: NodeState) -> Status:
    counts, pairing = state.counts, state.pairing
    values = {
        'pair rate (Hz)': f'{counts.pair_rate_hz:.2f}',
        'images lost on the way': str(counts.lost),
    }
    if pairing is not None:
        values |= {
            'left images': str(pairing.left),
            'right images': str(pairing.right),
            'pairs': str(pairing.pairs),
            'unmatched left': str(pairing.unmatched_left),
            'unmatched right': str(pairing.unmatched_right),
            'smallest stamp gap (ms)': _optional(pairing.smallest_gap_ns, 1e-6, 3),
        }
    level, message = _judge_input(state)
    return Status('stereo input', level, message, values)


def _judge_input(state: NodeState) -> tuple[int, str]:
    if state.lifecycle != 'active' or state.pairing is None:
        return OK, f'{state.lifecycle}: takes no images'
    if not state.listening:
        return OK, 'resting: nobody subscribes to a detection'
    if state.pairing_problem:
        return WARN, state.pairing_problem
    if state.counts.pair_rate_hz == 0:
        return WARN, 'no images'
    return OK, f'{state.counts.pair_rate_hz:.1f} pairs per second'


def _calibration(state: NodeState) -> Status:
    camera = state.camera
    if camera is None:
        level = OK if state.lifecycle != 'active' else ERROR
        return Status('calibration', level, state.calibration_problem)
    values = {
        'width (px)': str(camera.width),
        'height (px)': str(camera.height),
        'fx (px)': f'{camera.fx:.3f}',
        'cx left (px)': f'{camera.cx:.3f}',
        'cx right (px)': f'{camera.cx_right:.3f}',
        'baseline (m)': f'{camera.baseline_m:.4f}',
        'rows off (px)': _optional(state.counts.rows_off_px, 1, 2),
        'lenses bend (px)': _optional(state.counts.lens_bend_px, 1, 2),
    }
    return Status('calibration', *_judge_calibration(state), values)


def _judge_calibration(state: NodeState) -> tuple[int, str]:
    rows_off_px, lens_bend_px = state.counts.rows_off_px or 0.0, state.counts.lens_bend_px or 0.0
    if state.lifecycle != 'active' or max(rows_off_px, lens_bend_px) < WORN_CALIBRATION_PX:
        return OK, 'calibrated'
    return WARN, (
        f'rectification leaves rows {rows_off_px:.1f} px off, and {lens_bend_px:.1f} px that look '
        'like lens distortion, which is made good: calibrate again'
    )


def _detection(state: NodeState) -> Status:
    counts = state.counts
    values = {
        'detection rate (Hz)': f'{counts.detection_rate_hz:.2f}',
        'detections': str(counts.detected),
        'latency p50 (ms)': _optional(counts.latency_p50_ms, 1, 1),
        'latency p95 (ms)': _optional(counts.latency_p95_ms, 1, 1),
        'dropped frames': str(counts.dropped),
        'bad frames': str(counts.bad_frames),
        'valid disparity (%)': _optional(counts.valid_share, 100, 1),
        'obstacles (% of pixels)': _optional(counts.obstacle_share, 100, 1),
    }
    values |= {f'bad frames: {reason}': str(number) for reason, number in counts.bad.items()}
    level, message = _judge_detection(state)
    return Status('detection', level, message, values)


def _judge_detection(state: NodeState) -> tuple[int, str]:
    counts = state.counts
    if state.lifecycle != 'active':
        return OK, state.lifecycle
    if not state.listening:
        return OK, 'resting: nobody subscribes to a detection'
    if counts.pair_rate_hz > 0 and counts.detection_rate_hz == 0:
        return ERROR, 'pairs arrive, none can be used'
    if state.gravity_problem:
        return WARN, state.gravity_problem
    if counts.valid_share is not None and counts.valid_share < LOW_VALID_SHARE:
        return WARN, f'only {counts.valid_share:.0%} of the pixels have a disparity'
    return OK, f'{counts.detection_rate_hz:.1f} detections per second'


def _optional(value: float | None, factor: float, digits: int) -> str:
    return 'unknown' if value is None else f'{value * factor:.{digits}f}'
