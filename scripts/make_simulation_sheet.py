"""Render the picture of docs/simulation.md: the left image of every condition.

    python scripts/make_simulation_sheet.py docs/images/simulation.jpg

Needs the extra ``sim``.
"""

from __future__ import annotations

import argparse
import itertools
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.simulation.frames import render
from rover_obstacle_detection.simulation.presets import PRESETS, scene_of
from rover_obstacle_detection.simulation.rigs import RIGS

WIDTH, HEIGHT = 320, 240
COLUMNS = 7
SEED = 401
# The far-looking rigs cannot see beyond these edges.
RIG_OF_CONDITION = dict.fromkeys(
    ('slope_down_26', 'ledge_down', 'cliff', 'stairs_down', 'gully', 'canyon_rim'), 'study'
)


def tile(condition: str, rig: str) -> NDArray[np.uint8]:
    """Render one condition, captioned with its name."""
    scene = scene_of(condition, SEED, [condition], rig, {'width': WIDTH})
    left = next(render(scene)).left
    picture = cv2.cvtColor(left, cv2.COLOR_RGB2BGR if left.ndim == 3 else cv2.COLOR_GRAY2BGR)
    cv2.rectangle(picture, (0, HEIGHT - 20), (WIDTH, HEIGHT), (0, 0, 0), cv2.FILLED)
    cv2.putText(
        picture,
        f'{condition} ({rig})',
        (6, HEIGHT - 6),
        cv2.FONT_HERSHEY_SIMPLEX,
        0.42,
        (255, 255, 255),
        1,
        cv2.LINE_AA,
    )
    return np.asarray(picture, np.uint8)


def main() -> None:
    """Render all conditions, cycling through the rigs, and write the picture."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('output', type=Path)
    output = parser.parse_args().output
    tiles = []
    for condition, rig in zip(PRESETS, itertools.cycle(RIGS), strict=False):
        tiles.append(tile(condition, RIG_OF_CONDITION.get(condition, rig)))
        print(condition, flush=True)
    while len(tiles) % COLUMNS:
        tiles.append(np.full((HEIGHT, WIDTH, 3), 255, np.uint8))
    rows = [np.hstack(tiles[i : i + COLUMNS]) for i in range(0, len(tiles), COLUMNS)]
    cv2.imwrite(str(output), np.vstack(rows), [cv2.IMWRITE_JPEG_QUALITY, 82])


if __name__ == '__main__':
    main()
