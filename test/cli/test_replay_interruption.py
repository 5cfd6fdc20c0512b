"""Ctrl-C and SIGTERM during a replay: what is kept, and what is said."""

import os
import signal
import subprocess
import time

import pytest
from hand_made import write_stereo_bag
from replay_outputs import COMMAND, detections_of, summary_of

from rover_obstacle_detection.cli.main import main
from rover_obstacle_detection.offline import replay


@pytest.fixture(scope='module')
def long_bag(tmp_path_factory):
    return write_stereo_bag(tmp_path_factory.mktemp('recorded') / 'long', pairs=60)


SIGNALS = pytest.mark.parametrize(
    ('number', 'status', 'workers'),
    [
        (signal.SIGINT, 130, '1'),
        (signal.SIGTERM, 143, '1'),
        (signal.SIGINT, 130, '2'),
        (signal.SIGTERM, 143, '2'),
    ],
)


def _begin(bags, output, *arguments):
    """Start a replay in its own process group; return it when the first pictures are there."""
    command = [*COMMAND, *map(str, bags), '-o', str(output), '--images', *arguments]
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + 60
    while not list(output.parent.rglob('000002_overlay.png')):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return process


@SIGNALS
def test_an_interrupt_keeps_what_is_done(long_bag, tmp_path, number, status, workers):
    output = tmp_path / 'out'
    bags = [long_bag] if workers == '1' else [long_bag] * 3
    process = _begin(bags, output, '--workers', workers)
    # As Ctrl-C in a terminal does it: every process of the group gets it.
    os.killpg(process.pid, number)
    shown, error = process.communicate(timeout=60)
    assert process.returncode == status
    assert [path.name for path in tmp_path.iterdir()] == ['out']
    parts = [output] if workers == '1' else sorted(output.iterdir())
    lines = error.splitlines()
    if workers == '2':
        assert f'rover-obstacles: interrupted: {long_bag} is not begun' in lines
    kept = [line for line in lines if ' kept in ' in line]
    assert len(lines) == len(bags), error
    assert len(kept) == len(parts) >= 1
    for part in parts:
        summary = summary_of(part)
        frames = summary['frames']
        assert 1 <= len(frames) < 60
        assert summary['interrupted'] is True
        counts = summary['counts']
        assert (counts['detected'], counts['done'], counts['expected']) == (
            len(frames),
            len(frames),
            60,
        )
        assert (
            f'rover-obstacles: interrupted: {len(frames)} of about 60 pairs of {long_bag} '
            f'{"is" if len(frames) == 1 else "are"} kept in {part}'
        ) in kept
        stamps = {time_ns for _, time_ns, _ in detections_of(part)}
        assert stamps == {frame['stamp_ns'] for frame in frames}
        assert len(list((part / 'images').glob('*_overlay.png'))) == len(frames)
        assert f'summary: {part / "summary.json"}' in shown
    if workers == '1':
        assert f'{len(frames)} of about 60, interrupted' in ' '.join(shown.split())


# The second signal is of the other kind: so each kind comes first once and second once.
@pytest.mark.parametrize(('number', 'workers'), [(signal.SIGINT, '1'), (signal.SIGTERM, '2')])
def test_a_second_interrupt_leaves_nothing(long_bag, tmp_path, number, workers):
    process = _begin([long_bag] * int(workers), tmp_path / 'out', '--workers', workers)
    process.send_signal(number)
    # Two signals of one kind would merge before the process has taken the first.
    process.send_signal(signal.SIGINT if number == signal.SIGTERM else signal.SIGTERM)
    _, error = process.communicate(timeout=60)
    assert process.returncode in (130, 143)
    assert 'Traceback' not in error
    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_before_the_first_pair_keeps_nothing(bag, tmp_path, monkeypatch, capsys):
    read = replay.read_pairs

    def interrupt(*arguments, **options):
        os.kill(os.getpid(), signal.SIGINT)
        return read(*arguments, **options)

    monkeypatch.setattr(replay, 'read_pairs', interrupt)
    assert main(['replay', str(bag), str(bag), '-o', str(tmp_path / 'out')]) == 130
    assert capsys.readouterr().err == (
        f'rover-obstacles: interrupted: no usable pair of {bag} so far: nothing is kept\n'
        f'rover-obstacles: interrupted: {bag} is not begun\n'
    )
    assert list(tmp_path.iterdir()) == []


def test_signals_are_handled_as_before_after_a_replay(bag, tmp_path):
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    assert main(['replay', str(bag), '-o', str(tmp_path / 'out'), '--duration', '0.05']) == 0
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before
