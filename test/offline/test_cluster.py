"""Bags on a Dask cluster: a scheduler and three worker processes on this machine."""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import types
from pathlib import Path

import pytest
from hand_made import write_stereo_bag
from labelled import write_labelled
from recordings import stereo_messages, write_ros2
from rosbags.highlevel import AnyReader

from rover_obstacle_detection.cli.main import main
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.errors import ClusterError, NothingDoneError
from rover_obstacle_detection.evaluation.runner import RunOptions
from rover_obstacle_detection.offline.evaluate import BagOptions, evaluate_bags
from rover_obstacle_detection.offline.replay_jobs import plan_jobs, replay_jobs
from rover_obstacle_detection.offline.replay_options import ReplayOptions

pytest.importorskip('distributed', reason='needs the extra cluster')
import dask
import distributed
from faulty_workers import FaultyWorkers, process_that_holds, release

from rover_obstacle_detection.offline import cluster as module

# Warnings of Dask's own connections say nothing of this package.
pytestmark = pytest.mark.filterwarnings('default')
OPTIONS = ReplayOptions(DetectorConfig())
TIMES = {'ms', 'median_ms', 'plain_sgbm_ms', 'times_plain_sgbm'}


@contextlib.contextmanager
def local_cluster(folder, workers, **options):
    """Start a cluster; yield a client of it."""
    settings = {
        'distributed.scheduler.allowed-failures': 1,
        # On a slow computer, the cluster would not wait for one that takes a dead one's place.
        'distributed.deploy.lost-worker-timeout': '1 hour',
    }
    with (
        dask.config.set(settings),
        distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            dashboard_address=':0',
            local_directory=str(folder),
            **options,
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        yield client


@pytest.fixture(scope='module')
def client(tmp_path_factory):
    with local_cluster(tmp_path_factory.mktemp('dask'), 3) as client:
        client.register_plugin(FaultyWorkers())
        yield client


@pytest.fixture(scope='module')
def address(client):
    return client.scheduler.address


@pytest.fixture(scope='module')
def recorded(tmp_path_factory):
    return write_stereo_bag(tmp_path_factory.mktemp('recorded') / 'drive', pairs=3)


@pytest.fixture
def bags(recorded, tmp_path, monkeypatch):
    """Copies of a recording under the names that are asked for, in the working directory."""
    monkeypatch.chdir(tmp_path)

    def copies(*names):
        return [Path(shutil.copytree(recorded, name)) for name in names]

    return copies


def masks(output):
    with AnyReader([output / 'detections']) as reader:
        wanted = [each for each in reader.connections if each.topic.endswith('obstacle_mask')]
        return [data for _, _, data in reader.messages(connections=wanted)]


def counts(output):
    return json.loads((output / 'summary.json').read_text())['counts']


def said(caplog):
    """Return the warnings of this package, without those of Dask."""
    return [
        each.getMessage()
        for each in caplog.records
        if each.name.startswith('rover_obstacle_detection')
    ]


def messages(text):
    """Return the lines of an output, without those of progress on a slow computer."""
    return [line for line in text.splitlines() if line.startswith('rover-obstacles: ')]


def ignore(*progress):
    pass


def test_a_dead_worker_costs_its_bag_a_retry(client, address, bags, capsys):
    names = ['held', 'written', 'one', 'two']
    held, *others = bags(*names)

    def kill():
        os.kill(process_that_holds(held.absolute(), client), signal.SIGKILL)
        release(held.absolute(), client)

    killer = threading.Thread(target=kill)
    killer.start()
    arguments = [*map(str, (held, *others)), '-o', 'out', '--scheduler', address]
    assert main(['replay', *arguments]) == 0
    killer.join()

    shown = capsys.readouterr()
    lines = messages(shown.err)
    lost = [line for line in lines if ': lost the worker tcp://127.0.0.1:' in line]
    assert {line.split(':')[2] for line in lost} >= {' held', ' written'}
    assert all(': beginning again on ' in line for line in lost)
    # A bag may also wait on a worker that dies with another one.
    retried = [line for line in lines if line.endswith(': retry 1 of 3')]
    (left_over,) = (line for line in lines if line not in (*lost, *retried))
    assert 'out/.held.partial is left over from a run that was killed' in left_over
    assert main(['replay', 'one', '-o', 'alone']) == 0
    assert all(masks(Path('out', name)) == masks(Path('alone')) for name in names)
    paths = [line for line in shown.out.splitlines() if line.startswith('summary: ')]
    assert paths == [f'summary: out/{name}/summary.json' for name in names]
    assert sorted(path.name for path in Path('out').iterdir()) == sorted(names)


def test_a_bag_that_kills_every_worker_fails_and_the_others_go_on(address, bags, capsys):
    arguments = [*map(str, bags('deadly', 'one', 'two')), '-o', 'out', '--scheduler', address]
    assert main(['replay', *arguments]) == 1
    shown = capsys.readouterr()
    # A worker may die before it has handed over the result of another bag.
    others = ('rover-obstacles: WARNING: one: lost', 'rover-obstacles: WARNING: two: lost')
    lines = [line for line in messages(shown.err) if not line.startswith(others)]
    retried, left_over, failed, counted = lines
    assert 'out/.deadly.partial is left over' in left_over
    assert retried.startswith('rover-obstacles: WARNING: deadly: lost the worker tcp://')
    assert failed.startswith(
        'rover-obstacles: error: deadly: given up after 2 workers died with it, the last one tcp:'
    )
    assert counted == 'rover-obstacles: error: 1 of 3 bags failed'
    assert [counts(Path('out', name))['detected'] for name in ('one', 'two')] == [3, 3]
    assert not Path('out/deadly').exists()


def test_a_bag_that_kills_workers_before_they_begin_it_fails(address, bags, caplog, monkeypatch):
    monkeypatch.setattr(module, '_MOST_RETRIES', 1)
    jobs = plan_jobs(bags('unbegun', 'one'), Path('out'))
    results = dict(replay_jobs(jobs, OPTIONS, 1, ignore, scheduler=address))
    assert isinstance(results[0], ClusterError)
    assert str(results[0]).startswith('unbegun: given up after 2 workers died with it, ')
    assert counts(Path('out', 'one'))['detected'] == 3
    (line,) = (line for line in said(caplog) if line.endswith(': retry 1 of 1'))
    assert line.startswith('unbegun: given up after 2 workers died with it, ')


def test_a_stopped_run_tries_no_bag_again(client, address, bags, monkeypatch):
    monkeypatch.setattr(module._Run, '_has_died_with_another', lambda run, index: True)
    (held,) = bags('held_again')
    begun = set()

    def on_progress(index, done, expected):
        if done == 2:
            begun.add(index)

    def stopped():
        if begun:
            release(held.absolute(), client)
        return bool(begun)

    jobs = plan_jobs([held], Path('out'))
    ((_, error),) = replay_jobs(jobs, OPTIONS, 1, on_progress, stopped, address)
    assert isinstance(error, NothingDoneError)
    assert str(error) == 'held_again is not finished'


def test_a_stopped_run_ends_when_its_workers_are_gone(bags, tmp_path):
    held, other = bags('held', 'one')
    killed = []
    with local_cluster(tmp_path / 'dask', 1) as client:
        client.register_plugin(FaultyWorkers())
        for nanny in client.cluster.workers.values():
            nanny.close_gracefully()  # it starts no other worker

        def on_progress(index, done, expected):
            if done == 2:
                os.kill(process_that_holds(held.absolute(), client), signal.SIGKILL)
                killed.append(index)

        jobs = plan_jobs([held, other], Path('out'))
        results = dict(
            replay_jobs(
                jobs, OPTIONS, 1, on_progress, lambda: bool(killed), client.scheduler.address
            )
        )
    assert all(isinstance(each, NothingDoneError) for each in results.values())
    assert [str(results[index]) for index in (0, 1)] == [
        'held is not finished',
        'one is not begun',
    ]


def test_a_stopped_run_keeps_what_is_done(client, address, bags):
    paths = bags('held_1', 'held_2', 'held_3', 'one', 'two')
    begun = set()

    def on_progress(index, done, expected):
        if done == 2:
            begun.add(index)

    results = {}
    for index, result in replay_jobs(
        plan_jobs(paths, Path('out')),
        OPTIONS,
        1,
        on_progress,
        lambda: len(begun) == 3,
        address,
    ):
        results[index] = result
        # The first results are those that are not begun: the workers are told to stop.
        for path in paths:
            release(path.absolute(), client)
    assert [str(results[index]) for index in (3, 4)] == ['one is not begun', 'two is not begun']
    assert all(isinstance(results[index], NothingDoneError) for index in (3, 4))
    for index in range(3):
        assert (results[index].interrupted, len(results[index].frames)) == (True, 2)
        assert counts(Path('out', paths[index].name))['done'] == 2
    assert len(list(Path('out').iterdir())) == 3


def test_a_result_that_dies_with_its_worker_is_waited_for_again(address, bags, monkeypatch):
    class DoneTooEarly:
        """A future as it is when the worker that keeps the result dies: done, then pending."""

        def __init__(self, future):
            self._future = future

        def done(self):
            return True

        def __getattr__(self, name):
            return getattr(self._future, name)

    submit = module._Run._submit

    def submit_and_lose(run):
        submit(run)
        run._futures = {index: DoneTooEarly(each) for index, each in run._futures.items()}

    monkeypatch.setattr(module._Run, '_submit', submit_and_lose)
    jobs = plan_jobs(bags('one'), Path('out'))
    ((_, summary),) = replay_jobs(jobs, OPTIONS, 1, ignore, scheduler=address)
    assert len(summary.frames) == 3


def test_a_run_that_is_given_up_leaves_nothing(client, address, bags, monkeypatch):
    (held,) = bags('held_till_the_end')
    results = replay_jobs(
        plan_jobs([held, held], Path('out')), OPTIONS, 1, ignore, lambda: False, address
    )
    sleep = module.time.sleep

    def release_then(seconds):
        # The run waits for its workers to clean up.
        release(held.absolute(), client)
        sleep(seconds)

    def give_up(seconds):
        process_that_holds(held.absolute(), client)
        monkeypatch.setattr(module.time, 'sleep', release_then)
        raise KeyboardInterrupt

    monkeypatch.setattr(module.time, 'sleep', give_up)
    with pytest.raises(KeyboardInterrupt):
        next(results)
    assert list(Path().iterdir()) == [held]


def test_versions_that_differ_are_named_once(address, bags, caplog, monkeypatch):
    here = module.cluster_versions()
    numpy_there = here['numpy']
    here['numpy'] = '0.1'
    monkeypatch.setattr(module, 'cluster_versions', lambda: here)
    jobs = plan_jobs(bags('one', 'two'), Path('out'))
    assert len(list(replay_jobs(jobs, OPTIONS, 1, ignore, scheduler=address))) == 2
    (line,) = said(caplog)
    assert line.endswith(f' has numpy {numpy_there} (here 0.1): results may differ')


def test_figures_are_those_of_this_machine_in_the_order_of_the_bags(address, tmp_path, capsys):
    long = write_labelled(tmp_path / 'long', frames=6)
    short = write_labelled(tmp_path / 'short', frames=1)
    unlabelled = write_ros2(tmp_path / 'unlabelled', stereo_messages(1))
    nowhere = tmp_path / 'nowhere'
    figures = []
    for name, options in (('here', ()), ('there', ('--scheduler', address))):
        file = tmp_path / f'{name}.json'
        arguments = [*map(str, (long, unlabelled, short, nowhere)), '--json', str(file)]
        assert main(['evaluate', *arguments, *options]) == 1
        figures.append(without_times(json.loads(file.read_text())))
        errors = capsys.readouterr().err.splitlines()
    assert figures[0] == figures[1]
    scenes = figures[1]['methods']['hybrid']['scenes']
    assert [(each['scene'], len(each['frames'])) for each in scenes] == [
        ('long', 6),
        ('short', 1),
    ]
    assert f'{unlabelled}: no topic truth/labels' in errors[-3]
    assert f'{nowhere}: a worker on the host {socket.gethostname()} does not find ' in errors[-2]
    assert errors[-1] == 'rover-obstacles: error: 2 of 4 bags failed'


def without_times(content):
    if isinstance(content, list):
        return [without_times(each) for each in content]
    if isinstance(content, dict):
        return {name: without_times(each) for name, each in content.items() if name not in TIMES}
    return content


def test_a_cluster_without_workers_is_waited_for_with_a_warning(tmp_path, caplog):
    with local_cluster(tmp_path, 0, processes=False) as client:
        evaluation, errors = evaluate_bags(
            [tmp_path / 'bag'],
            RunOptions(['hybrid'], DetectorConfig()),
            BagOptions(),
            ignore,
            lambda: bool(said(caplog)),
            client.scheduler.address,
        )
    assert evaluation.scenes == ()
    assert list(map(str, errors)) == [f'{tmp_path / "bag"} is not begun']
    (line,) = said(caplog)
    assert line.endswith(' has no workers: waiting for one')


def test_a_scheduler_that_is_not_there_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(module, '_CONNECT_S', 0.2)
    jobs = plan_jobs([tmp_path / 'bag'], tmp_path / 'out')
    with pytest.raises(ClusterError, match=r'cannot reach the scheduler tcp://127.0.0.1:9: '):
        next(replay_jobs(jobs, OPTIONS, 1, ignore, scheduler='tcp://127.0.0.1:9'))
    assert list(tmp_path.iterdir()) == []


def test_a_scheduler_that_dies_is_named_once_for_each_bag(bags, tmp_path, caplog, monkeypatch):
    monkeypatch.setattr(module, '_CONNECT_S', 2)
    file = tmp_path / 'scheduler.json'
    command = [sys.executable, '-m', 'distributed.cli.dask_scheduler', '--no-dashboard']
    command += ['--host', '127.0.0.1', '--port', '0', '--scheduler-file', str(file)]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as scheduler:
        with distributed.Client(scheduler_file=str(file), set_as_default=False) as client:
            address = client.scheduler.address

        def stopped():
            if said(caplog):
                scheduler.kill()
            return False

        jobs = plan_jobs(bags('one', 'two'), Path('out'))
        results = dict(replay_jobs(jobs, OPTIONS, 1, ignore, stopped, address))
    assert [str(results[index]).split(': ')[:2] for index in (0, 1)] == [
        [name, f'lost the scheduler {address}'] for name in ('one', 'two')
    ]
    assert not [each for each in caplog.records if each.name == 'distributed.client']


@pytest.mark.parametrize('address', ['rack1', 'foo://1', 'tcp://', 'tls://127.0.0.1:9'])
def test_an_address_of_another_form_is_named(tmp_path, address):
    jobs = plan_jobs([tmp_path / 'bag'], tmp_path / 'out')
    with pytest.raises(ClusterError, match=f'cannot reach the scheduler {address}: '):
        next(replay_jobs(jobs, OPTIONS, 1, ignore, scheduler=address))


def test_nothing_follows_the_line_that_names_the_address(tmp_path):
    command = [sys.executable, '-m', 'rover_obstacle_detection', 'evaluate', str(tmp_path)]
    ended = subprocess.run(
        [*command, '--scheduler', 'rack1'], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 1
    assert ended.stderr.count('\n') == 1
    assert ended.stderr.startswith('rover-obstacles: error: cannot reach the scheduler rack1: ')


def clients_greeted_with_news(times):
    """A client that fails as Dask's does if another run is cancelled at the same moment."""

    class Client(module._Client):
        left = times

        def __init__(self, *arguments, **options):
            Client.left -= 1
            assert Client.left < 0
            super().__init__(*arguments, **options)

    return Client


def test_a_greeting_with_news_of_another_run_is_asked_for_again(address, bags, monkeypatch):
    monkeypatch.setattr(module, '_Client', clients_greeted_with_news(2))
    jobs = plan_jobs(bags('one'), Path('out'))
    ((_, summary),) = replay_jobs(jobs, OPTIONS, 1, ignore, scheduler=address)
    assert len(summary.frames) == 3


def test_a_scheduler_that_always_greets_with_news_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(module, '_Client', clients_greeted_with_news(99))
    jobs = plan_jobs([tmp_path / 'bag'], tmp_path / 'out')
    with pytest.raises(ClusterError, match=r'cannot reach the scheduler tcp://rack1:1: Assertion'):
        next(replay_jobs(jobs, OPTIONS, 1, ignore, scheduler='tcp://rack1:1'))


def test_a_worker_without_this_package_is_named(client, address, tmp_path, monkeypatch):
    class Elsewhere:
        __module__ = 'rover_obstacle_detection.not_there'

    monkeypatch.setattr(module, 'work_on', Elsewhere)
    jobs = plan_jobs([tmp_path / 'bag'], tmp_path / 'out')
    with pytest.raises(ClusterError, match=r"the worker tcp://127.* named 'rover_.*not_there'"):
        next(replay_jobs(jobs, OPTIONS, 1, ignore, scheduler=address))


def test_a_worker_without_this_package_that_comes_between_bags_is_warned_of(
    bags, tmp_path, caplog, monkeypatch
):
    jobs = plan_jobs(bags('one', 'two'), Path('out'))
    with local_cluster(tmp_path / 'dask', 1, processes=False) as client:
        results = replay_jobs(jobs, OPTIONS, 1, ignore, scheduler=client.scheduler.address)
        assert next(results)[0] == 0
        # Every module name that it is asked for is unknown to it.
        unknown = types.SimpleNamespace(resolve_name=importlib.import_module)
        monkeypatch.setattr(module, 'pkgutil', unknown)
        client.cluster.scale(2)
        client.wait_for_workers(2)
        assert [index for index, _ in results] == [1]
    assert counts(Path('out', 'two'))['detected'] == 3
    (line,) = said(caplog)
    assert ' cannot work: ' in line


def test_a_worker_that_does_not_answer_gets_its_bag_with_a_warning(
    client, address, bags, caplog, monkeypatch
):
    monkeypatch.setattr(module, '_CHECK_S', 0)
    jobs = plan_jobs(bags('one'), Path('out'))
    ((_, summary),) = replay_jobs(jobs, OPTIONS, 1, ignore, scheduler=address)
    assert len(summary.frames) == 3
    assert any(line.startswith('no answer in 0 s from one of the ') for line in said(caplog))
