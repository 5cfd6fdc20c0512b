"""How the time grows with the pixels and with the number of rocks."""

from __future__ import annotations

import math
from collections.abc import Sequence

import synthetic
from benchmark_scenes import STANDARD, Scene, resized, standard_scenes
from detection_times import PairTimes, measured
from effort import DEFAULT, Effort, Size
from findings import Findings, Line, at_most

from rover_obstacle_detection.bags.stereo import StereoPair
from rover_obstacle_detection.evaluation.tables import Table

# Linear is 1; a little more for what the caches hold of small images.
MOST_POWER = 1.1
MOST_GROWTH_WITH_ROCKS = 1.25
# Seven rocks in each of four rows, on all of the ground before the camera.
COLUMNS_M = (-0.9, -0.6, -0.3, 0.0, 0.3, 0.6, 0.9)
ROWS_M = (0.7, 1.2, 1.7, 2.2)
ROCK_M = (0.12, 0.12, 0.2)


def growth_findings(scenes: Sequence[Scene], effort: Effort) -> Findings:
    """Measure one pair at all sizes, and a camera before one rock and before many."""
    scene = standard_scenes(scenes)[0]
    times = {
        size: measured(resized(scene.pair, *size), DEFAULT, effort.turns) for size in effort.sizes
    }
    lines = (power_line(times, scene.name), rocks_line(effort.turns))
    return Findings(lines, {'sizes': size_table(times)})


def power_line(times: dict[Size, PairTimes], name: str) -> Line:
    """Line of the power of the number of pixels with which the time grows."""
    smallest, largest = min(times), max(times)
    pixels = math.prod(largest) / math.prod(smallest)
    power = math.log(times[largest].seconds / times[smallest].seconds) / math.log(pixels)
    sizes = f'{smallest[0]} x {smallest[1]} to {largest[0]} x {largest[1]}'
    what = f'time grows with the number of pixels to the power of ({name}, {sizes})'
    return at_most(what, power, MOST_POWER, '{:.2f}')


def size_table(times: dict[Size, PairTimes]) -> Table:
    """Tabulate the time by image size."""
    rows = [
        (
            f'{width} x {height}',
            f'{each.ratio:.2f}',
            f'{1000 * each.seconds:.0f}',
            f'{1000 * each.plain_seconds:.1f}',
            f'{1e9 * each.seconds / (width * height):.0f}',
        )
        for (width, height), each in times.items()
    ]
    header = ('image', 'x SGBM of that image', 'ms', 'SGBM, ms', 'ns per pixel')
    return Table('Sizes', header, rows)


def rocks_line(turns: int) -> Line:
    """Compare a view of one rock with a view of many by the same camera."""
    places = [(x, y) for y in ROWS_M for x in COLUMNS_M]
    few, many = (rock_view(each) for each in ([(0.0, 1.2)], places))
    seconds = [measured(each, DEFAULT, turns).seconds for each in (few, many)]
    growth = seconds[1] / seconds[0]
    return Line(
        f'time with {len(places)} rocks relative to one rock, ray-cast boxes, same camera',
        f'{growth:.2f} x ({1000 * seconds[0]:.0f} and {1000 * seconds[1]:.0f} ms)',
        f'at most {MOST_GROWTH_WITH_ROCKS:g} x',
        growth <= MOST_GROWTH_WITH_ROCKS,
    )


def rock_view(places: Sequence[tuple[float, float]]) -> StereoPair:
    """Ray-cast boxes on level ground from the study's mast, at 1024 x 768."""
    rocks = tuple(synthetic.Box(x, y, *ROCK_M) for x, y in places)
    view = synthetic.render(synthetic.mast(*STANDARD, solids=rocks))
    return StereoPair(0, '', view.left, view.right, left_header=None, camera=view.scene.camera)
