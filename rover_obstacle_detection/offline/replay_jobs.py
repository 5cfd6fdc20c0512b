"""Replay several recordings: one after another, in parallel processes or on a cluster."""

from __future__ import annotations

import contextlib
import functools
import multiprocessing
import os
import queue
import signal
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import cv2

from rover_obstacle_detection.bags.reader import bag_name
from rover_obstacle_detection.errors import (
    NothingDoneError,
    ObstacleDetectionError,
    OutputError,
)
from rover_obstacle_detection.offline.output_folder import folder_if_filled
from rover_obstacle_detection.offline.replay import (
    Stopped,
    never_stopped,
    replay_bag,
)
from rover_obstacle_detection.offline.replay_options import ReplayOptions
from rover_obstacle_detection.offline.summary import ReplaySummary

OnJobProgress = Callable[[int, int, int], None]
"""Called with the job's index and the number of pairs done and expected."""

Result = tuple[int, ReplaySummary | ObstacleDetectionError]

_POLL_S = 0.1  # how often progress is passed on

_SIGNALS = {signal.SIGINT, signal.SIGTERM}


@dataclass(frozen=True)
class ReplayJob:
    """A recording and the folder for its results."""

    bag: Path
    output: Path


def plan_jobs(bags: Sequence[Path], output: Path) -> list[ReplayJob]:
    """Choose the output folder of each recording.

    A single recording is written to `output` itself. Several get a subfolder each, named after
    the recording; the second of the same name gets the suffix ``_2``.
    """
    if len(bags) == 1:
        return [ReplayJob(bags[0], output)]
    jobs: list[ReplayJob] = []
    taken: set[str] = set()
    for bag in bags:
        name, count = bag_name(bag), 1
        while name in taken:
            count += 1
            name = f'{bag_name(bag)}_{count}'
        taken.add(name)
        jobs.append(ReplayJob(bag, output / name))
    return jobs


def replay_jobs(
    jobs: Sequence[ReplayJob],
    options: ReplayOptions,
    workers: int,
    on_progress: OnJobProgress,
    stopped: Stopped = never_stopped,
    scheduler: str = '',
) -> Generator[Result, None, None]:
    """Replay every recording; if one fails, the others are still replayed.

    If `stopped`, those that have begun end after their current pair, and no other begins.

    Parameters
    ----------
    jobs : sequence of ReplayJob
    options : ReplayOptions
    workers : int
        Number of parallel processes.
    on_progress : callable
    stopped : callable, optional
    scheduler : str, optional
        Address of a Dask scheduler, whose workers take the place of the processes.

    Yields
    ------
    index, result : int and ReplaySummary or ObstacleDetectionError
        In the order in which the jobs end.

    Raises
    ------
    ClusterError
        If the scheduler cannot be reached.
    MissingExtraError
        If there is a scheduler and dask.distributed is not installed.
    """
    if scheduler:
        yield from _on_cluster(jobs, options, on_progress, stopped, scheduler)
        return
    workers = min(workers, len(jobs))
    if workers > 1:
        yield from _in_processes(jobs, options, workers, on_progress, stopped)
        return
    for index, job in enumerate(jobs):
        yield index, _replay(job, options, _for_job(on_progress, index), stopped)


def _replay(
    job: ReplayJob,
    options: ReplayOptions,
    on_progress: Callable[[int, int], None],
    stopped: Stopped,
) -> ReplaySummary | ObstacleDetectionError:
    if stopped():
        return NothingDoneError(f'{job.bag} is not begun')
    try:
        return replay_bag(job.bag, job.output, options, on_progress, stopped)
    except ObstacleDetectionError as error:
        return error


def _for_job(on_progress: OnJobProgress, index: int) -> Callable[[int, int], None]:
    return lambda done, expected: on_progress(index, done, expected)


def _on_cluster(
    jobs: Sequence[ReplayJob],
    options: ReplayOptions,
    on_progress: OnJobProgress,
    stopped: Stopped,
    scheduler: str,
) -> Generator[Result, None, None]:
    from rover_obstacle_detection.offline.cluster import run_on_cluster
    from rover_obstacle_detection.offline.cluster_worker import BagWork

    calibration = options.calibration.absolute()
    options = replace(options, calibration=calibration)
    works = []
    for job in jobs:
        there = ReplayJob(job.bag.absolute(), job.output.resolve())
        paths = (there.bag, there.output.parent, *calibration.files)
        run = functools.partial(_replay_on_worker, there, options)
        works.append(BagWork(str(job.bag), paths, run))
    with contextlib.ExitStack() as folders:
        # A worker that does not find them has no share in this file system.
        for parent in {job.output.resolve().parent for job in jobs}:
            folders.enter_context(folder_if_filled(parent))
        yield from run_on_cluster(scheduler, works, on_progress, stopped)


def _replay_on_worker(
    job: ReplayJob,
    options: ReplayOptions,
    on_progress: Callable[[int, int], None],
    stopped: Stopped,
    is_again: bool,
) -> ReplaySummary:
    # The worker before may have died when it had written its results.
    options = replace(options, force=options.force or is_again)
    return replay_bag(job.bag, job.output, options, on_progress, stopped)


def _in_processes(
    jobs: Sequence[ReplayJob],
    options: ReplayOptions,
    workers: int,
    on_progress: OnJobProgress,
    stopped: Stopped,
) -> Generator[Result, None, None]:
    # OpenCV's thread pool does not survive a fork.
    context = multiprocessing.get_context('spawn')
    progress, stop, abort = context.Queue(), context.Event(), context.Event()
    threads = max(1, (os.cpu_count() or 1) // workers)
    pool = ProcessPoolExecutor(workers, context, _start_worker, (progress, stop, abort, threads))
    try:
        with _signals_blocked():
            indices = {
                pool.submit(_work, index, job, options): index for index, job in enumerate(jobs)
            }
        pending: set[Future[ReplaySummary | ObstacleDetectionError]] = set(indices)
        while pending:
            done, pending = wait(pending, timeout=_POLL_S, return_when=FIRST_COMPLETED)
            _pass_on(progress, on_progress)
            if stopped():
                stop.set()
            for future in done:
                index = indices[future]
                yield index, _result(future, jobs[index])
    finally:
        # Workers that still run clean up after their current frame.
        abort.set()
        pool.shutdown(wait=True, cancel_futures=True)
        progress.cancel_join_thread()
        progress.close()


@contextlib.contextmanager
def _signals_blocked() -> Iterator[None]:
    """Delay signals; processes that start meanwhile do so until they unblock them."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _result(
    future: Future[ReplaySummary | ObstacleDetectionError], job: ReplayJob
) -> ReplaySummary | ObstacleDetectionError:
    try:
        return future.result()
    except BrokenProcessPool:
        return OutputError(
            f'{job.bag}: a worker process died, possibly out of memory; try fewer --workers'
        )


def _pass_on(progress: Any, on_progress: OnJobProgress) -> None:
    while True:
        try:
            on_progress(*progress.get_nowait())
        except queue.Empty:
            return


class _Worker(NamedTuple):
    """What a worker process shares with the main process."""

    progress: Any
    stop: Any
    abort: Any


_worker: _Worker | None = None


def _start_worker(progress: Any, stop: Any, abort: Any, threads: int) -> None:
    global _worker
    # Signals may reach every process, but the main process decides when workers stop.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda number, frame: stop.set())
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _SIGNALS)
    cv2.setNumThreads(threads)
    # An interrupted main process no longer reads the queue; exiting must not wait for it.
    progress.cancel_join_thread()
    _worker = _Worker(progress, stop, abort)


def _work(
    index: int, job: ReplayJob, options: ReplayOptions
) -> ReplaySummary | ObstacleDetectionError:
    assert _worker is not None
    worker = _worker

    def on_progress(done: int, expected: int) -> None:
        if worker.abort.is_set():
            raise KeyboardInterrupt
        worker.progress.put((index, done, expected))

    return _replay(job, options, on_progress, worker.stop.is_set)
