"""``python -m rover_obstacle_detection``: the command line."""

import sys

from rover_obstacle_detection.cli.main import main

if __name__ == '__main__':
    sys.exit(main())
