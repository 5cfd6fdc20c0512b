"""The four statuses of the node on /diagnostics (REP 107), as plain values."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.rectification.correction import RECALIBRATE_PX
from rover_obstacle_detection.node.calibration import RECTIFIED
from rover_obstacle_detection.node.connections import NOTHING_SEEN, Connections
from rover_obstacle_detection.node.load import WINDOW_S, Load
from rover_obstacle_detection.node.statistics import Recent, Snapshot
from rover_obstacle_detection.node.watchdog import NO_FAULTS, Faults, WatchdogLimits
from rover_obstacle_detection.pairing import SAME_MOMENT_NS, PairingStatistics
from rover_obstacle_detection.wording import counted

OK, WARN, ERROR, STALE = range(4)
# With a smaller share of matched pixels, most of the ground is unknown.
MIN_VALID_SHARE = 0.3
# A larger residual rectification error costs accuracy although it is corrected.
# Of the images or pairs of the last 10 s; fewer than this many tell nothing.
MAX_LOST_SHARE = 0.1
MAX_DROPPED_SHARE = 0.5
FEW = 4
# No detection takes this long, even of the largest images on a small computer (s).
STUCK_S = 10.0
IDLE = 'idle: no output has a subscriber'


@dataclass(frozen=True)
class Status:
    """One ``diagnostic_msgs/DiagnosticStatus``.

    Parameters
    ----------
    task : str
        The part of the node it describes.
    level : int
        0 OK, 1 WARN, 2 ERROR, 3 STALE.
    message : str
    values : dict of str to str
    """

    task: str
    level: int
    message: str
    values: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class NodeState:
    """Everything the statuses depend on, at one moment.

    Parameters
    ----------
    lifecycle : str
        Label of the lifecycle state.
    subscribed : bool
        Whether the node subscribes to images, because an output has a subscriber.
    counts : Snapshot
    pairing : PairingStatistics or None
        None while the node is not active.
    camera : StereoCamera or None
    calibration_problem : str
        Why there is no camera; empty if there is one.
    pairing_problem : str
        Why images arrive but no pairs; empty if pairs arrive.
    gravity_problem : str
        Why the configured gravity source fails; empty if it works.
    faults : Faults
        What the watchdog found.
    image_age_s : float or None
        Age of the latest pair when it arrived; None if its stamp is of another clock.
    connections : Connections
        What the ROS graph shows of the node's topics.
    topics : tuple of str
        Full names of the two image topics; empty while the node is not active.
    detecting_s : float
        How long the current detection has been running (s); 0 between detections.
    limits : WatchdogLimits or None
        What the watchdog calls a fault; None without watchdog.
    images : str
        What is done with the images before they are matched.
    """

    lifecycle: str
    subscribed: bool
    counts: Snapshot
    pairing: PairingStatistics | None
    camera: StereoCamera | None
    calibration_problem: str
    pairing_problem: str = ''
    gravity_problem: str = ''
    faults: Faults = NO_FAULTS
    image_age_s: float | None = None
    connections: Connections = NOTHING_SEEN
    topics: tuple[str, ...] = ()
    detecting_s: float = 0.0
    limits: WatchdogLimits | None = None
    images: str = RECTIFIED


def statuses(state: NodeState) -> tuple[Status, ...]:
    """Return the statuses for connections, input, calibration and detection."""
    return _connections(state), _input(state), _calibration(state), _detection(state)


def figures_of_late(state: NodeState) -> str:
    """Return the figures of the last 10 s on one line; empty if no pair arrived."""
    load, share = state.counts.load, state.counts.latest.obstacle_share
    if not (state.subscribed and load.pairs):
        return ''
    figures = [
        f'{load.pairs / load.seconds:.1f} pairs/s',
        f'{load.ended / load.seconds:.1f} judged/s',
        f'latency {_optional(load.latency_p95_s, 1000, 0)} ms (95th percentile)',
        f'obstacles on {_optional(share, 100, 1)} % of the latest image',
        f'{counted(load.dropped, "pair")} dropped',
        f'{counted(load.lost, "image")} lost',
    ]
    return ', '.join(figures)


def worth_logging(state: NodeState) -> Iterator[tuple[int, str]]:
    """Yield level and text of each problem that nothing else has logged."""
    if state.lifecycle != 'active':
        return
    yield from ((ERROR, error) for error in state.connections.errors)
    yield from ((WARN, warning) for warning in state.connections.warnings)
    if state.calibration_problem:
        yield WARN, state.calibration_problem
    if state.pairing_problem:
        yield WARN, state.pairing_problem
    if state.connections.other_images and _no_pair(state):
        first = state.connections.other_images[0]
        yield (
            WARN,
            (
                f'there are images on {", ".join(state.connections.other_images)}: to use them, '
                f'remap the inputs, such as -r left/image_rect:={first}'
            ),
        )
    level, message = _judge_input(state)
    logged = {state.pairing_problem}
    if state.limits is not None:
        # The watchdog logs it, after the time that is right for this camera.
        logged.add(_no_pair(state))
    if level == WARN and message not in logged:
        yield level, message
    if not state.subscribed:
        return
    if problem := _stuck(state):
        yield ERROR, problem
    for problem in (_slow(state), _overloaded(state)):
        if problem:
            yield WARN, problem


def _connections(state: NodeState) -> Status:
    found = state.connections
    level = ERROR if found.errors else WARN if found.warnings else OK
    problems = '; '.join((*found.errors, *found.warnings))
    return Status('connections', level, problems or 'no conflict', dict(found.publishers))


def _input(state: NodeState) -> Status:
    counts, pairing = state.counts, state.pairing
    values = {
        'pair rate (Hz)': f'{counts.pair_rate_hz:.2f}',
        'images lost on the way': str(counts.lost),
        'image age (ms)': _optional(state.image_age_s, 1000, 1),
    }
    if pairing is not None:
        values |= {
            'left images': str(pairing.left),
            'right images': str(pairing.right),
            'pairs': str(pairing.pairs),
            'unmatched left': str(pairing.unmatched_left),
            'unmatched right': str(pairing.unmatched_right),
            'smallest stamp gap (ms)': _optional(pairing.recent_gap_ns, 1e-6, 3),
            'stamp gap of recent pairs (ms)': _optional(pairing.pair_gap_ns, 1e-6, 3),
        }
    return Status('stereo input', *_judge_input(state), values)


def _judge_input(state: NodeState) -> tuple[int, str]:
    if state.lifecycle != 'active' or state.pairing is None:
        return OK, f'{state.lifecycle}: not subscribed to images'
    if not state.subscribed:
        return OK, IDLE
    if state.faults.input:
        return ERROR, ': '.join(filter(None, (state.faults.input, state.pairing_problem)))
    if state.pairing_problem:
        return WARN, state.pairing_problem
    if problem := _no_pair(state):
        return WARN, problem
    # Losses are gaps in sequence numbers, which a second publisher has of its own.
    if not state.connections.errors and (problem := _lost(state.counts.load)):
        return WARN, problem
    gap_ns = state.pairing.pair_gap_ns or 0
    if gap_ns > SAME_MOMENT_NS:
        return WARN, (
            f'the stamps of left and right differ by up to {gap_ns / 1e6:.0f} ms: moments '
            'differ; synchronise the cameras, or set approximate_sync_tolerance_seconds to 0.05 '
            'or less'
        )
    return OK, f'{state.counts.pair_rate_hz:.1f} pairs per second'


def _calibration(state: NodeState) -> Status:
    camera, latest = state.camera, state.counts.latest
    if camera is None:
        level = OK if state.lifecycle != 'active' else ERROR
        return Status('calibration', level, state.calibration_problem)
    values = {
        'images': state.images,
        'width (px)': str(camera.width),
        'height (px)': str(camera.height),
        'fx (px)': f'{camera.fx:.3f}',
        'cx left (px)': f'{camera.cx:.3f}',
        'cx right (px)': f'{camera.cx_right:.3f}',
        'baseline (m)': f'{camera.baseline_m:.4f}',
        'rows off (px)': _optional(latest.rows_off_px, 1, 2),
        'lenses bend (px)': _optional(latest.lens_bend_px, 1, 2),
    }
    return Status('calibration', *_judge_calibration(state), values)


def _judge_calibration(state: NodeState) -> tuple[int, str]:
    rows_px = state.counts.latest.rows_off_px or 0.0
    lens_px = state.counts.latest.lens_bend_px or 0.0
    if state.lifecycle != 'active' or max(rows_px, lens_px) < RECALIBRATE_PX:
        return OK, 'calibrated'
    return WARN, (
        f'residual rectification error: rows off by {rows_px:.1f} px, lens distortion '
        f'{lens_px:.1f} px; corrected, but recalibrate the cameras'
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
        'frames with warnings': str(counts.warned),
        'valid disparity (%)': _optional(counts.latest.valid_share, 100, 1),
        'obstacles (% of pixels)': _optional(counts.latest.obstacle_share, 100, 1),
        'camera height (m)': _optional(counts.latest.camera_height_m, 1, 2),
        'camera pitch (deg)': _optional(counts.latest.camera_pitch_deg, 1, 1),
    }
    values |= {f'bad frames: {reason}': str(number) for reason, number in counts.bad.items()}
    return Status('detection', *_judge_detection(state), values)


def _judge_detection(state: NodeState) -> tuple[int, str]:
    counts, valid_share = state.counts, state.counts.latest.valid_share
    recent = counts.recent
    if state.lifecycle != 'active':
        return OK, state.lifecycle
    if not state.subscribed:
        return OK, IDLE
    if state.faults.detection:
        return ERROR, state.faults.detection
    if problem := _stuck(state):
        return ERROR, problem
    if recent.failed and not recent.judged:
        return ERROR, _failures(recent)
    if recent.failed:
        return WARN, _failures(recent)
    if problem := _slow(state):
        return WARN, problem
    if state.gravity_problem:
        return WARN, state.gravity_problem
    if recent.warnings:
        return WARN, '; '.join(recent.warnings)
    if valid_share is not None and valid_share < MIN_VALID_SHARE:
        return WARN, f'only {valid_share:.0%} of the pixels have a disparity'
    if problem := _overloaded(state):
        return WARN, problem
    return OK, f'{counts.detection_rate_hz:.1f} detections per second'


def _failures(recent: Recent) -> str:
    total = recent.judged + recent.failed
    if not recent.judged:
        return f'none of the last {counted(total, "pair")} could be judged: {recent.problem}'
    return f'{recent.failed} of the last {total} pairs could not be judged: {recent.problem}'


def _stuck(state: NodeState) -> str:
    if state.detecting_s <= STUCK_S:
        return ''
    return f'the detection of one pair has been running for {state.detecting_s:.0f} s'


def _slow(state: NodeState) -> str:
    latency_s = state.counts.load.latency_p95_s
    if latency_s is None or state.limits is None:
        return ''
    limit_s = state.limits.max_image_age_s
    if latency_s <= limit_s:
        return ''
    return (
        f'results come {latency_s:.1f} s after their images (95th percentile of the last 10 s): '
        f'expected at most max_image_age, {limit_s:g} s; set speed to fast, or lower working_scale'
    )


def _overloaded(state: NodeState) -> str:
    load = state.counts.load
    # A burst is no load that lasts, and a silent camera none at all.
    if state.faults.input or load.seconds < WINDOW_S / 2:
        return ''
    if load.dropped < FEW or load.dropped <= MAX_DROPPED_SHARE * load.pairs:
        return ''
    return (
        f'{load.ended / load.seconds:.1f} of {load.pairs / load.seconds:.1f} pairs per second '
        "are judged: lower the camera's rate, set speed to fast, or lower working_scale"
    )


def _no_pair(state: NodeState) -> str:
    if state.counts.load.pairs:
        return ''
    described = [state.connections.describe(topic) for topic in state.topics]
    return f'no pair of {" and ".join(described)}'


def _lost(load: Load) -> str:
    sent = load.images + load.lost
    if load.lost < FEW or load.lost <= MAX_LOST_SHARE * sent:
        return ''
    return (
        f'{load.lost / sent:.0%} of the images of the last 10 s were lost on the way '
        f'({load.lost} of {sent}): give the camera driver the Fast DDS profile, see Transport in '
        'docs/node.md'
    )


def _optional(value: float | None, factor: float, digits: int) -> str:
    return 'unknown' if value is None else f'{value * factor:.{digits}f}'
