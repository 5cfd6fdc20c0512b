"""Every fault of the table, in a recording: the replay says so, and judges the good pairs."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from fault_row import BAD_FRAME, Row
from faulty_recordings import PAIRS
from hand_made import CAMERA, stereo_images
from replay_fault_table import REPLAY_ROWS
from rosbags.highlevel import AnyReader

from rover_obstacle_detection.cli.main import main
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.messages.image import decode_image

WHOLE = [row for row in REPLAY_ROWS if not row.status]
PARTIAL = [row for row in REPLAY_ROWS if row.status == BAD_FRAME]


@pytest.fixture(scope='module')
def mask() -> np.ndarray:
    """Mask of each good pair."""
    return Detector(CAMERA).detect(*stereo_images()).mask


@pytest.mark.parametrize('row', WHOLE, ids=lambda row: row.fault)
def test_unusable_recording_is_one_line(
    row: Row, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = row.inject(tmp_path)
    before = sorted(tmp_path.iterdir())

    assert main(['replay', *arguments, '-o', str(tmp_path / 'results' / 'out'), '--images']) == 1

    captured = capsys.readouterr()
    assert captured.out == ''
    assert captured.err.count('\n') == 1
    assert re.match(f'rover-obstacles: error: .*{row.pattern}', captured.err), captured.err
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize('row', PARTIAL, ids=lambda row: row.fault)
def test_bad_frame_is_named_and_the_others_judged(
    row: Row, tmp_path: Path, capsys: pytest.CaptureFixture[str], mask: np.ndarray
) -> None:
    output = tmp_path / 'out'

    assert main(['replay', *row.inject(tmp_path), '-o', str(output)]) == 0

    printed = ' '.join(capsys.readouterr().out.split())
    assert re.search(rf'bad frame at [\d.]+ s: .*{row.pattern}', printed), printed
    summary = json.loads((output / 'summary.json').read_text())
    assert summary['counts']['detected'] == PAIRS - 1
    assert summary['counts']['bad'] >= 1
    with AnyReader([output / 'detections']) as reader:
        connections = [each for each in reader.connections if each.topic == '/cam/obstacle_mask']
        masks = [
            decode_image(reader.deserialize(data, each.msgtype), 'mask')
            for each, _, data in reader.messages(connections)
        ]
    assert len(masks) == PAIRS - 1
    for each in masks:
        union = np.count_nonzero(each | mask)
        assert np.count_nonzero(each & mask) > 0.9 * union > 0
