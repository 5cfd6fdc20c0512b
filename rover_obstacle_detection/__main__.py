"""Run the command line with ``python -m rover_obstacle_detection``."""

import sys

from rover_obstacle_detection.program import rover_obstacles

if __name__ == '__main__':
    sys.exit(rover_obstacles())
