"""What a worker of a Dask cluster does with one bag."""

from __future__ import annotations

import contextlib
import logging
import os
import socket
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import cv2
import distributed

from rover_obstacle_detection.errors import (
    BagError,
    MissingExtraError,
    NothingDoneError,
    ObstacleDetectionError,
)
from rover_obstacle_detection.offline.cluster_channel import Begun, Channel, Progress, Warned
from rover_obstacle_detection.offline.summary import versions

Result = TypeVar('Result')


@dataclass(frozen=True)
class BagWork(Generic[Result]):
    """The work on one bag; it is sent to a worker.

    Parameters
    ----------
    name : str
        The bag in messages.
    paths : tuple of Path
        Absolute paths that the worker must find.
    run : callable
        Called with two functions, one that takes the steps done and expected and one that
        returns whether to end now, and with whether another worker has begun this before.
    """

    name: str
    paths: tuple[Path, ...]
    run: Callable[[Callable[[int, int], None], Callable[[], bool], bool], Result]


def work_on(run: str, index: int, work: BagWork[Result]) -> Result | ObstacleDetectionError:
    """Do the work on the bag of an index; an error of this package is a result."""
    client, address = distributed.get_client(), distributed.get_worker().address
    host = socket.gethostname()
    channel = Channel(run, client)

    def on_progress(done: int, expected: int) -> None:
        if channel.abort.is_set():
            raise NothingDoneError(f'{work.name} is cancelled')
        channel.send(Progress(index, done, expected))

    try:
        is_again = channel.begin(Begun(index, address, host, cluster_versions()))
        if channel.stop.is_set() or channel.abort.is_set():
            return NothingDoneError(f'{work.name} is not begun')
        _require_paths(work, host)
        _share_cores(client.nthreads(), address)
        with _warnings_to(channel):
            return work.run(on_progress, channel.stop.is_set, is_again)
    except MissingExtraError as error:
        return MissingExtraError(f'{work.name}: on the host {host}, {error}')
    except ObstacleDetectionError as error:
        return error
    finally:
        channel.close()


def cluster_versions() -> dict[str, str]:
    """Return the versions that should agree between the client and the workers."""
    return {**versions(), 'distributed': distributed.__version__}


def _require_paths(work: BagWork[Any], host: str) -> None:
    for path in work.paths:
        if not path.exists():
            raise BagError(
                f'{work.name}: a worker on the host {host} does not find {path}: expected a file '
                'system that all workers share'
            )


def _share_cores(threads: dict[str, int], address: str) -> None:
    """Divide the cores of this host among the bags that its workers replay at once."""
    at_once = sum(count for each, count in threads.items() if _host_of(each) == _host_of(address))
    cv2.setNumThreads(max(1, (os.cpu_count() or 1) // max(1, at_once)))


def _host_of(address: str) -> str:
    return address.rpartition(':')[0]


@contextlib.contextmanager
def _warnings_to(channel: Channel) -> Iterator[None]:
    """Send the client the warnings that this thread logs."""
    handler = _Sender(channel)
    logger = logging.getLogger('rover_obstacle_detection')
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)


class _Sender(logging.Handler):
    def __init__(self, channel: Channel) -> None:
        super().__init__(logging.WARNING)
        self._channel = channel
        self._thread = threading.get_ident()

    def emit(self, record: logging.LogRecord) -> None:
        # Other threads of the worker may work on other bags.
        if record.thread == self._thread:
            self._channel.send(Warned(record.getMessage()))
