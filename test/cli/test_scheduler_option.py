"""The option ``--scheduler`` without a cluster."""

from __future__ import annotations

import sys

import pytest

from rover_obstacle_detection.cli.main import main

SCHEDULER = ('--scheduler', 'tcp://127.0.0.1:9')


@pytest.mark.parametrize('command', [('replay', '-o', 'out'), ('evaluate',)])
def test_a_missing_library_is_an_error_that_names_the_extra(
    command, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    for name in ('cluster', 'cluster_channel', 'cluster_worker'):
        module = f'rover_obstacle_detection.offline.{name}'
        monkeypatch.delitem(sys.modules, module, raising=False)
    monkeypatch.setitem(sys.modules, 'distributed', None)
    assert main([*command, 'bag', *SCHEDULER]) == 1
    assert capsys.readouterr().err == (
        'rover-obstacles: error: --scheduler needs dask.distributed, which is not installed: '
        'pip install distributed\n'
    )
    assert list(tmp_path.iterdir()) == []


def test_an_empty_address_is_not_taken_for_none(capsys):
    with pytest.raises(SystemExit) as ended:
        main(['replay', 'one', '-o', 'out', '--scheduler', ''])
    assert ended.value.code == 2
    assert "argument --scheduler: '': expected an address" in capsys.readouterr().err


def test_processes_here_and_a_scheduler_exclude_each_other(capsys):
    with pytest.raises(SystemExit) as ended:
        main(['replay', 'one', 'two', '-o', 'out', '--workers', '2', *SCHEDULER])
    assert ended.value.code == 2
    assert '--scheduler: expected no --workers' in capsys.readouterr().err
