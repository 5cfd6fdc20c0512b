"""Bags on a Dask cluster: a scheduler and three worker processes on this machine."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
import threading
from pathlib import Path

import pytest
from hand_made import write_stereo_bag
from labelled import write_labelled

from rover_obstacle_detection.cli.main import main

pytest.importorskip('distributed', reason='needs the extra cluster')

import dask
import distributed
from faulty_workers import FaultyWorkers, WAIT_S

pytestmark = pytest.mark.filterwarnings('default')


@pytest.fixture(scope='module')
def cluster(tmp_path_factory):
    folder = tmp_path_factory.mktemp('dask')
    with (
        dask.config.set({'distributed.scheduler.allowed-failures': 1}),
        distributed.LocalCluster(
            n_workers=3,
            threads_per_worker=1,
            dashboard_address=None,
            worker_dashboard_address=None,
            local_directory=str(folder),
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        client.register_plugin(FaultyWorkers())
        yield client


@pytest.fixture(scope='module')
def recorded(tmp_path_factory):
    return write_stereo_bag(tmp_path_factory.mktemp('recorded') / 'drive', pairs=3)


@pytest.fixture
def bags(recorded, tmp_path):
    """Copies of a recording under the names that are asked for."""

    def copies(*names):
        return [Path(shutil.copytree(recorded, tmp_path / 'bags' / name)) for name in names]

    return copies


def test_first(cluster, bags, tmp_path, capsys):
    held, *others = bags('held', 'one', 'two', 'three')
    killed = threading.Thread(target=kill_worker_with, args=(cluster, held))
    killed.start()
    out = tmp_path / 'out'
    status = main(['replay', *map(str, (held, *others)), '-o', str(out), '--scheduler', cluster.scheduler.address])
    killed.join()
    print(capsys.readouterr())
    assert status == 0
    assert 0


def kill_worker_with(client, bag):
    pid = distributed.Variable(f'held {bag}', client).get(WAIT_S)
    os.kill(pid, signal.SIGKILL)
    distributed.Event(f'go {bag}', client).set()
