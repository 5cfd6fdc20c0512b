import argparse
import os
import pty
import re
import signal
import subprocess
import sys

import cv2
import numpy as np
import pytest

from rover_obstacle_detection import __version__, program
from rover_obstacle_detection.cli import main as cli
from rover_obstacle_detection.cli import replay_command
from rover_obstacle_detection.errors import BagError

COMMAND = (sys.executable, '-m', 'rover_obstacle_detection')


def _run(*arguments):
    return subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, check=False)


def test_version():
    done = _run('--version')
    assert done.stdout.strip() == f'rover-obstacles {__version__}'
    assert done.returncode == 0


@pytest.mark.parametrize(
    'command', ['replay', 'inspect', 'detect', 'run', 'play', 'evaluate', 'simulate', 'tune']
)
def test_every_command_has_help_with_an_example(command, capsys):
    for arguments in (['--help'], [command, '--help']):
        with pytest.raises(SystemExit, match='0'):
            cli.main(arguments)
    overview, _, own_help = capsys.readouterr().out.partition(f'usage: rover-obstacles {command}')
    assert f'    {command} ' in overview
    assert f'  rover-obstacles {command} ' in own_help.partition('example')[2]


def _help_of_replay(monkeypatch, capsys):
    monkeypatch.setenv('COLUMNS', '80')
    with pytest.raises(SystemExit, match='0'):
        cli.main(['replay', '--help'])
    return capsys.readouterr().out


def test_help_of_replay_has_the_common_options_first(monkeypatch, capsys):
    text = _help_of_replay(monkeypatch, capsys)
    assert max(map(len, text.splitlines())) <= 80
    titles = re.findall(r'^([a-z][a-z ]+):$', text, re.MULTILINE)
    assert titles == [
        'positional arguments',
        'options',
        'common options',
        'detector',
        'images of the bag',
        'calibration',
        'examples',
    ]
    common = text.partition('\ncommon options:\n')[2].partition('\n\n')[0]
    assert set(re.findall(r'--[a-z]+', common)) >= {
        '--output', '--force', '--images', '--report', '--video', '--start', '--duration',
        '--every', '--workers',
    }  # fmt: skip


def test_help_of_replay_documents_every_option_once(monkeypatch, capsys):
    text = _help_of_replay(monkeypatch, capsys)
    listed = re.findall(r'^  (?:-\w(?: [A-Z]+)?, )?(--[a-z-]+)', text, re.MULTILINE)
    parser = argparse.ArgumentParser()
    replay_command.add_parser(parser.add_subparsers())
    (commands,) = (each for each in parser._actions if each.choices)
    actions = commands.choices['replay']._actions
    known = [each.option_strings[-1] for each in actions if each.option_strings]
    assert sorted(listed) == sorted(known)
    assert len(listed) > 25
    assert all(each.help for each in actions)


def test_help_imports_nothing_slow():
    code = (
        'import sys\n'
        'from rover_obstacle_detection.cli.main import make_parser\n'
        'make_parser().format_help()\n'
        "heavy = {'cv2', 'numpy', 'rosbags', 'rich', 'rclpy'} & set(sys.modules)\n"
        'sys.exit(str(heavy) if heavy else 0)\n'
    )
    done = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ('arguments', 'complaint'),
    [
        ((), 'COMMAND'),
        (('nonsense',), 'nonsense'),
        (('replay',), 'BAG'),
        (('replay', 'bag'), '--output'),
        (('replay', 'bag', '-o', 'out', '--workers', '0'), '1 or more'),
        (('replay', 'bag', '-o', 'out', '--every', 'x'), '1 or more'),
        (('replay', 'bag', '-o', 'out', '--start', '-1'), '0 or more'),
        (('replay', 'bag', '-o', 'out', '--duration', 'nan'), 'expected a number'),
        (('replay', 'bag', '-o', 'out', '--duration', '0'), 'a number above 0'),
        (('replay', 'bag', '-o', 'out', '--method', 'magic'), 'hybrid'),
        (('replay', 'bag', '-o', 'out', '--set', 'max_step'), 'name=value'),
        (('replay', 'bag', '-o', 'out', '--set', 'max_stpe=1'), 'did you mean max_step?'),
        (('replay', 'bag', '-o', 'out', '--set', 'max_step=99'), 'max_step is 99.0'),
        (('replay', 'bag', '-o', 'out', '--set', 'window_size=4'), 'window_size is 4'),
        (('replay', 'bag', '-o', 'out', '--set', 'sgbm_mode=x'), 'a whole number'),
        (('replay', 'bag', '-o', 'out', '--left-info', 'l.yaml'), 'without --right-info'),
        (
            ('detect', 'l.png', 'r.png', '-o', 'out'),
            'the calibration lacks fx (or hfov) and baseline: expected --fx or --hfov, --baseline',
        ),
        (('detect', 'l.png', 'r.png', '-o', 'out', '--hfov', '70'), 'lacks baseline: expected'),
        (
            ('replay', 'bag', '-o', 'out', '--hfov', '70', '--fx', '400'),
            '--fx and --hfov are both given',
        ),
        (
            ('replay', 'bag', '-o', 'out', '--calibration', 'c', '--left-info', 'l'),
            '--calibration is given with --left-info',
        ),
        (
            ('detect', 'l.png', '-o', 'out'),
            'detect: error: expected LEFT and RIGHT, or one image and --side',
        ),
        (('detect', 'l.png', 'r.png', '--side-by-side', '-o', 'out'), 'expected LEFT and RIGHT'),
        (('replay', 'bag', '--side-by-side', '-o', 'out'), 'expected --left-topic with both'),
        (('detect', 'l.png', 'r.png', '-o', 'out', '--fx', '-4'), 'expected a number above 0'),
        (
            ('detect', 'l.png', 'r.png', '-o', 'out', '--fov', '60'),
            'detect: error: unrecognized arguments: --fov 60: did you mean --hfov?',
        ),
        (
            ('inspect', 'bag', '--zzz', '--lefttopic=a'),
            'unrecognized arguments: --zzz --lefttopic=a: did you mean --left-topic?',
        ),
        (('inspect', 'bag', '--zzz'), 'unrecognized arguments: --zzz\n'),
    ],
)
def test_a_usage_error_exits_with_2_and_says_what_is_expected(arguments, complaint, capsys):
    with pytest.raises(SystemExit) as usage_error:
        cli.main(arguments)
    assert usage_error.value.code == 2
    assert complaint in capsys.readouterr().err


def _command_that(action, monkeypatch):
    def add_parser(subparsers):
        subparsers.add_parser('act').set_defaults(run=lambda arguments: action())

    module = type('Module', (), {'add_parser': staticmethod(add_parser)})
    monkeypatch.setattr(cli, 'COMMAND_MODULES', ('act_command',))
    monkeypatch.setattr(cli.importlib, 'import_module', lambda name: module)


def _raise(error):
    def action():
        raise error

    return action


@pytest.mark.parametrize(
    ('error', 'line'),
    [
        (BagError('x.mcap:\n  broken'), 'rover-obstacles: error: x.mcap: broken\n'),
        (
            OSError(28, 'No space left on device', 'out'),
            "rover-obstacles: error: [Errno 28] No space left on device: 'out'\n",
        ),
    ],
)
def test_a_known_error_prints_one_line_and_exits_with_1(error, line, monkeypatch, capsys):
    _command_that(_raise(error), monkeypatch)
    assert cli.main(['act']) == 1
    assert capsys.readouterr().err == line


def _no_memory_for_an_image():
    error = cv2.error('Failed to allocate 3145728 bytes')
    error.code = -4
    return error


def _no_memory_for_a_library():
    error = ImportError('IMPORTANT: PLEASE READ THIS\n\nfor advice\n\non how to solve this')
    error.__cause__ = ImportError('libopenblas.so: failed to map segment from shared object')
    return error


@pytest.mark.parametrize(
    ('error', 'reason'),
    [
        (MemoryError(), 'MemoryError'),
        (_no_memory_for_an_image(), 'cv2.error: Failed to allocate 3145728 bytes'),
        (
            _no_memory_for_a_library(),
            'ImportError: libopenblas.so: failed to map segment from shared object',
        ),
        (RuntimeError("can't start new thread"), "RuntimeError: can't start new thread"),
        (OSError(12, 'Cannot allocate memory'), 'OSError: [Errno 12] Cannot allocate memory'),
    ],
)
def test_a_lack_of_memory_prints_one_line(error, reason, monkeypatch, capsys):
    _command_that(_raise(error), monkeypatch)
    assert cli.main(['act']) == 1
    assert capsys.readouterr().err == f'rover-obstacles: error: out of memory: {reason}\n'


def test_an_allocation_that_fails_prints_one_line(monkeypatch, capsys):
    _command_that(lambda: np.empty(10**15), monkeypatch)
    assert cli.main(['act']) == 1
    error = capsys.readouterr().err
    assert error.startswith('rover-obstacles: error: out of memory: numpy.')
    assert error.count('\n') == 1


def test_other_errors_of_opencv_keep_their_traceback(monkeypatch):
    _command_that(_raise(cv2.error('assertion failed')), monkeypatch)
    with pytest.raises(cv2.error):
        cli.main(['act'])


# Interrupts itself at the given one of all imports.
INTERRUPTED = """
import os, signal, sys
from rover_obstacle_detection import program

name, left, *sys.argv[1:] = sys.argv[1:]
left = int(left)

def interrupt(event, arguments):
    global left
    if event == 'import':
        left -= 1
        if left < 0:
            left = 10**9
            os.kill(os.getpid(), signal.SIGINT)

sys.addaudithook(interrupt)
sys.exit(getattr(program, name)())
"""


@pytest.mark.parametrize('number', [0, 1, 5, 20, 50, 100, 150, 200, 300])
def test_an_interrupt_while_importing_is_at_most_one_line(number, tmp_path):
    command = ['replay', str(tmp_path), '-o', str(tmp_path / 'out')]
    done = subprocess.run(
        [sys.executable, '-c', INTERRUPTED, 'rover_obstacles', str(number), *command],
        capture_output=True,
        text=True,
        check=False,
    )
    # Python ends some interrupted processes by the signal itself; a shell shows 130 either way.
    assert done.returncode in (130, -signal.SIGINT)
    assert done.stderr in ('', 'rover-obstacles: interrupted\n')


@pytest.mark.parametrize('number', [0, 1, 5, 10, 20])
def test_an_interrupt_while_the_node_is_imported_is_silent(number):
    done = subprocess.run(
        [sys.executable, '-c', INTERRUPTED, 'obstacle_detector', str(number)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (130, '')


def test_an_interrupt_exits_with_130(monkeypatch, capsys):
    _command_that(_raise(KeyboardInterrupt()), monkeypatch)
    assert cli.main(['act']) == 130
    assert 'interrupted' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('module', 'package'), [('rosbags', 'rosbags'), ('ruamel.yaml', 'ruamel.yaml')]
)
def test_a_missing_package_is_one_line_with_the_remedy(module, package, tmp_path, monkeypatch):
    # As beside apt's ROS 2, where nothing was installed with pip.
    code = (
        'import sys\n'
        f'sys.modules[{module!r}] = None\n'
        'from rover_obstacle_detection.cli.main import main\n'
        "sys.exit(main(['inspect', 'bag']))\n"
    )
    done = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert done.stderr == (
        f'rover-obstacles: error: {package} is not installed: '
        'pip install lz4 mcap rich rosbags ruamel.yaml\n'
    )


def test_another_missing_module_keeps_its_traceback(monkeypatch):
    _command_that(
        _raise(ModuleNotFoundError("No module named 'nothing'", name='nothing')), monkeypatch
    )
    with pytest.raises(ModuleNotFoundError):
        cli.main(['act'])


def test_an_unknown_error_keeps_its_traceback(monkeypatch):
    _command_that(_raise(ZeroDivisionError()), monkeypatch)
    with pytest.raises(ZeroDivisionError):
        cli.main(['act'])


def test_progress_is_shown_only_on_a_terminal(capfd):
    code = (
        'from rover_obstacle_detection.cli.console import progress_bars\n'
        "with progress_bars(['traverse'], 'pairs') as update:\n"
        '    update(0, 3, 12)\n'
    )
    master, slave = pty.openpty()
    environment = {**os.environ, 'TERM': 'xterm', 'COLUMNS': '100'}
    subprocess.run([sys.executable, '-c', code], stderr=slave, env=environment, check=True)
    os.close(slave)
    drawn = os.read(master, 100_000).decode()
    os.close(master)
    assert 'traverse' in drawn
    assert '3/12' in drawn
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, check=True)
    assert done.stderr == b''
    assert done.stdout == b''


# Shows what OpenCV will read.
IDLE_THREADS = """
import os, sys, types
from rover_obstacle_detection import program

def main():
    print(os.environ[program.IDLE_THREADS[0]], 'cv2' in sys.modules)
    return 0

program.importlib.import_module = lambda name: types.SimpleNamespace(main=main)
sys.exit(getattr(program, sys.argv[1])())
"""


@pytest.mark.parametrize('name', ['rover_obstacles', 'obstacle_detector'])
@pytest.mark.parametrize(('given', 'shown'), [({}, '200'), ({program.IDLE_THREADS[0]: '7'}, '7')])
def test_idle_threads_sleep_soon_unless_the_user_says_otherwise(name, given, shown):
    inherited = {
        key: value for key, value in os.environ.items() if key not in program.IDLE_THREADS
    }
    done = subprocess.run(
        [sys.executable, '-c', IDLE_THREADS, name],
        env=inherited | given,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == f'{shown} False\n'
