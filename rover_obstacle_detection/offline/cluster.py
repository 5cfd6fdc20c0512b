"""Work on several bags on a running Dask cluster (optional dependency group ``cluster``)."""

from __future__ import annotations

import contextlib
import logging
import pkgutil
import time
import uuid
import warnings
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Sequence
from typing import Any, Generic, TypeVar

from rover_obstacle_detection.errors import (
    ClusterError,
    MissingExtraError,
    NothingDoneError,
    ObstacleDetectionError,
    failure_text,
)

try:
    import distributed
except ImportError as missing:
    raise MissingExtraError(
        '--scheduler needs dask.distributed, which is not installed: pip install distributed'
    ) from missing

from distributed.versions import VersionMismatchWarning

from rover_obstacle_detection.offline.cluster_channel import Begun, Channel, Progress
from rover_obstacle_detection.offline.cluster_worker import BagWork, cluster_versions, work_on

Result = TypeVar('Result')
Ended = tuple[int, Result | ObstacleDetectionError]

OnBagProgress = Callable[[int, int, int], None]
"""Called with the bag's index and the number of steps done and expected."""

_POLL_S = 0.1
_CONNECT_S = 10
# Workers clean up after their current pair; a slow method may take longer.
_CLEAN_UP_S = 60.0
# A worker may import this package from a slow shared file system.
_CHECK_S = 30.0
# A worker that dies before it begins a bag may have died of something else, but not every time.
_MOST_RETRIES = 3
_ENDED = ('finished', 'error', 'cancelled')
_UNREACHABLE = (OSError, distributed.TimeoutError)

_logger = logging.getLogger(__name__)


def run_on_cluster(
    address: str,
    works: Sequence[BagWork[Result]],
    on_progress: OnBagProgress,
    stopped: Callable[[], bool],
) -> Generator[Ended[Result], None, None]:
    """Do every work on the workers of a cluster; if one fails, the others are still done.

    If a worker dies, the scheduler gives its bag to another one; after as many deaths as its
    setting ``allowed-failures`` permits, the bag fails. If the last worker had not begun the bag,
    it is tried again a few times. If `stopped`, what has begun ends after its current step, or is
    left out if there are no workers, and nothing else begins.

    Yields
    ------
    index, result : int and the result of the work or ObstacleDetectionError
        In the order in which they end.

    Raises
    ------
    ClusterError
        If the scheduler cannot be reached, or a worker cannot import this package.
    """
    with _quiet(), _connected(address) as client:
        run = _Run(client, address, works, on_progress)
        try:
            yield from run.results(stopped)
        finally:
            run.end()


class _Client(distributed.Client):  # type: ignore[misc]
    """A client that is closed explicitly."""

    def __del__(self) -> None:
        """Do nothing: Dask's own waits in vain for a client that could not connect."""


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Keep back what Dask's client logs of a lost scheduler, with tracebacks: each bag says so."""
    logger = logging.getLogger('distributed.client')
    before, logger.disabled = logger.disabled, True
    try:
        yield
    finally:
        logger.disabled = before


@contextlib.contextmanager
def _connected(address: str) -> Iterator[Any]:
    try:
        with warnings.catch_warnings():
            # The workers' versions are compared below, with those that matter here.
            warnings.simplefilter('ignore', VersionMismatchWarning)
            client = _connect(address)
    except Exception as error:
        # Addresses of an unknown form, or TLS without certificates, raise whatever Dask does.
        raise ClusterError(
            f'cannot reach the scheduler {address}: {failure_text(error)}'
        ) from error
    try:
        yield client
    finally:
        client.close()


def _connect(address: str) -> Any:
    for _ in range(_MOST_RETRIES):
        # The scheduler tells every client of a cancelled run. If it does so with its greeting,
        # a check of Dask fails.
        with contextlib.suppress(AssertionError):
            return _client(address)
    return _client(address)


def _client(address: str) -> _Client:
    return _Client(address, timeout=_CONNECT_S, set_as_default=False)


class _Run(Generic[Result]):
    """One run: what waits, what the scheduler has, and what is begun."""

    def __init__(
        self,
        client: Any,
        address: str,
        works: Sequence[BagWork[Result]],
        on_progress: OnBagProgress,
    ) -> None:
        self._client = client
        self._address = address
        self._works = works
        self._on_progress = on_progress
        self._name = f'rover-obstacles-{uuid.uuid4().hex}'
        self._channel = Channel(self._name, client)
        self._waiting = deque(range(len(works)))
        self._futures: dict[int, Any] = {}
        self._begun: dict[int, Begun] = {}
        self._retries: Counter[int] = Counter()
        self._has_workers = True
        self._checked: set[str] = set()
        self._told: set[str] = set()

    def results(self, stopped: Callable[[], bool]) -> Iterator[Ended[Result]]:
        """Yield each result when it is there."""
        is_stopping = False
        while self._waiting or self._futures:
            try:
                if stopped() and not is_stopping:
                    is_stopping = True
                    self._stop()
                if is_stopping:
                    yield from self._left_out()
                else:
                    self._submit()
                yield from self._ended(is_stopping)
            except _UNREACHABLE as error:
                yield from self._all_lost(failure_text(error))
                return
            if self._client.status != 'running':
                yield from self._all_lost('the connection is closed')
                return
            time.sleep(_POLL_S)

    def _ended(self, is_stopping: bool) -> Iterator[Ended[Result]]:
        # Once for all: a result that is there may die with its worker, and is then made again.
        statuses = {index: future.status for index, future in self._futures.items()}
        self._take_messages()
        for index, status in statuses.items():
            if status not in _ENDED:
                continue
            if self._has_died_with_another(index) and (is_stopping or self._may_retry(index)):
                del self._futures[index]
                self._waiting.appendleft(index)
                continue
            result = self._result(index, status)
            del self._futures[index]
            yield index, result

    def end(self) -> None:
        """Cancel what is left and wait until workers have cleaned up."""
        with contextlib.suppress(*_UNREACHABLE):
            if self._futures and self._client.status == 'running':
                self._abort()
            self._channel.forget(self._begun)
        self._channel.close()

    def _submit(self) -> None:
        """Give the scheduler as many bags as the workers can begin now.

        If it had all, a bag could pay for the deaths of a worker that had not begun it.
        """
        threads = self._client.nthreads()
        self._check_imports(set(threads) - self._checked)
        places = sum(threads.values())
        if not places and self._has_workers:
            _logger.warning('the cluster %s has no workers: waiting for one', self._address)
        self._has_workers = places > 0
        while self._waiting and len(self._futures) < places:
            index = self._waiting.popleft()
            self._futures[index] = self._client.submit(
                work_on,
                self._name,
                index,
                self._works[index],
                key=f'{self._name}-{index}-{uuid.uuid4().hex}',
                pure=False,
            )

    def _check_imports(self, addresses: set[str]) -> None:
        """Look for workers without this package: a bag sent to such a worker makes it exit."""
        if not addresses:
            return
        self._checked |= addresses
        try:
            found = self._client.run(
                # Of the standard library, so that every worker has it.
                pkgutil.resolve_name,
                f'{work_on.__module__}:__name__',
                workers=list(addresses),
                on_error='return',
                callback_timeout=_CHECK_S,
            )
        except distributed.TimeoutError:
            workers = ', '.join(sorted(addresses))
            _logger.warning('no answer in %g s from one of the workers %s', _CHECK_S, workers)
            return
        for address, result in found.items():
            if isinstance(result, ImportError):
                text = f'the worker {address} cannot work: {_failure_text(result)}'
                if not self._begun:
                    raise ClusterError(text)
                _logger.warning('%s', text)

    def _stop(self) -> None:
        self._channel.stop.set()
        self._take_messages()
        self._take_back([index for index in self._futures if index not in self._begun])

    def _take_back(self, indices: list[int]) -> None:
        for index in indices:
            self._futures.pop(index).cancel()
        self._waiting.extend(indices)

    def _left_out(self) -> Iterator[Ended[Result]]:
        """Yield an error for each bag that a stopped run does not do."""
        if self._futures and not self._client.nthreads():
            self._take_back([index for index, each in self._futures.items() if not each.done()])
        while self._waiting:
            index = self._waiting.popleft()
            state = 'finished' if index in self._begun else 'begun'
            yield index, NothingDoneError(f'{self._works[index].name} is not {state}')

    def _abort(self) -> None:
        self._channel.abort.set()
        self._take_messages()
        for index, future in self._futures.items():
            if index not in self._begun:
                future.cancel()
        deadline_s = time.monotonic() + _CLEAN_UP_S
        while not all(each.done() for each in self._futures.values()):
            if time.monotonic() > deadline_s or not self._client.nthreads():
                return
            time.sleep(_POLL_S)

    def _take_messages(self) -> None:
        for message in self._channel.received():
            if isinstance(message, Begun):
                self._take_begun(message)
            elif isinstance(message, Progress):
                self._on_progress(message.index, message.done, message.expected)
            else:
                _logger.warning('%s', message.text)

    def _take_begun(self, begun: Begun) -> None:
        if before := self._begun.get(begun.index):
            _logger.warning(
                '%s: lost the worker %s on the host %s: beginning again on %s, %s',
                self._works[begun.index].name,
                before.address,
                before.host,
                begun.host,
                begun.address,
            )
        self._begun[begun.index] = begun
        differences = [
            f'{name} {begun.versions.get(name, "unknown")} (here {version})'
            for name, version in cluster_versions().items()
            if begun.versions.get(name) != version
        ]
        text = f'the host {begun.host} has {", ".join(differences)}: results may differ'
        if differences and text not in self._told:
            self._told.add(text)
            _logger.warning('%s', text)

    def _has_died_with_another(self, index: int) -> bool:
        """Whether the scheduler gave a bag up for a worker that had not begun it."""
        future, begun = self._futures[index], self._begun.get(index)
        if future.status != 'error' or not isinstance(
            error := future.exception(), distributed.KilledWorker
        ):
            return False
        return begun is None or begun.address != error.last_worker.address

    def _may_retry(self, index: int) -> bool:
        """Count and tell a retry: the scheduler's own count of deaths begins again with it."""
        if self._retries[index] == _MOST_RETRIES:
            return False
        self._retries[index] += 1
        _logger.warning(
            '%s: %s: retry %d of %d',
            self._works[index].name,
            _failure_text(self._futures[index].exception()),
            self._retries[index],
            _MOST_RETRIES,
        )
        return True

    def _result(self, index: int, status: str) -> Result | ObstacleDetectionError:
        future, name = self._futures[index], self._works[index].name
        if status == 'finished':
            result: Result | ObstacleDetectionError = future.result()
            return result
        if status == 'cancelled':
            return ClusterError(f'{name}: the scheduler {self._address} has cancelled it')
        return ClusterError(f'{name}: {_failure_text(future.exception())}')

    def _all_lost(self, reason: str) -> Iterator[Ended[Result]]:
        lost = [*self._futures, *self._waiting]
        self._futures.clear()
        self._waiting.clear()
        for index in lost:
            name = self._works[index].name
            yield index, ClusterError(f'{name}: lost the scheduler {self._address}: {reason}')


def _failure_text(error: BaseException) -> str:
    if isinstance(error, distributed.KilledWorker):
        return (
            f'given up after {error.allowed_failures + 1} workers died with it, the last one '
            f'{error.last_worker.address}: possibly out of memory'
        )
    cause = error.__cause__ or error
    hint = ''
    if isinstance(cause, ImportError):
        hint = ': expected the same packages on the scheduler, the workers and here'
    return failure_text(cause) + hint
