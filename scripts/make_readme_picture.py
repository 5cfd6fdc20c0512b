"""Draw the README's picture: what the detector finds in a bag's first stereo pair.

python scripts/make_readme_picture.py docs/images/overlay.png
python scripts/make_readme_picture.py new.png --compare docs/images/overlay.png
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.bags.stereo import read_pairs
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.offline.picture_files import write_pictures

# In colour, with rocks both taller and lower than the clearance.
BAG = Path(__file__).resolve().parents[1] / 'bags' / 'simulated_study_noon'
# Red over the larger of green and blue, grey levels: the soil has up to 53, tinted rocks over 80.
_MIN_REDNESS = 60
# OpenCV 4.6 and 5 agree to 0.97, mostly for the labels; the smallest rock is 0.03 of the red.
_MIN_AGREEMENT = 0.95


def draw(bag_path: Path, output: Path) -> Detection:
    """Detect obstacles in a bag's first stereo pair and write the overlay with its key.

    Parameters
    ----------
    bag_path : Path
    output : Path
        PNG file; replaced if it exists.
    """
    with open_bag(bag_path) as bag:
        pair = next(read_pairs(bag, bag.stereo_topics()))
    detection = Detector(pair.camera).detect(pair.left, pair.right)
    with tempfile.TemporaryDirectory(dir=output.parent) as folder:
        write_pictures(detection, pair.left, Path(folder))
        (Path(folder) / 'overlay.png').replace(output)
    return detection


def agreement(one: Path, other: Path) -> float:
    """Share of the pixels, red in either picture, that are red in both.

    The texts are left out of it: their font differs between versions of OpenCV.
    """
    first, second = (_is_red(path) for path in (one, other))
    if first.shape != second.shape:
        return 0.0
    return np.count_nonzero(first & second) / max(np.count_nonzero(first | second), 1)


def _is_red(path: Path) -> np.ndarray:
    picture = cv2.imread(str(path))
    if picture is None:
        raise SystemExit(f'{path}: not a picture')
    blue, green, red = cv2.split(picture.astype(int))
    return red - np.maximum(blue, green) > _MIN_REDNESS


def main() -> int:
    """Write the picture; return 1 if it shows other obstacles than the one to compare with."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('output', type=Path)
    parser.add_argument(
        '--compare', metavar='PNG', type=Path, help='fail if this picture is out of date'
    )
    arguments = parser.parse_args()
    draw(BAG, arguments.output)
    if arguments.compare is None:
        return 0
    found = agreement(arguments.compare, arguments.output)
    if found >= _MIN_AGREEMENT:
        return 0
    print(
        f'{arguments.compare} is out of date: it agrees in {found:.0%} of the red with what the '
        f'detector finds, expected at least {_MIN_AGREEMENT:.0%}; run '
        f'python scripts/make_readme_picture.py {arguments.compare}',
        file=sys.stderr,
    )
    return 1


if __name__ == '__main__':
    sys.exit(main())
