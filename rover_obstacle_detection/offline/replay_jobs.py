"""Several recordings, one after another or shared out among processes."""

from __future__ import annotations

import multiprocessing
import os
import queue
import signal
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2

from rover_obstacle_detection.errors import ObstacleDetectionError, OutputError
from rover_obstacle_detection.offline.replay import ReplayOptions, replay_bag
from rover_obstacle_detection.offline.summary import ReplaySummary

OnJobProgress = Callable[[int, int, int], None]
"""Called with the job's index, the pairs done and the pairs expected."""

Result = tuple[int, ReplaySummary | ObstacleDetectionError]

_POLL_S = 0.1


@dataclass(frozen=True)
class ReplayJob:
    """One recording and the folder of its results."""

    bag: Path
    output: Path


def plan_jobs(bags: Sequence[Path], output: Path) -> list[ReplayJob]:
    """Give a single recording the output folder itself, several a folder each within it.

    The folders are named after the recordings; of those of the same name the second gets ``_2``.
    """
    if len(bags) == 1:
        return [ReplayJob(bags[0], output)]
    jobs: list[ReplayJob] = []
    taken: set[str] = set()
    for bag in bags:
        stem = bag.resolve().stem if bag.is_file() else bag.resolve().name
        name, count = stem, 1
        while name in taken:
            count += 1
            name = f'{stem}_{count}'
        taken.add(name)
        jobs.append(ReplayJob(bag, output / name))
    return jobs


def replay_jobs(
    jobs: Sequence[ReplayJob],
    options: ReplayOptions,
    workers: int,
    on_progress: OnJobProgress,
) -> Generator[Result, None, None]:
    """Replay every recording; one that fails does not hold up the others.

    Parameters
    ----------
    jobs : sequence of ReplayJob
    options : ReplayOptions
    workers : int
        Processes at work at a time.
    on_progress : callable

    Yields
    ------
    index, result : int and ReplaySummary or ObstacleDetectionError
        As they end.
    """
    workers = min(workers, len(jobs))
    if workers > 1:
        yield from _in_processes(jobs, options, workers, on_progress)
        return
    for index, job in enumerate(jobs):
        yield index, _replay(job, options, _for_job(on_progress, index))


def _replay(
    job: ReplayJob, options: ReplayOptions, on_progress: Callable[[int, int], None]
) -> ReplaySummary | ObstacleDetectionError:
    try:
        return replay_bag(job.bag, job.output, options, on_progress)
    except ObstacleDetectionError as error:
        return error


def _for_job(on_progress: OnJobProgress, index: int) -> Callable[[int, int], None]:
    return lambda done, expected: on_progress(index, done, expected)


def _in_processes(
    jobs: Sequence[ReplayJob],
    options: ReplayOptions,
    workers: int,
    on_progress: OnJobProgress,
) -> Generator[Result, None, None]:
    # OpenCV's threads do not survive a fork.
    context = multiprocessing.get_context('spawn')
    progress, stop = context.Queue(), context.Event()
    threads = max(1, (os.cpu_count() or 1) // workers)
    pool = ProcessPoolExecutor(workers, context, _start_worker, (progress, stop, threads))
    try:
        indices = {
            pool.submit(_work, index, job, options): index for index, job in enumerate(jobs)
        }
        pending: set[Future[ReplaySummary | ObstacleDetectionError]] = set(indices)
        while pending:
            done, pending = wait(pending, timeout=_POLL_S, return_when=FIRST_COMPLETED)
            _pass_on(progress, on_progress)
            for future in done:
                index = indices[future]
                yield index, _result(future, jobs[index])
    finally:
        # Workers that are still at it clean up at their next frame.
        stop.set()
        pool.shutdown(wait=True, cancel_futures=True)
        progress.cancel_join_thread()
        progress.close()


def _result(
    future: Future[ReplaySummary | ObstacleDetectionError], job: ReplayJob
) -> ReplaySummary | ObstacleDetectionError:
    try:
        return future.result()
    except BrokenProcessPool:
        return OutputError(
            f'{job.bag}: a worker process ended without a result, perhaps for want of memory; '
            'try fewer --workers'
        )


def _pass_on(progress: Any, on_progress: OnJobProgress) -> None:
    while True:
        try:
            on_progress(*progress.get_nowait())
        except queue.Empty:
            return


_worker: tuple[Any, Any] | None = None


def _start_worker(progress: Any, stop: Any, threads: int) -> None:
    global _worker
    # The main process tells when to stop, also after a Ctrl-C, which reaches every process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    cv2.setNumThreads(threads)
    # An interrupted main process reads no more: nothing may wait for it.
    progress.cancel_join_thread()
    _worker = (progress, stop)


def _work(
    index: int, job: ReplayJob, options: ReplayOptions
) -> ReplaySummary | ObstacleDetectionError:
    assert _worker is not None
    progress, stop = _worker

    def on_progress(done: int, expected: int) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        progress.put((index, done, expected))

    return _replay(job, options, on_progress)
