"""Draw the README's picture: what the detector finds in a bag's first stereo pair.

python scripts/make_readme_picture.py docs/images/overlay.png
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.bags.stereo import read_pairs
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.offline.picture_files import write_pictures

# In colour, with rocks both taller and lower than the clearance.
BAG = Path(__file__).resolve().parents[1] / 'bags' / 'simulated_study_noon'


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


def main() -> None:
    """Parse the command line and write the picture."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('output', type=Path)
    draw(BAG, parser.parse_args().output)


if __name__ == '__main__':
    main()
