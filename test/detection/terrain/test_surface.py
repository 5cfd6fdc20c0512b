"""Heights over the ground plane in the image, and the places that pixels show."""

from __future__ import annotations

import numpy as np
from relief import PARAMETERS, PosedCamera, flat, surface_of
from synthetic import pinhole

from rover_obstacle_detection.detection.terrain.surface import Surface


def test_the_nearest_matches_below_and_above_gaps():
    nothing = np.nan
    surface = surface_of(np.transpose([
        [1, 2, 3, 4, 5],
        [nothing, 2, nothing, nothing, 5],
        [1, nothing, 3, 4, nothing],
        [nothing] * 5,
    ]))  # fmt: skip
    below, above = surface.nearest()
    assert below.rows.T.tolist() == [[0, 1, 2, 3, 4], [1, 1, 4, 4, 4], [0, 2, 2, 3, 4], [4] * 5]
    assert above.rows.T.tolist() == [[0, 1, 2, 3, 4], [0, 1, 1, 1, 4], [0, 0, 2, 3, 3], [0] * 5]
    for found in (below, above):
        expected = np.take_along_axis(surface.height_m, found.rows, axis=0)
        np.testing.assert_array_equal(found.height_m, expected)


def test_rows_to_a_metre_follow_the_distance_along_the_ground():
    # As many rows as in real images.
    posed = PosedCamera(pinhole(44, 320, 60.0, 0.15), pitch_deg=30.0, height_m=1.2)
    disparity, _, y = posed.look(flat)
    surface = Surface(posed.stereo(disparity), PARAMETERS)
    # Near the middle of the image.
    rows, columns = np.arange(120, 200), np.full(80, 22)
    points = surface.points(rows, columns)
    along_m = y[119:201, 22]
    expected = 2 / (along_m[:-2] - along_m[2:])
    np.testing.assert_allclose(surface.rows_per_metre(points), expected, rtol=0.05)
    np.testing.assert_allclose(points.sight, posed.height_m / along_m[1:-1], rtol=0.01)
