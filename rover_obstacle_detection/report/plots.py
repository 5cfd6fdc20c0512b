"""Draw plots as SVG, without a display and without global matplotlib state."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from rover_obstacle_detection.report.extra import report_library

COLOURS = (
    '#d1495b',
    '#2e4057',
    '#edae49',
    '#00798c',
    '#8d6a9f',
    '#6a994e',
    '#8c5e3c',
    '#7a7f87',
)
WIDTH_INCHES = 5.6
HEIGHT_INCHES = 3.7
# More markers would merge into a band.
_MARKED_VALUES = 300
_STYLE = {
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.grid': True,
    'axes.axisbelow': True,
    'grid.color': '#e3e6ea',
    'font.size': 10,
    'legend.frameon': False,
    # Makes the identifiers in the file reproducible.
    'svg.hashsalt': 'rover',
}


@dataclass(frozen=True)
class Line:
    """A line of a plot; points whose x or y is None are omitted.

    Parameters
    ----------
    label : str
    x, y : sequence of float or None
    colour : int
        Index of the colour, the same for a method in every plot. Colour 0 is drawn bold.
    marked : int, optional
        Index of a point to draw large.
    """

    label: str
    x: Sequence[float | None]
    y: Sequence[float | None]
    colour: int = 0
    marked: int | None = None


def line_plot(
    lines: Sequence[Line],
    x_label: str,
    y_label: str,
    *,
    x_names: Sequence[str] = (),
    y_limits: tuple[float, float] | None = None,
) -> bytes:
    """Draw lines with markers as SVG.

    Parameters
    ----------
    lines : sequence of Line
    x_label, y_label : str
    x_names : sequence of str
        Tick labels of x = 0, 1, 2 ..., for a categorical axis.
    y_limits : tuple of float, optional

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    """

    def paint(axes: Any) -> None:
        for line in lines:
            _draw_line(axes, line)
        if x_names:
            axes.set_xticks(range(len(x_names)), x_names, rotation=35, ha='right')
        if y_limits:
            axes.set_ylim(*y_limits)
        axes.figure.legend(loc='outside lower center', ncols=4, fontsize=8)

    return _draw(x_label, y_label, paint)


def distribution_plot(
    edges: Sequence[float],
    shares: Sequence[tuple[str, Sequence[float]]],
    threshold: float,
    x_label: str,
) -> bytes:
    """Draw histograms on a logarithmic axis and a threshold, as SVG.

    Parameters
    ----------
    edges : sequence of float
        Bin edges, all positive.
    shares : sequence of (str, sequence of float)
        Label, and share of each bin.
    threshold : float
        Drawn as a dashed line.
    x_label : str

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    """

    def paint(axes: Any) -> None:
        for index, (label, values) in enumerate(shares):
            colour = COLOURS[(index + 1) % 2]
            axes.stairs(values, edges, fill=True, alpha=0.45, color=colour, label=label)
        axes.axvline(threshold, color='black', linestyle='--', linewidth=1)
        axes.set_xscale('log')
        axes.legend(fontsize=8)

    return _draw(x_label, 'share of pixels', paint)


def bar_plot(names: Sequence[str], values: Sequence[float], x_label: str) -> bytes:
    """Draw horizontal bars with their values as SVG; logarithmic if they differ tenfold.

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    """

    def paint(axes: Any) -> None:
        places = range(len(names))
        colours = [COLOURS[index % len(COLOURS)] for index in places]
        bars = axes.barh(places, values, color=colours)
        axes.bar_label(bars, [f' {value:.2g}' for value in values], fontsize=9)
        axes.set_yticks(places, names)
        axes.invert_yaxis()
        if max(values) > 10 * min(values):
            axes.set_xscale('log')
        axes.axvline(1.0, color='black', linestyle='--', linewidth=1)
        axes.margins(x=0.15)
        axes.grid(visible=False, axis='y')

    return _draw(x_label, '', paint, height_inches=0.9 + 0.32 * len(names))


@dataclass(frozen=True)
class Panel:
    """One quantity of a timeline; None where it has no value."""

    label: str
    y: Sequence[float | None]


def timeline_plot(
    x: Sequence[float],
    panels: Sequence[Panel],
    warned: Sequence[float],
    bad: Sequence[float],
    x_label: str,
) -> bytes:
    """Draw quantities over one time axis as SVG, one below the other.

    Parameters
    ----------
    x : sequence of float
        Time of each value.
    panels : sequence of Panel
    warned, bad : sequence of float
        Times of the frames with warnings, marked orange, and of bad frames, marked red.
    x_label : str

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    """
    matplotlib = report_library('matplotlib')
    figure_module = report_library('matplotlib.figure')
    marker = '.' if len(x) <= _MARKED_VALUES else ''
    with matplotlib.rc_context(_STYLE):
        size = (2 * WIDTH_INCHES, 1.3 * len(panels) + 0.8)
        figure = figure_module.Figure(figsize=size, layout='constrained')
        all_axes = figure.subplots(len(panels), sharex=True, squeeze=False)[:, 0]
        for axes, panel in zip(all_axes, panels, strict=True):
            values = [math.nan if value is None else value for value in panel.y]
            axes.plot(x, values, color=COLOURS[1], linewidth=1.2, marker=marker)
            axes.set_ylabel(panel.label)
            axes.set_ylim(0, 1.1 * max(filter(math.isfinite, values), default=0) or 1)
            axes.locator_params('y', nbins=4, integer=all(map(_is_whole, values)))
            for times, colour in ((warned, COLOURS[2]), (bad, COLOURS[0])):
                axes.vlines(
                    times,
                    0,
                    1,
                    transform=axes.get_xaxis_transform(),
                    color=colour,
                    linewidth=1,
                    alpha=0.6,
                    zorder=1,
                )
        all_axes[-1].set_xlabel(x_label)
        return _svg(figure)


def _is_whole(value: float) -> bool:
    return not math.isfinite(value) or value == int(value)


def _draw_line(axes: Any, line: Line) -> None:
    colour = COLOURS[line.colour % len(COLOURS)]
    known = [(x, y) for x, y in zip(line.x, line.y, strict=True) if None not in (x, y)]
    axes.plot(
        [x for x, _ in known],
        [y for _, y in known],
        color=colour,
        label=line.label,
        marker='o',
        markersize=3,
        linewidth=1.2 if line.colour else 2.2,
        alpha=0.8 if line.colour else 1.0,
        zorder=2 if line.colour else 3,
    )
    if line.marked is not None:
        x, y = line.x[line.marked], line.y[line.marked]
        if x is not None and y is not None:
            axes.plot(x, y, 'o', color=colour, markersize=8)


def _draw(
    x_label: str,
    y_label: str,
    paint: Callable[[Any], None],
    height_inches: float = HEIGHT_INCHES,
) -> bytes:
    matplotlib = report_library('matplotlib')
    figure_module = report_library('matplotlib.figure')
    with matplotlib.rc_context(_STYLE):
        figure = figure_module.Figure(figsize=(WIDTH_INCHES, height_inches), layout='constrained')
        axes = figure.subplots()
        axes.set_xlabel(x_label)
        axes.set_ylabel(y_label)
        paint(axes)
        return _svg(figure)


def _svg(figure: Any) -> bytes:
    file = io.BytesIO()
    figure.savefig(file, format='svg', metadata={'Date': None})
    return file.getvalue()
