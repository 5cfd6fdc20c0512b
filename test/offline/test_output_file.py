"""Files are written atomically."""

from __future__ import annotations

from pathlib import Path

import pytest

from rover_obstacle_detection.errors import OutputError
from rover_obstacle_detection.offline.output_file import (
    atomic_write_json,
    atomic_write_text,
    check_output_file,
)


def test_writing_leaves_no_temporary_file(tmp_path: Path) -> None:
    atomic_write_text(tmp_path / 'a.yaml', 'x: 1\n')
    assert (tmp_path / 'a.yaml').read_text(encoding='utf-8') == 'x: 1\n'
    assert [each.name for each in tmp_path.iterdir()] == ['a.yaml']


def test_a_failure_keeps_the_existing_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / 'a.yaml'
    file.write_text('mine', encoding='utf-8')

    def full(path: Path, target: Path) -> None:
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr(Path, 'replace', full)
    with pytest.raises(OutputError, match=r'a\.yaml: No space left on device'):
        atomic_write_text(file, 'x' * 1000)
    assert file.read_text(encoding='utf-8') == 'mine'
    assert [each.name for each in tmp_path.iterdir()] == ['a.yaml']


def test_a_symbolic_link_is_followed(tmp_path: Path) -> None:
    file, link = tmp_path / 'a.yaml', tmp_path / 'link.yaml'
    file.write_text('old', encoding='utf-8')
    link.symlink_to(file)
    atomic_write_text(link, 'new')
    assert link.is_symlink()
    assert file.read_text(encoding='utf-8') == 'new'


def test_nan_is_an_error_and_leaves_no_file(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match='nan'):
        atomic_write_json(tmp_path / 'a.json', {'iou': float('nan')})
    assert not list(tmp_path.iterdir())


def test_unwritable_paths_are_refused_in_advance(tmp_path: Path) -> None:
    file = tmp_path / 'a.yaml'
    check_output_file(file, force=False)
    file.write_text('mine', encoding='utf-8')
    with pytest.raises(OutputError, match='give --force'):
        check_output_file(file, force=False)
    check_output_file(file, force=True)
    for nowhere in (tmp_path, tmp_path / 'nowhere' / 'a.yaml', Path('/dev/null')):
        with pytest.raises(OutputError, match='expected a file in an existing folder'):
            check_output_file(nowhere, force=True)
