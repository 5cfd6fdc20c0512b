"""Pages are self-contained and plots are well-formed."""

from __future__ import annotations

import base64
import re
import sys
from html.parser import HTMLParser
from xml.etree import ElementTree

import pytest

from rover_obstacle_detection.errors import MissingExtraError
from rover_obstacle_detection.report.extra import require_report_libraries
from rover_obstacle_detection.report.page import (
    Page,
    PictureBlock,
    Section,
    TableBlock,
    TextBlock,
    render_page,
)
from rover_obstacle_detection.report.plots import Line, bar_plot, distribution_plot, line_plot

pytest.importorskip('jinja2', reason='needs the extra report')
pytest.importorskip('matplotlib', reason='needs the extra report')

PICTURE = PictureBlock('a rock', b'\xff\xd8 picture', 'image/jpeg')


class Parsed(HTMLParser):
    """Collects the URLs, tags and words of a page."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.urls: list[str] = []
        self.tags: list[str] = []
        self.words: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.urls += [value for name, value in attributes if name in ('src', 'href')]

    def handle_data(self, data):
        self.words += data.split()


def page(*blocks, **options) -> str:
    return render_page(Page('Title', ('lead',), (Section('Part', blocks, **options),), 'foot'))


def test_pictures_are_embedded() -> None:
    (url,) = Parsed(page(PICTURE)).urls
    assert base64.b64decode(url.removeprefix('data:image/jpeg;base64,')) == PICTURE.data


def test_a_page_has_no_external_references() -> None:
    html = page(PICTURE, TextBlock('text'))
    assert 'http' not in html
    assert 'url(' not in html
    assert '<script' not in html


def test_table_cells_are_in_order() -> None:
    parsed = Parsed(page(TableBlock('Figures', ('method', 'IoU'), (('hybrid', '0.9'),))))
    assert ' '.join(parsed.words).find('Figures method IoU hybrid 0.9') >= 0
    assert parsed.tags.count('td') == 2


def test_text_is_escaped() -> None:
    html = page(TextBlock('<b>&'), TableBlock('<i>', ('<u>',), (('<s>',),)))
    assert not {'b', 'i', 'u', 's'} & set(Parsed(html).tags)
    assert '&lt;b&gt;&amp;' in html


def test_a_folded_section_is_a_details_element() -> None:
    assert 'details' in Parsed(page(TextBlock('x'), is_folded=True)).tags
    assert 'details' not in Parsed(page(TextBlock('x'))).tags


def words(svg: bytes) -> str:
    assert ElementTree.fromstring(svg).tag.endswith('svg')
    return ' '.join(re.findall(r'<!-- (.*?) -->', svg.decode()))


def test_a_line_plot_labels_lines_and_axes() -> None:
    lines = [
        Line('hybrid', [0.1, 0.5, None], [0.9, None, 0.3], marked=0),
        Line('study', [0.2, 0.4], [0.5, 0.6], colour=9, marked=1),
    ]
    said = words(line_plot(lines, 'recall', 'precision', y_limits=(0, 1)))
    assert all(name in said for name in ('hybrid', 'study', 'recall', 'precision'))


def test_plots_are_reproducible() -> None:
    lines = [Line('a', [0.0, 1.0], [1.0, 0.0])]
    names = ('near', 'far')
    first, second = (line_plot(lines, 'x', 'y', x_names=names) for _ in range(2))
    assert first == second
    assert 'near' in words(first)


def test_bar_and_distribution_plots_have_labels() -> None:
    assert 'study' in words(bar_plot(['hybrid', 'study'], [1.2, 30.0], 'time'))
    shares = [('free ground', [0.5, 0.5]), ('obstacles', [0.1, 0.9])]
    said = words(distribution_plot([0.001, 0.01, 0.1], shares, 0.005, 'step (m)'))
    assert 'obstacles' in said


def test_an_error_about_a_missing_library_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'jinja2', None)
    with pytest.raises(MissingExtraError, match=r'jinja2.*pip install jinja2 matplotlib'):
        page()
    with pytest.raises(MissingExtraError, match='jinja2'):
        require_report_libraries()
