"""What a replay takes besides detection, and what a second worker gains."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from benchmark_scenes import Scene, standard_scenes
from effort import Effort
from findings import Findings, at_least, at_most
from live_graph import write_pairs

from rover_obstacle_detection import DetectorConfig
from rover_obstacle_detection.errors import ObstacleDetectionError
from rover_obstacle_detection.offline.replay_jobs import ReplayJob, replay_jobs
from rover_obstacle_detection.offline.replay_options import ReplayOptions
from rover_obstacle_detection.offline.summary import FILE_STAGES, ReplaySummary

MOST_FILE_SHARE = 0.15
LEAST_GAIN = 1.6
RECORDINGS = 2
RATE_HZ = 10
SECOND = 1_000_000_000


def replay_findings(scenes: Sequence[Scene], effort: Effort) -> Findings:
    """Replay two equal recordings of the first scenes with one worker and with two."""
    pairs = [scene.pair for scene in standard_scenes(scenes)]
    camera = pairs[0].camera
    images = [(pair.left, pair.right) for pair in pairs if pair.camera == camera]
    stamps = [1000 * SECOND + n * SECOND // RATE_HZ for n in range(effort.replay_pairs)]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_pairs(folder / 'bag', camera, images, stamps)
        summaries, alone_hz = replayed(folder, workers=1)
        _, together_hz = replayed(folder, workers=2)
    share = file_share(summaries)
    return Findings(
        (
            at_most(
                'bag reading and writing, share of a replay', share, MOST_FILE_SHARE, '{:.0%}'
            ),
            at_least(
                f'frame rate of `--workers 2` ({together_hz:.1f} Hz) relative to one '
                f'({alone_hz:.1f} Hz), while both work',
                together_hz / alone_hz,
                LEAST_GAIN,
                '{:.2f} x',
            ),
        )
    )


def replayed(folder: Path, workers: int) -> tuple[list[ReplaySummary], float]:
    """Replay; return the summaries, and pairs per second from the first pair of every worker."""
    jobs = [
        ReplayJob(folder / 'bag', folder / f'replayed_{workers}_{number}')
        for number in range(RECORDINGS)
    ]
    progress: list[tuple[float, int, int]] = []
    summaries = []
    for _, result in replay_jobs(
        jobs,
        ReplayOptions(DetectorConfig()),
        workers,
        lambda index, done, expected: progress.append((time.monotonic(), index, done)),
    ):
        if isinstance(result, ObstacleDetectionError):
            raise result
        summaries.append(result)
    return summaries, pair_rate_hz(progress, workers)


def pair_rate_hz(progress: Sequence[tuple[float, int, int]], workers: int) -> float:
    """Pairs per second while all workers work: start-up and the last worker do not count.

    Parameters
    ----------
    progress : sequence of tuple
        Time (s), number of the recording and its pairs done, in order of time.
    workers : int
    """
    firsts = {index: moment for moment, index, _ in reversed(progress)}
    lasts = {index: moment for moment, index, _ in progress}
    begun = sorted(firsts.values())[workers - 1]
    ended = sorted(lasts.values())[len(lasts) - workers]
    during = [moment for moment, _, _ in progress if begun < moment <= ended]
    return len(during) / (ended - begun) if during else math.nan


def file_share(summaries: Sequence[ReplaySummary]) -> float:
    """Share of the replays' time that reading and writing bags takes."""
    frames = [frame.stage_ms for summary in summaries for frame in summary.frames]
    files = sum(ms for stages in frames for name, ms in stages.items() if name in FILE_STAGES)
    return files / sum(sum(stages.values()) for stages in frames)
