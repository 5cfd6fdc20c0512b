"""What a region may add to a rock where nothing was matched."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from hand_made import CAMERA

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.hybrid import Segments, complete_by_regions
from rover_obstacle_detection.detection.regions.regions import nearest_known
from rover_obstacle_detection.detection.rocks.rocks import Rocks


def near_rock(probability):
    """A row of one region, of which only the first pixel is matched, on a rock."""
    row = np.zeros((1, len(probability)), bool)
    high, disparity = row.copy(), row.astype(np.float32)
    high[0, 0], disparity[0, 0] = True, 5
    rocks = Rocks(high, row, np.array([probability], np.float32))
    nearest = nearest_known(disparity > 0, np.full(row.shape, 100, np.float32))
    segments = Segments(np.ones(row.shape, np.int32), np.array([False, True]))
    stereo = SimpleNamespace(
        disparity=disparity, expected=disparity, pair=(np.full(row.shape, 90, np.uint8),) * 2
    )
    near, dark = complete_by_regions(rocks, nearest, segments, stereo, CAMERA, DetectorConfig())
    assert not dark.any()
    return near[0].tolist()


def test_a_rock_goes_on_over_its_region_where_the_filter_was_not_asked():
    assert near_rock([0.9, np.nan, np.nan]) == [False, True, True]


def test_not_where_the_filter_holds_it_for_ground():
    assert near_rock([0.9, 0.1, np.nan, 0.45, 0.02]) == [False, False, True, True, False]
