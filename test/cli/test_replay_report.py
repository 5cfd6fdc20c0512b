"""``replay --report`` shows a replay on one page, and ``obstacles.csv`` lists its obstacles."""

from __future__ import annotations

import base64
import csv
import json
import math
import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import unquote
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from hand_made import FIRST_STAMP_NS, write_stereo_bag

from rover_obstacle_detection.cli.main import main
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.offline.replay import replay_bag
from rover_obstacle_detection.offline.replay_gallery import Gallery
from rover_obstacle_detection.offline.replay_options import ReplayOptions
from rover_obstacle_detection.report.plots import COLOURS, Panel, timeline_plot

pytest.importorskip('jinja2', reason='needs the extra report')
pytest.importorskip('matplotlib', reason='needs the extra report')

PERIOD_NS = 100_000_000
EVIL = 'drive<script>alert(1)</script>'


class Parsed(HTMLParser):
    """Collects the tags, attributes and words of a page."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ''
        self.feed(html)
        self.text = ' '.join(self.text.split())

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attributes)))

    def handle_data(self, data: str) -> None:
        self.text += f'{data} '

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]

    @property
    def frames(self) -> list[str | None]:
        return [each['id'] for each in self.all('div') if each.get('class') == 'frame']


def spoil_one(index: int, side: str, message: Any) -> None:
    if (index, side) == (1, 'right'):
        message.data = message.data[:-100]


@pytest.fixture(scope='module')
def output(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a recording with an evil name and one bad frame of three."""
    folder = tmp_path_factory.mktemp('recorded')
    # A file name cannot have a slash.
    name = EVIL.replace('/', '')
    bag = write_stereo_bag(folder / name, pairs=3, change_image=spoil_one)
    arguments = ['--report', '--set', 'max_step=0.12', '--set', 'camera_pitch=1']
    assert main(['replay', str(bag), '-o', str(folder / 'out'), *arguments]) == 0
    return folder / 'out'


@pytest.fixture(scope='module')
def page(output: Path) -> Parsed:
    return Parsed((output / 'report.html').read_text(encoding='utf-8'))


def test_every_picture_is_embedded_and_decodes(page: Parsed) -> None:
    heads = []
    for image in page.all('img'):
        head, _, data = str(image['src']).partition(';base64,')
        content = base64.b64decode(data, validate=True)
        heads.append(head)
        if head == 'data:image/jpeg':
            assert cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR) is not None
        else:
            assert ElementTree.fromstring(content).tag.endswith('svg')
    assert heads == ['data:image/svg+xml'] + 2 * 3 * ['data:image/jpeg']
    assert page.frames == ['frame-1', 'frame-2']


def test_the_page_opens_offline(output: Path, page: Parsed) -> None:
    html = (output / 'report.html').read_text(encoding='utf-8')
    assert 'http' not in html
    assert 'url(' not in html
    assert not page.all('link')
    assert all('src' not in each for each in page.all('script'))
    assert all(str(each['href']).startswith('#frame-') for each in page.all('a'))
    assert {str(each['href'])[1:] for each in page.all('a')} <= set(page.frames)


def test_names_are_escaped(output: Path, page: Parsed) -> None:
    assert len(page.all('script')) == 1
    html = (output / 'report.html').read_text(encoding='utf-8')
    assert '<script>alert' not in html
    assert 'drive&lt;script&gt;alert(1)&lt;script&gt;' in html
    assert 'Replay of drive<script>alert(1)<script>' in page.text


def test_the_page_says_what_was_replayed(page: Parsed) -> None:
    for words in (
        'command line rover-obstacles replay',
        '--report --set max_step=0.12 --set camera_pitch=1',
        'left images 3, /cam/left/image_rect',
        'calibration /cam/left/camera_info and /cam/right/camera_info',
        'camera 320 x 240 px',
        'first frame 1700000000.000 s (2023-11-14 22:13:20 UTC)',
        'max_step 0.12 0.1',
        'camera_pitch 1.0 ',
        'All 2 frames.',
    ):
        assert words in page.text, words


def test_the_page_says_what_was_bad(page: Parsed) -> None:
    assert '2 frames judged, 1 bad frame skipped' in page.text
    assert '1 message or pair skipped; among them 0 complete pairs' in page.text
    stamp = f'{(FIRST_STAMP_NS + PERIOD_NS) / 1e9:.3f} s'
    assert f'{stamp} 0.10 /cam/right/image_rect: data has' in page.text


def test_the_worst_frames_are_listed(page: Parsed) -> None:
    assert 'Most unknown frame time, s obstacles nearest, m unknown' in page.text
    assert 'Nearest obstacle frame' in page.text


def test_each_obstacle_has_a_row(output: Path) -> None:
    with (output / 'obstacles.csv').open(newline='') as file:
        rows = list(csv.DictReader(file))
    frames = json.loads((output / 'summary.json').read_text())['frames']
    for frame in frames:
        own = [row for row in rows if row['frame'] == str(frame['number'])]
        assert {row['stamp_ns'] for row in own} == {str(frame['stamp_ns'])}
        assert len(own) == frame['obstacles'] >= 1
        nearest = min(float(row['range_m']) for row in own)
        assert nearest == pytest.approx(frame['nearest_obstacle_m'], abs=1e-4)
    first = rows[0]
    assert first['kind'] == 'rock'
    assert 0 < float(first['confidence']) <= 1
    assert int(first['pixels']) <= int(first['box_width_px']) * int(first['box_height_px'])
    assert float(first['minimum_z_m']) <= float(first['maximum_z_m'])


def test_every_column_is_documented(output: Path) -> None:
    documentation = (Path(__file__).parents[2] / 'docs' / 'replay.md').read_text()
    header = (output / 'obstacles.csv').read_text().splitlines()[0]
    for column in header.split(','):
        assert f'`{column}`' in documentation, column


def test_a_later_run_without_report_removes_it(tmp_path: Path) -> None:
    bag = write_stereo_bag(tmp_path / 'drive', pairs=1)
    arguments = ['replay', str(bag), '-o', str(tmp_path / 'out'), '--force']
    assert main([*arguments, '--report']) == 0
    assert (tmp_path / 'out' / 'report.html').is_file()
    assert main(arguments) == 0
    assert not (tmp_path / 'out' / 'report.html').exists()
    assert (tmp_path / 'out' / 'obstacles.csv').is_file()


def test_an_interrupted_replay_says_so_in_its_report(tmp_path: Path) -> None:
    bag = write_stereo_bag(tmp_path / 'drive', pairs=3)
    done: list[int] = []
    options = ReplayOptions(DetectorConfig(), report=True)
    replay_bag(bag, tmp_path / 'out', options, lambda *counts: done.append(1), lambda: bool(done))
    parsed = Parsed((tmp_path / 'out' / 'report.html').read_text(encoding='utf-8'))
    assert 'The replay was interrupted after 1 of about 3 pairs' in parsed.text
    assert parsed.frames == ['frame-1']


def test_bad_frames_and_warnings_are_in_the_timeline() -> None:
    panels = (Panel('obstacles', [1, None, 2]), Panel('nearest, m', [math.nan] * 3))
    plain = timeline_plot([0.0, 1.0, 2.0], panels, [], [], 'seconds')
    marked = timeline_plot([0.0, 1.0, 2.0], panels, [1.0], [1.5, 1.7], 'seconds')
    for colour, count in ((COLOURS[2], 1), (COLOURS[0], 2)):
        assert colour.encode() not in plain
        assert marked.count(b'stroke: ' + colour.encode()) == count * len(panels)
    assert b'<!-- nearest, m -->' in plain


def test_counts_have_whole_ticks_also_if_all_are_zero() -> None:
    for counts, ticks in (([0, 0], [0, 1]), ([1, 2], [0, 1, 2])):
        panel = Panel('obstacles', counts)
        drawn = timeline_plot([10.0, 11.0], [panel], [], [], 'seconds').decode()
        labels = re.findall(
            r'<!-- ([\d.]+) -->', drawn[drawn.index('<g id="matplotlib.axis_2">') :]
        )
        assert labels == [str(each) for each in ticks]


def test_a_missing_library_is_named_before_any_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, 'jinja2', None)
    arguments = ['replay', str(tmp_path / 'missing.mcap'), '-o', str(tmp_path / 'out')]
    assert main([*arguments, '--report']) == 1
    error = capsys.readouterr().err
    assert 'reports need jinja2' in error
    assert 'pip install jinja2 matplotlib' in error
    assert error.count('\n') == 1
    assert list(tmp_path.iterdir()) == []


def frame(number: int, unknown: float = 0.2, nearest_m: float = 3.0, warnings: int = 0) -> Any:
    figures = SimpleNamespace(unknown_share=unknown, nearest_obstacle_m=nearest_m)
    return SimpleNamespace(number=number, summary=figures, warnings=('doubtful',) * warnings)


def test_of_many_frames_the_worst_and_evenly_chosen_ones_are_kept() -> None:
    gallery = Gallery(evenly=8, worst=2)
    for number in range(1, 101):
        each = frame(number, unknown=0.9 if number in (30, 31) else 0.2)
        if number == 60:
            each = frame(number, nearest_m=0.5, warnings=1)
        gallery.offer(each, tuple)
    assert gallery.worst('most unknown') == [30, 31]
    assert gallery.worst('nearest obstacle') == [60, 1]
    assert gallery.worst('most warnings') == [60]
    assert sorted(gallery.pictures) == [1, 17, 30, 31, 33, 49, 60, 65, 81, 97]


def test_a_frame_that_cannot_be_drawn_is_not_kept() -> None:
    gallery = Gallery()

    def fail() -> Any:
        raise cv2.error('no more')

    with pytest.raises(cv2.error):
        gallery.offer(frame(1, unknown=0.9), fail)
    assert gallery.worst('most unknown') == []
    gallery.offer(frame(1), tuple)
    assert list(gallery.pictures) == [1]


def test_the_combined_report_leads_to_that_of_each_recording(tmp_path, capsys) -> None:
    bags = [tmp_path / 'b 1', tmp_path / EVIL.replace('/', '')]
    for number, bag in enumerate(bags, start=1):
        write_stereo_bag(bag, number)
    output = tmp_path / 'out'
    assert main(['replay', *map(str, bags), '--report', '-o', str(output)]) == 0
    assert f'report of all: {output / "report.html"}' in capsys.readouterr().out
    page = Parsed((output / 'report.html').read_text())
    links = [each['href'] for each in page.all('a')]
    assert [(output / unquote(link)).is_file() for link in links] == [True, True]
    assert 'Replay of 2 recordings 3 frames judged, 0 bad frames skipped.' in page.text
    assert 'b 1 1 0 0 ' in page.text
    assert not page.all('script')
    assert len(page.all('img')) == 2


def test_a_single_recording_has_no_combined_report(tmp_path) -> None:
    write_stereo_bag(tmp_path / 'b', 1)
    assert main(['replay', str(tmp_path / 'b'), '--report', '-o', str(tmp_path / 'out')]) == 0
    assert [path.name for path in (tmp_path / 'out').rglob('report.html')] == ['report.html']
