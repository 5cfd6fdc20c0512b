import pytest

from rover_obstacle_detection.errors import OutputError
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
