"""Render pages with sections of text, tables and pictures as HTML."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

from rover_obstacle_detection.report.extra import report_library


@dataclass(frozen=True)
class TableBlock:
    """A table; the first column is left-aligned, the others right.

    Parameters
    ----------
    caption : str
    header : sequence of str
    rows : sequence of sequence of str
    kind : str
    links : sequence of str
        Where the first cell of each row leads; none by default.
    """

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    kind: str = 'table'
    links: Sequence[str] = ()


@dataclass(frozen=True)
class PictureBlock:
    """A picture.

    Parameters
    ----------
    caption : str
    data : bytes
        Content of the image file.
    mime : str
        MIME type, for example ``image/jpeg`` or ``image/svg+xml``.
    """

    caption: str
    data: bytes
    mime: str
    kind: str = 'picture'

    @property
    def url(self) -> str:
        """The picture as a data URL."""
        return f'data:{self.mime};base64,{base64.b64encode(self.data).decode("ascii")}'


@dataclass(frozen=True)
class TextBlock:
    """A paragraph of plain text."""

    text: str
    kind: str = 'text'


Block = TableBlock | PictureBlock | TextBlock


@dataclass(frozen=True)
class Section:
    """A section of the page.

    Parameters
    ----------
    title : str
    blocks : sequence of Block
    is_folded : bool
        Whether it is collapsed until clicked.
    """

    title: str
    blocks: Sequence[Block]
    is_folded: bool = False


@dataclass(frozen=True)
class Page:
    """A page with a title, introductory paragraphs, sections and a footer."""

    title: str
    lead: Sequence[str]
    sections: Sequence[Section]
    foot: str = ''


def render_page(page: Page, template: str = 'page.html.j2', **values: Any) -> str:
    """Render a page as HTML without external files.

    Parameters
    ----------
    page : Page
    template : str
        A template of this package that extends ``page.html.j2``.
    **values
        What it needs besides the page.

    Raises
    ------
    MissingExtraError
        If Jinja2 is not installed.
    """
    jinja2 = report_library('jinja2')
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(_template),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    return str(environment.get_template(template).render(page=page, **values))


def _template(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding='utf-8')
