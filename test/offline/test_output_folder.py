import signal
import subprocess
import sys
from pathlib import Path

import pytest

from rover_obstacle_detection.errors import OutputError
from rover_obstacle_detection.offline import output_folder as module
from rover_obstacle_detection.offline.output_folder import output_folder

OWN = ('summary.json', 'images/[0-9]*.png')


def _write(folder, files):
    for name, text in files.items():
        (folder / name).parent.mkdir(exist_ok=True, parents=True)
        (folder / name).write_text(text)


def _content(folder):
    return {
        str(path.relative_to(folder)): path.read_text()
        for path in folder.rglob('*')
        if path.is_file()
    }


def test_the_folder_appears_when_the_block_ends(tmp_path):
    target = tmp_path / 'new' / 'out'
    with output_folder(target, force=False, replaces=OWN) as folder:
        _write(folder, {'summary.json': '1', 'images/0.png': 'a'})
        assert not target.exists()
    assert _content(tmp_path) == {'new/out/summary.json': '1', 'new/out/images/0.png': 'a'}


def _fail_after_writing(target, error, *, force):
    with output_folder(target, force=force, replaces=OWN) as folder:
        _write(folder, {'summary.json': 'new', 'images/0.png': 'new'})
        raise error


@pytest.mark.parametrize('error', [ValueError, KeyboardInterrupt, SystemExit])
def test_an_exception_leaves_nothing_behind(tmp_path, error):
    with pytest.raises(error):
        _fail_after_writing(tmp_path / 'new' / 'out', error, force=False)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_not_empty_is_refused(tmp_path):
    _write(tmp_path, {'out/notes.txt': 'mine'})
    with (
        pytest.raises(OutputError, match=r'out is not empty: give --force'),
        output_folder(tmp_path / 'out', force=False, replaces=OWN),
    ):
        pass
    assert _content(tmp_path) == {'out/notes.txt': 'mine'}


def test_an_empty_folder_is_filled(tmp_path):
    (tmp_path / 'out').mkdir()
    with output_folder(tmp_path / 'out', force=False, replaces=OWN) as folder:
        _write(folder, {'summary.json': '1'})
    assert _content(tmp_path) == {'out/summary.json': '1'}
    assert [path.name for path in tmp_path.iterdir()] == ['out']


def test_a_file_is_refused_even_with_force(tmp_path):
    _write(tmp_path, {'out': 'a file'})
    with (
        pytest.raises(OutputError, match='is a file: expected a folder'),
        output_folder(tmp_path / 'out', force=True, replaces=OWN),
    ):
        pass


def test_force_replaces_only_the_files_of_an_earlier_run(tmp_path):
    _write(
        tmp_path,
        {
            'out/summary.json': 'old',
            'out/images/1.png': 'old',
            'out/images/2.png': 'old',
            'out/images/sketch.png': 'mine',
            'out/notes.txt': 'mine',
        },
    )
    with output_folder(tmp_path / 'out', force=True, replaces=OWN) as folder:
        _write(folder, {'summary.json': 'new', 'images/1.png': 'new'})
    assert _content(tmp_path / 'out') == {
        'summary.json': 'new',
        'images/1.png': 'new',
        'images/sketch.png': 'mine',
        'notes.txt': 'mine',
    }
    with output_folder(tmp_path / 'out', force=True, replaces=OWN) as folder:
        _write(folder, {'summary.json': 'newer'})
    assert not (tmp_path / 'out/images/1.png').exists()
    assert (tmp_path / 'out/images/sketch.png').exists()


def test_an_exception_with_force_keeps_the_old_files(tmp_path):
    _write(tmp_path, {'out/summary.json': 'old'})
    with pytest.raises(KeyboardInterrupt):
        _fail_after_writing(tmp_path / 'out', KeyboardInterrupt, force=True)
    assert _content(tmp_path) == {'out/summary.json': 'old'}


def test_an_unwritable_path_is_named(tmp_path):
    _write(tmp_path, {'file': ''})
    with (
        pytest.raises(OutputError, match=r'cannot create output folder .*file:'),
        output_folder(tmp_path / 'file' / 'out', force=False, replaces=OWN),
    ):
        pass


OLD = {
    'summary.json': 'old',
    'images/1.png': 'old',
    'images/2.png': 'old',
    'images/sketch.png': 'mine',
    'more/notes.txt': 'mine',
}
NEW = {'summary.json': 'new', 'images/1.png': 'new', 'images/3.png': 'new'}
OTHERS = {'images/sketch.png': 'mine', 'more/notes.txt': 'mine'}


def _inside(folder, files):
    return {f'{folder}/{name}': text for name, text in files.items()}


def _replace(target):
    with output_folder(target, force=True, replaces=OWN) as folder:
        _write(folder, NEW)


# Kills itself at the given one of all changes of files after the block.
KILLED = """
import os, signal, sys
from pathlib import Path
from rover_obstacle_detection.offline.output_folder import output_folder

CHANGES = ('os.link', 'os.rename', 'os.remove', 'os.rmdir', 'os.mkdir', 'os.chmod', 'ctypes.dlsym')
left = int(sys.argv[2])
in_last_step = False

def kill(event, arguments):
    global left
    if in_last_step and event in CHANGES:
        left -= 1
        if left < 0:
            os.kill(os.getpid(), signal.SIGKILL)

sys.addaudithook(kill)
own = ('summary.json', 'images/[0-9]*.png')
with output_folder(Path(sys.argv[1]), force=True, replaces=own) as folder:
    (folder / 'images').mkdir()
    for name in ('summary.json', 'images/1.png', 'images/3.png'):
        (folder / name).write_text('new')
    in_last_step = True
"""


def test_a_kill_at_any_moment_leaves_the_old_or_the_new_folder(tmp_path, caplog):
    found = []
    status = -signal.SIGKILL
    while status == -signal.SIGKILL:
        target = tmp_path / str(len(found)) / 'out'
        _write(target, OLD)
        child = [sys.executable, '-c', KILLED, str(target), str(len(found))]
        done = subprocess.run(child, capture_output=True, text=True, check=False)
        status = done.returncode
        content = _content(target)
        assert content in (OLD, NEW | OTHERS)
        found.append(content['summary.json'])
    assert status == 0, done.stderr
    assert found == sorted(found, reverse=True)
    assert {'old', 'new'} == {*found[:-1]}
    for number in range(len(found) - 1):
        target = tmp_path / str(number) / 'out'
        _replace(target)
        assert _content(target.parent) == _inside('out', NEW | OTHERS)
    assert f'{tmp_path}/0/.out.partial is left over from a run that was killed' in caplog.text


def test_two_runs_into_one_folder_are_refused(tmp_path):
    target = tmp_path / 'out'
    _write(target, OLD)
    with output_folder(target, force=True, replaces=OWN) as folder:
        with pytest.raises(OutputError, match=rf'^another run is writing to {target}$'):
            _replace(target)
        _write(folder, NEW)
    assert _content(target) == NEW | OTHERS


def test_files_that_appear_meanwhile_are_not_replaced_without_force(tmp_path):
    target = tmp_path / 'out'

    def write():
        with output_folder(target, force=False, replaces=OWN) as folder:
            _write(folder, NEW)
            _write(target, OLD)

    with pytest.raises(OutputError, match='is not empty'):
        write()
    assert _content(tmp_path) == _inside('out', OLD)


def test_permissions_and_links_of_the_old_folder_are_kept(tmp_path):
    target = tmp_path / 'out'
    _write(target, OLD)
    (target / 'link').symlink_to('nowhere')
    (target / 'empty').mkdir()
    target.chmod(0o750)
    _replace(target)
    assert (target / 'link').readlink() == Path('nowhere')
    assert list((target / 'empty').iterdir()) == []
    assert target.stat().st_mode & 0o777 == 0o750


def test_the_working_directory_and_linked_subfolders_stay_the_same(tmp_path, monkeypatch):
    target = tmp_path / 'out'
    _write(target, OLD)
    monkeypatch.chdir(target)
    before = target.stat().st_ino
    _replace(target)
    assert target.stat().st_ino == before
    assert _content(target) == NEW | OTHERS
    monkeypatch.chdir(tmp_path)
    (target / 'images').rename(tmp_path / 'elsewhere')
    (target / 'images').symlink_to(tmp_path / 'elsewhere')
    (target / 'summary.json').write_text('old')
    _replace(target)
    assert (target / 'images').is_symlink()
    assert _content(target) == {'summary.json': 'new', 'more/notes.txt': 'mine'}
    assert _content(tmp_path / 'elsewhere') == {
        '1.png': 'new',
        '3.png': 'new',
        'sketch.png': 'mine',
    }


def test_without_exchange_the_old_folder_is_put_aside(tmp_path, monkeypatch):
    monkeypatch.setattr(module.ctypes, 'CDLL', lambda *_, **__: object())
    target = tmp_path / 'out'
    _write(target, OLD)
    _replace(target)
    assert _content(tmp_path) == _inside('out', NEW | OTHERS)


def test_an_old_folder_left_aside_is_put_back(tmp_path, caplog):
    target = tmp_path / 'out'
    _write(tmp_path / '.out.replaced', OLD)
    with (
        pytest.raises(OutputError, match='is not empty'),
        output_folder(target, force=False, replaces=OWN),
    ):
        pass
    assert _content(tmp_path) == _inside('out', OLD)
    assert '.out.replaced is left over from a run that was killed: putting it back' in caplog.text


def test_a_place_that_cannot_be_renamed_is_filled(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(16, 'Device or resource busy')

    monkeypatch.setattr(module, '_exchange', refuse)
    target = tmp_path / 'out'
    _write(target, OLD)
    _replace(target)
    assert _content(tmp_path) == _inside('out', NEW | OTHERS)
