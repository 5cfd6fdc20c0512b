"""Bad input to ``replay``: one line on stderr, exit status 1, nothing written."""

import json
import re

import numpy as np
import pytest
from hand_made import CAMERA, stereo_images, write_stereo_bag

from rover_obstacle_detection.bags.writer import BagWriter
from rover_obstacle_detection.cli.main import main
from rover_obstacle_detection.messages.header import make_header
from rover_obstacle_detection.messages.rosbags_factory import RosbagsFactory

PLAIN = (np.full(CAMERA.shape, 90, np.uint8),) * 2


def _bag(path, **options):
    return write_stereo_bag(path, pairs=2, images=[PLAIN], **options)


def _short_rows(index, side, message):
    message.step = 100


def _with_infos(change):
    return lambda path: _bag(path, change_info=change)


def _negative_baseline(side, info):
    if side == 'right':
        info.p[3] = 20.0


def _missing(path):
    return path


def _text(path):
    path = path.with_suffix('.mcap')
    path.write_text('no bag at all')
    return path


def _truncated(path):
    file = _bag(path) / f'{path.name}.mcap'
    file.write_bytes(file.read_bytes()[: file.stat().st_size * 2 // 3])
    return file


def _other_topics(path):
    with BagWriter(path) as bag:
        header = make_header(1, 'imu', bag.factory)
        message = bag.factory.make('sensor_msgs/msg/Imu', header=header)
        bag.add('/imu/data', 'sensor_msgs/msg/Imu', message, 1)
    return path


def _smaller_right(path):
    return write_stereo_bag(path, pairs=2, images=[(PLAIN[0], PLAIN[1][:-40])])


def _swapped(path):
    left, right = stereo_images()
    return write_stereo_bag(path, pairs=2, images=[(right, left)])


def _broken_jpeg(path):
    factory = RosbagsFactory()

    def compress(index, side, message):
        return factory.make(
            'sensor_msgs/msg/CompressedImage',
            header=message.header,
            format='jpeg',
            data=np.frombuffer(b'\xff\xd8\xff\xe0 nothing more', np.uint8),
        )

    return _bag(path, change_image=compress)


@pytest.mark.parametrize(
    ('make', 'complaint'),
    [
        (_missing, r'recording: no such recording'),
        (_text, r'recording\.mcap: cannot be read'),
        (_truncated, r'recording\.mcap: cut short or damaged.*--salvage'),
        (_other_topics, r'no stereo topics.*/imu/data'),
        (lambda path: _bag(path, sides=('left',)), r'only left images'),
        (lambda path: _bag(path, infos=False), r'no calibration for /cam/left/image_rect'),
        (_with_infos(_negative_baseline), r'baseline is -.*swapped'),
        (_smaller_right, r'/cam/right/image_rect is 320 x 200.*same size'),
        (
            _with_infos(lambda side, info: setattr(info, 'height', 120)),
            r'320 x 240.*is for 320 x 120',
        ),
        (lambda path: _bag(path, change_image=_short_rows), r'/cam/left/image_rect: step is 100'),
        (_swapped, r'no usable pair: 2 left images .*are left and right swapped'),
        (_broken_jpeg, r'/cam/left/image_rect: data is'),
    ],
)
def test_bad_recordings(make, complaint, tmp_path, capsys):
    (tmp_path / 'bags').mkdir()
    bag = make(tmp_path / 'bags' / 'recording')
    capsys.readouterr()
    assert main(['replay', str(bag), '-o', str(tmp_path / 'results' / 'out'), '--images']) == 1
    captured = capsys.readouterr()
    lines = captured.err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith('rover-obstacles: error: ')
    assert re.search(complaint, lines[0]), lines[0]
    assert captured.out == ''
    assert [path.name for path in tmp_path.iterdir()] == ['bags']


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
