"""Bad options of ``replay``: one line on stderr, exit status 1, nothing written."""

import json

import pytest
from faulty_recordings import PLAIN
from hand_made import write_stereo_bag

from rover_obstacle_detection.cli.main import main


def _bag(path, **options):
    return write_stereo_bag(path, pairs=2, images=[PLAIN], **options)


@pytest.mark.parametrize(
    ('options', 'complaint'),
    [
        (['--left-topic', '/cam/nowhere'], '/cam/nowhere'),
        (['--start', '99'], '0 left images'),
        (['--params', 'missing.yaml'], 'missing.yaml: no such parameter file'),
        (['--left-info', 'l.yaml', '--right-info', 'r.yaml'], 'l.yaml: no such calibration'),
        (['--set', 'gravity_source=imu'], "gravity_source is 'imu'"),
        (['--set', 'min_range=5', '--set', 'max_range=4'], 'max_range is 4'),
        (['--rover-mask', 'missing.png'], "'missing.png': no such file"),
        (['--rover-polygon', '[[1,2]]'], 'three or more corners'),
    ],
)
def test_bad_options(options, complaint, tmp_path, capsys):
    bag = _bag(tmp_path / 'recording')
    assert main(['replay', str(bag), '-o', str(tmp_path / 'out'), *options]) == 1
    error = capsys.readouterr().err
    assert complaint in error
    assert error.count('\n') == 1
    assert [path.name for path in tmp_path.iterdir()] == ['recording']


def test_salvage_replays_a_damaged_bag(tmp_path, capsys):
    whole = write_stereo_bag(tmp_path / 'recording', pairs=12)
    file = whole / 'recording.mcap'
    damaged = tmp_path / 'damaged.mcap'
    damaged.write_bytes(file.read_bytes()[:-2000])
    assert main(['replay', str(damaged), '-o', str(tmp_path / 'out'), '--salvage']) == 0
    assert 'cut short or damaged' in ' '.join(capsys.readouterr().out.split())
    summary = json.loads((tmp_path / 'out' / 'summary.json').read_text())
    assert 'cut short or damaged' in summary['notes'][0]
    assert summary['counts']['detected'] == 12
