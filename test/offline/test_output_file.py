"""Files appear whole or not at all."""

from __future__ import annotations

from pathlib import Path

import pytest

from rover_obstacle_detection.errors import OutputError
from rover_obstacle_detection.offline.output_file import (
    check_output_file,
    write_json_whole,
    write_whole,
)


def test_a_file_is_written_and_nothing_beside_it(tmp_path: Path) -> None:
    write_whole(tmp_path / 'a.yaml', 'x: 1\n')
    assert (tmp_path / 'a.yaml').read_text(encoding='utf-8') == 'x: 1\n'
    assert [each.name for each in tmp_path.iterdir()] == ['a.yaml']


def test_what_is_there_stays_when_writing_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / 'a.yaml'
    file.write_text('mine', encoding='utf-8')

    def full(path: Path, target: Path) -> None:
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr(Path, 'replace', full)
    with pytest.raises(OutputError, match=r'a\.yaml: No space left on device'):
        write_whole(file, 'x' * 1000)
    assert file.read_text(encoding='utf-8') == 'mine'
    assert [each.name for each in tmp_path.iterdir()] == ['a.yaml']


def test_a_link_still_leads_to_the_file(tmp_path: Path) -> None:
    file, link = tmp_path / 'a.yaml', tmp_path / 'link.yaml'
    file.write_text('old', encoding='utf-8')
    link.symlink_to(file)
    write_whole(link, 'new')
    assert link.is_symlink()
    assert file.read_text(encoding='utf-8') == 'new'


def test_figures_that_are_none_are_a_mistake_and_leave_nothing(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match='nan'):
        write_json_whole(tmp_path / 'a.json', {'iou': float('nan')})
    assert not list(tmp_path.iterdir())


def test_what_could_not_be_written_is_refused_before_the_work(tmp_path: Path) -> None:
    file = tmp_path / 'a.yaml'
    check_output_file(file, force=False)
    file.write_text('mine', encoding='utf-8')
    with pytest.raises(OutputError, match='give --force'):
        check_output_file(file, force=False)
    check_output_file(file, force=True)
    for nowhere in (tmp_path, tmp_path / 'nowhere' / 'a.yaml', Path('/dev/null')):
        with pytest.raises(OutputError, match='expected a file in a folder that exists'):
            check_output_file(nowhere, force=True)
