from __future__ import annotations

from pathlib import Path
from typing import get_args

import numpy as np
from hand_made import small_detection

from rover_obstacle_detection.detection.result.cue import KIND_NUMBERS, Cue, Kind

ROOT = Path(__file__).resolve().parents[3]


def test_numbers_of_kinds_are_those_that_users_rely_on():
    assert KIND_NUMBERS == {'rock': 1, 'slope': 2, 'drop': 3, 'rough': 4, 'unmeasured': 5}
    assert set(KIND_NUMBERS) == set(get_args(Kind))
    documentation = (ROOT / 'docs' / 'replay.md').read_text()
    for kind, number in KIND_NUMBERS.items():
        assert f'| `{kind}` | {number} |' in documentation


def test_points_have_the_kinds_of_their_pixels():
    plain = small_detection()
    cues = np.where(plain.mask > 0, np.uint8(Cue.SLOPE), np.uint8(0))
    cues[40:44, 30:44] = Cue.DROP
    seen = small_detection(cues=cues)
    (obstacle,) = seen.obstacles
    assert obstacle.kind == 'slope'
    assert np.count_nonzero(seen.kinds) == 12 * 14
    np.testing.assert_array_equal(seen.kinds[40:44, 30:44], 3)
    # Row by row, and every pixel has a point.
    assert seen.obstacle_point_kinds.tolist() == [2] * 8 * 14 + [3] * 4 * 14
    assert len(seen.obstacle_points) == 12 * 14


def test_without_obstacles_there_are_no_kinds():
    free = small_detection(mask=np.zeros((48, 64), np.uint8), cues=np.zeros((48, 64), np.uint8))
    assert not free.kinds.any()
    assert free.obstacle_point_kinds.shape == (0,)
    assert free.obstacle_point_kinds.dtype == np.uint8
