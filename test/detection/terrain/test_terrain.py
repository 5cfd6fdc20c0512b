from __future__ import annotations

from dataclasses import replace

import numpy as np
from relief import PosedCamera, block

from rover_obstacle_detection.detection.terrain.elevation_map import MapPositions
from rover_obstacle_detection.detection.terrain.terrain import Terrain


def test_window_has_its_own_pixels():
    terrain, *_ = PosedCamera(pitch_deg=20.0).survey(block(0.0, 2.0, 0.4, 0.3))
    window = np.s_[2:120, 50:140]
    found = terrain.within(window)
    for name in ('height_m', 'noise_m', 'camera_m', 'pixels_per_metre', 'measured'):
        np.testing.assert_array_equal(getattr(found, name), getattr(terrain, name)[window])
    assert 0 < found.measured.mean() < 1
    assert found.layers == ()


def terrain_of(measured):
    height_m = np.where(measured, 0, np.nan).astype(np.float32)
    even = np.ones_like(height_m)
    return Terrain(height_m, even, even, even, ())


def test_nearest_measured_pixels_and_their_distances():
    measured = np.array([[True, False, False, False, False, True], [False] * 6])
    pixels, sources, distance_px = terrain_of(measured).nearest_measured
    assert pixels.tolist() == [1, 2, 3, 4, 6, 7, 8, 9, 10, 11]
    assert sources.tolist() == [0, 0, 5, 5, 0, 0, 0, 5, 5, 5]
    np.testing.assert_allclose(
        distance_px, [1, 2, 2, 1, 1, 2**0.5, 5**0.5, 5**0.5, 2**0.5, 1], atol=0.05
    )


def test_without_measured_pixels_there_is_no_nearest():
    for measured in (np.zeros((2, 3), bool), np.ones((2, 3), bool)):
        for found in terrain_of(measured).nearest_measured:
            assert not found.size


def test_each_pixel_takes_its_height_from_the_layer_of_its_distance():
    terrain, *_ = PosedCamera(pitch_deg=20.0).survey(block(0.0, 2.0, 0.4, 0.3))
    number = np.zeros(terrain.height_m.shape, np.float32)
    for layer in terrain.layers:
        rows = layer.pixels[layer.own_rows]
        assert rows[0].any()
        assert rows[-1].any()
        assert rows.sum() == layer.pixels.sum()
        ones = np.ones_like(layer.ground_m)
        layer.fill(number, number[layer.rows][layer.own_rows] + layer.sampled(ones))
    np.testing.assert_array_equal(number, terrain.measured)


def test_cells_that_show_half_or_more_of_something_else_are_left_out():
    terrain, *_ = PosedCamera().survey(block(0.0, 2.0, 0.4, 0.3))
    # Cells with 3, 3 and 2 pixels, one cell that is empty, and a pixel without 3D.
    columns = np.array([[0, 0, 0, 1, 1, 1, 2, 2, -10]], np.float32)
    layer = replace(
        terrain.layers[0],
        rows=slice(1, 2),
        positions=MapPositions(columns, np.minimum(columns, 0), (1, 4), 0.04),
        seen=np.array([[True, True, True, False]]),
    )
    excluded = np.zeros((3, 9), bool)
    excluded[[0, 2]] = True
    assert layer.without(excluded) is layer
    excluded[1, [0, 1, 3, 6, 8]] = True
    assert layer.without(excluded).seen.tolist() == [[False, True, False, False]]
