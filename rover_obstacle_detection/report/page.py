"""A page of sections with text, tables and pictures, and its rendering."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources

from rover_obstacle_detection.report.extra import report_library


@dataclass(frozen=True)
class TableBlock:
    """A table; the first column is left-aligned, the others right."""

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    kind: str = 'table'


@dataclass(frozen=True)
class PictureBlock:
    """A picture.

    Parameters
    ----------
    caption : str
    data : bytes
        The file.
    mime : str
        Its type: ``image/jpeg``, ``image/png``, ``image/svg+xml``.
    is_wide : bool
        Whether it takes the page's width instead of sharing a row.
    """

    caption: str
    data: bytes
    mime: str
    is_wide: bool = False
    kind: str = 'picture'

    @property
    def url(self) -> str:
        """The picture itself as a data URL."""
        return f'data:{self.mime};base64,{base64.b64encode(self.data).decode("ascii")}'


@dataclass(frozen=True)
class TextBlock:
    """A paragraph of plain text."""

    text: str
    kind: str = 'text'


Block = TableBlock | PictureBlock | TextBlock


@dataclass(frozen=True)
class Section:
    """A headed part of the page.

    Parameters
    ----------
    title : str
    blocks : sequence of Block
    is_folded : bool
        Whether it opens on a click only.
    """

    title: str
    blocks: Sequence[Block]
    is_folded: bool = False


@dataclass(frozen=True)
class Page:
    """A page: a title, what it is about, sections, and a line at the foot."""

    title: str
    lead: Sequence[str]
    sections: Sequence[Section]
    foot: str = ''


def render_page(page: Page) -> str:
    """Turn a page into HTML that needs no other file.

    Raises
    ------
    MissingExtraError
        If Jinja2 is not installed.
    """
    jinja2 = report_library('jinja2')
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    template = resources.files(__package__).joinpath('page.html.j2').read_text(encoding='utf-8')
    return str(environment.from_string(template).render(page=page))
