"""Workers of a Dask cluster that wait or die at a bag, as its name says.

`HELD`: waits after its second pair, until it is released. `DEADLY`: its worker dies after the
first pair, always. `WRITTEN`: the first worker dies when it has written the results. `UNBEGUN`:
its worker dies before it says that it begins, always.
"""

from __future__ import annotations

import os
import signal

from distributed import Event, Variable, WorkerPlugin

from rover_obstacle_detection.offline import cluster_worker, replay_jobs

HELD, DEADLY, WRITTEN, UNBEGUN = 'held', 'deadly', 'written', 'unbegun'
WAIT_S = 120


class FaultyWorkers(WorkerPlugin):
    """Installed on every worker, also on one that takes the place of a dead one."""

    name = 'faulty workers'
    idempotent = True

    def setup(self, worker):
        replay_jobs.replay_bag = _Faulty(replay_jobs.replay_bag)
        work_on = cluster_worker.work_on

        def die_or_work(run, index, work):
            if work.name.startswith(UNBEGUN):
                die()
            return work_on(run, index, work)

        # The client sends its name only.
        cluster_worker.work_on = die_or_work


class _Faulty:
    def __init__(self, replay_bag):
        self._replay_bag = replay_bag

    def __call__(self, path, output, options, on_progress, stopped):
        def then(done, expected):
            on_progress(done, expected)
            if path.name.startswith(HELD) and done == 2:
                Variable(f'held {path}').set(os.getpid())
                assert Event(f'go {path}').wait(WAIT_S)
            if path.name.startswith(DEADLY):
                die()

        summary = self._replay_bag(path, output, options, then, stopped)
        has_died = Event(f'died {path}')
        if path.name.startswith(WRITTEN) and not has_died.is_set():
            has_died.set()
            die()
        return summary


def die():
    os.kill(os.getpid(), signal.SIGKILL)


def process_that_holds(bag, client):
    """Wait until a worker has come to the second pair of a bag; return its process."""
    return Variable(f'held {bag}', client).get(WAIT_S)


def release(bag, client):
    Event(f'go {bag}', client).set()
