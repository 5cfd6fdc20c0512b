"""Pairs that the detector cannot judge, or judges with a warning, offline."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hand_made import FIRST_STAMP_NS, stereo_images, write_calibration, write_stereo_bag
from rosbags.highlevel import AnyReader

from rover_obstacle_detection.bags.writer import BagWriter
from rover_obstacle_detection.cli.main import main
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.errors import CameraError, UnjudgeablePairError
from rover_obstacle_detection.offline import detect_pair, frame_outputs, replay

PERIOD_NS = 100_000_000
REASON = 'the right image does not belong to the left one: 2 % of the textured pixels match'
PITCH = 'camera_pitch is 0 but the ground says {} degrees'

Outcome = str | tuple[str, ...] | Exception


@pytest.fixture
def outcomes(monkeypatch: pytest.MonkeyPatch) -> Callable[[list[Outcome]], None]:
    """Set what the detector says of each pair: why it cannot judge it, or its warnings."""

    def set_outcomes(wanted: list[Outcome]) -> None:
        remaining: Iterator[Outcome] = iter(wanted)

        class Stub(Detector):
            def detect(self, *images: Any, **options: Any) -> Detection:
                outcome = next(remaining)
                if isinstance(outcome, Exception):
                    raise outcome
                if isinstance(outcome, str):
                    raise UnjudgeablePairError(outcome)
                return dataclasses.replace(super().detect(*images, **options), warnings=outcome)

        for module in (replay, detect_pair):
            monkeypatch.setattr(module, 'Detector', Stub)

    return set_outcomes


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_stereo_bag(tmp_path_factory.mktemp('recorded') / 'drive', pairs=4)


def summary_of(output: Path) -> Any:
    return json.loads((output / 'summary.json').read_text())


def test_replay_goes_on_and_counts_unjudgeable_pairs_and_warnings(
    bag: Path, outcomes: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outcomes([(), REASON, (PITCH.format(45),), (PITCH.format(44.5), 'blurred')])

    assert main(['replay', str(bag), '-o', str(tmp_path / 'out')]) == 0

    summary = summary_of(tmp_path / 'out')
    counts = summary['counts']
    assert (counts['detected'], counts['bad'], counts['unjudgeable']) == (3, 1, 1)
    (bad,) = summary['bad_frames']
    assert bad['stamp_ns'] == FIRST_STAMP_NS + PERIOD_NS
    assert bad['unjudgeable'] is True
    assert bad['reason'] == f'/cam/left/image_rect, /cam/right/image_rect: {REASON}'
    assert summary['warnings'] == [
        {
            'text': PITCH.format(45),
            'frames': 2,
            'first_stamp_ns': FIRST_STAMP_NS + 2 * PERIOD_NS,
        },
        {'text': 'blurred', 'frames': 1, 'first_stamp_ns': FIRST_STAMP_NS + 3 * PERIOD_NS},
    ]
    assert summary['frames'][1]['warnings'] == [PITCH.format(45)]
    shown = ' '.join(capsys.readouterr().out.replace('│', ' ').split())
    assert 'bad frames 1 skipped, see below of these unjudgeable 1' in shown
    assert f'bad frame at {bad["stamp_ns"] / 1e9:.3f} s: {bad["reason"]}' in shown
    assert 'frames with warnings 2 see below' in shown
    assert 'warning in 2 of 3 frames, first at 1700000000.200 s: camera_pitch is 0' in shown


def test_nothing_is_written_to_the_bag_for_an_unjudgeable_pair(
    bag: Path, outcomes: Any, tmp_path: Path
) -> None:
    outcomes([(), REASON, (), ()])

    assert main(['replay', str(bag), '-o', str(tmp_path / 'out'), '--images']) == 0

    with AnyReader([tmp_path / 'out' / 'detections']) as reader:
        stamps = {time_ns for _, time_ns, _ in reader.messages()}
    assert stamps == {FIRST_STAMP_NS + index * PERIOD_NS for index in (0, 2, 3)}
    assert len(list((tmp_path / 'out' / 'images').glob('*_overlay.png'))) == 3


def test_recording_without_a_judgeable_pair_is_refused_with_the_reason(
    bag: Path, outcomes: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outcomes([REASON] * 4)

    assert main(['replay', str(bag), '-o', str(tmp_path / 'out')]) == 1

    error = capsys.readouterr().err
    assert error.count('\n') == 1
    assert 'no usable pair' in error
    assert REASON in error
    assert not (tmp_path / 'out').exists()


@pytest.mark.parametrize(
    ('error', 'reason'),
    [
        (cv2.error('OpenCV: resize failed'), 'cv2.error: OpenCV: resize failed'),
        (ValueError('cannot reshape\n an array'), 'ValueError: cannot reshape an array'),
        (MemoryError(), 'MemoryError'),
        (CameraError('images are 12 x 12 pixels'), 'images are 12 x 12 pixels'),
    ],
)
def test_any_failure_with_one_pair_is_that_of_the_pair(
    error: Exception,
    reason: str,
    bag: Path,
    outcomes: Any,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    outcomes([(), error, (), ()])

    assert main(['replay', str(bag), '-o', str(tmp_path / 'out')]) == 0

    summary = summary_of(tmp_path / 'out')
    stamps = [frame['stamp_ns'] for frame in summary['frames']]
    assert stamps == [FIRST_STAMP_NS + index * PERIOD_NS for index in (0, 2, 3)]
    (bad,) = summary['bad_frames']
    assert bad['stamp_ns'] == FIRST_STAMP_NS + PERIOD_NS
    assert bad['reason'] == f'/cam/left/image_rect, /cam/right/image_rect: {reason}'
    assert bad['unjudgeable'] is False
    captured = capsys.readouterr()
    assert bad['reason'] in ' '.join(captured.out.split())
    assert captured.err == ''


def test_pictures_of_a_pair_that_fails_are_removed(
    bag: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    written = frame_outputs.write_pictures
    calls = iter(range(4))

    def fail_at_the_last(*arguments: Any) -> None:
        written(*arguments)
        if next(calls) == 3:
            raise cv2.error('no more')

    monkeypatch.setattr(frame_outputs, 'write_pictures', fail_at_the_last)

    assert main(['replay', str(bag), '-o', str(tmp_path / 'out'), '--images']) == 0

    assert summary_of(tmp_path / 'out')['counts']['bad'] == 1
    assert len(list((tmp_path / 'out' / 'images').glob('*_overlay.png'))) == 3
    with AnyReader([tmp_path / 'out' / 'detections']) as reader:
        stamps = {time_ns for _, time_ns, _ in reader.messages()}
    assert stamps == {FIRST_STAMP_NS + index * PERIOD_NS for index in range(3)}


def test_a_pair_that_cannot_be_written_is_not_in_the_report(
    bag: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    pytest.importorskip('matplotlib', reason='needs the extra report')
    pytest.importorskip('jinja2', reason='needs the extra report')
    add = BagWriter.add

    def fail_at_the_last(
        writer: BagWriter, topic: str, type_name: str, message: Any, stamp_ns: int
    ) -> None:
        if stamp_ns == FIRST_STAMP_NS + 3 * PERIOD_NS:
            raise ValueError('no more')
        add(writer, topic, type_name, message, stamp_ns)

    monkeypatch.setattr(BagWriter, 'add', fail_at_the_last)

    assert main(['replay', str(bag), '-o', str(tmp_path / 'out'), '--report']) == 0

    counts = summary_of(tmp_path / 'out')['counts']
    assert (counts['detected'], counts['bad']) == (3, 1)
    assert 'ValueError: no more' in (tmp_path / 'out' / 'report.html').read_text()


def test_the_traceback_of_a_failure_is_logged_for_debugging(
    bag: Path, outcomes: Any, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    outcomes([(), ValueError('unforeseen'), (), ()])

    with caplog.at_level('DEBUG', 'rover_obstacle_detection'):
        assert main(['replay', str(bag), '-o', str(tmp_path / 'out')]) == 0

    assert f'pair at {FIRST_STAMP_NS + PERIOD_NS} ns failed' in caplog.text
    assert 'Traceback' in caplog.text


def test_a_recording_where_every_pair_fails_is_refused_on_one_line(
    bag: Path, outcomes: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outcomes([ValueError('unforeseen')] * 4)

    assert main(['replay', str(bag), '-o', str(tmp_path / 'out')]) == 1

    error = capsys.readouterr().err
    assert error.count('\n') == 1
    assert '4 bad: /cam/left/image_rect, /cam/right/image_rect: ValueError: unforeseen' in error
    assert list(tmp_path.iterdir()) == []


def detect(folder: Path, *, swapped: bool = False) -> int:
    images = stereo_images()[:: -1 if swapped else 1]
    for side, image in zip(('left', 'right'), images, strict=True):
        cv2.imwrite(str(folder / f'{side}.png'), image)
    left, right = write_calibration(folder)
    images_given = [str(folder / 'left.png'), str(folder / 'right.png')]
    infos = ['--left-info', str(left), '--right-info', str(right)]
    return main(['detect', *images_given, *infos, '-o', str(folder / 'out')])


def test_detect_prints_why_a_pair_cannot_be_judged(
    outcomes: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outcomes([REASON])

    assert detect(tmp_path) == 1

    files = f'{tmp_path / "left.png"}, {tmp_path / "right.png"}'
    assert capsys.readouterr().err == f'rover-obstacles: error: {files}: {REASON}\n'
    assert not (tmp_path / 'out').exists()


def test_swapped_images_are_named_although_they_cannot_be_judged(
    outcomes: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outcomes([REASON])

    assert detect(tmp_path, swapped=True) == 1

    error = capsys.readouterr().err
    assert error.count('\n') == 1
    assert 'are left and right swapped?' in error


def test_detect_prints_and_records_warnings(
    outcomes: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outcomes([(PITCH.format(45), 'blurred')])

    assert detect(tmp_path) == 0

    captured = capsys.readouterr()
    assert captured.err.splitlines() == [
        f'rover-obstacles: WARNING: {PITCH.format(45)}',
        'rover-obstacles: WARNING: blurred',
    ]
    assert summary_of(tmp_path / 'out')['warnings'] == [PITCH.format(45), 'blurred']


def test_nothing_is_reported_as_measured_without_a_ground_plane(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    class Stub(Detector):
        def detect(self, *images: Any, **options: Any) -> Detection:
            found = super().detect(*images, **options)
            assumed = dataclasses.replace(found.ground, height_m=1.0, measured=False)
            return dataclasses.replace(found, ground=assumed)

    monkeypatch.setattr(detect_pair, 'Detector', Stub)

    assert detect(tmp_path) == 0

    summary = summary_of(tmp_path / 'out')
    for key in ('camera_height_m', 'camera_pitch_deg', 'tallest_obstacle_m'):
        assert summary[key] is None, key
    assert summary['obstacles'] == len(summary['obstacle_list']) >= 1
    assert {each['max_height_m'] for each in summary['obstacle_list']} == {None}
    assert np.isfinite([each['range_m'] for each in summary['obstacle_list']]).all()
