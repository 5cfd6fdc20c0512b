"""Run the command line with ``python -m rover_obstacle_detection``."""

import sys

from rover_obstacle_detection.cli.main import main

if __name__ == '__main__':
    sys.exit(main())
