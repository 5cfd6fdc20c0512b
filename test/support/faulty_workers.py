"""Workers of a Dask cluster that wait or die in the middle of a bag, by the bag's name."""

from __future__ import annotations

import os
import signal

from distributed import Event, Variable, WorkerPlugin

from rover_obstacle_detection.offline import replay_jobs

HELD, DEADLY, OTHER_VERSION, FINISHED = 'held', 'deadly', 'other_version', 'finished'
WAIT_S = 120


class FaultyWorkers(WorkerPlugin):
    """Installed on every worker, also on one that takes the place of a dead one."""

    name = 'faulty workers'
    idempotent = True

    def setup(self, worker):
        replay_jobs.replay_bag = _Faulty(replay_jobs.replay_bag)


class _Faulty:
    def __init__(self, replay_bag):
        self._replay_bag = replay_bag

    def __call__(self, path, output, options, on_progress, stopped):
        def then(done, expected):
            on_progress(done, expected)
            if path.name.startswith(HELD) and done == 2:
                Variable(f'held {path}').set(os.getpid())
                Event(f'go {path}').wait(WAIT_S)
            if path.name.startswith(DEADLY):
                die()

        summary = self._replay_bag(path, output, options, then, stopped)
        if path.name.startswith(FINISHED) and not Event(f'died {path}').is_set():
            Event(f'died {path}').set()
            die()
        return summary


def die():
    os.kill(os.getpid(), signal.SIGKILL)
