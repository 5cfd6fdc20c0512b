"""Print how many points of the obstacle cloud are not where the obstacle is.

    python scripts/study_clouds.py bags/*

Each figure is given for all obstacle pixels with 3D, and for the cloud that is published: points;
points whose depth is wrong by more than 0.2 m and 5 %; cells of a costmap, 0.05 m wide, that the
points within 4 m make lethal; those of them without an obstacle within 0.15 m. The bags need
/truth/labels and /truth/depth.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from studies.cloud_study import cloud_table
from studies.scene_studies import study_clouds

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.errors import ObstacleDetectionError


def main() -> None:
    """Study each bag and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('bags', nargs='+', type=Path, metavar='BAG')
    try:
        scenes = [study_clouds(bag, DetectorConfig()) for bag in parser.parse_args().bags]
    except ObstacleDetectionError as error:
        sys.exit(str(error))
    print(cloud_table(scenes).as_markdown(), end='')


if __name__ == '__main__':
    main()
