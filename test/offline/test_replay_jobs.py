from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

from rover_obstacle_detection.errors import OutputError
from rover_obstacle_detection.offline import replay_jobs
from rover_obstacle_detection.offline.replay_jobs import ReplayJob, plan_jobs


def test_a_single_bag_is_written_to_the_output_folder(tmp_path):
    (job,) = plan_jobs([tmp_path / 'drive'], Path('out'))
    assert job == ReplayJob(tmp_path / 'drive', Path('out'))


def test_several_bags_are_written_to_subfolders_named_after_them(tmp_path):
    file = tmp_path / 'day.two.mcap'
    file.touch()
    folder = tmp_path / 'day.one'
    folder.mkdir()
    jobs = plan_jobs([file, folder, folder, folder / '..' / 'day.one'], Path('out'))
    assert [job.output for job in jobs] == [
        Path('out/day.two'),
        Path('out/day.one'),
        Path('out/day.one_2'),
        Path('out/day.one_3'),
    ]


def test_a_dead_worker_is_an_error_that_names_the_bag(tmp_path):
    future = Future()
    future.set_exception(BrokenProcessPool('gone'))
    result = replay_jobs._result(future, ReplayJob(tmp_path / 'drive', tmp_path / 'out'))
    assert isinstance(result, OutputError)
    assert str(result).startswith(f'{tmp_path / "drive"}: a worker process died')
