from __future__ import annotations

import math

import numpy as np
import pytest
from relief import Eye, bank, block, flat, tilted, together
from synthetic import pinhole

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.geometry.reprojection import reproject
from rover_obstacle_detection.detection.terrain.survey import MAX_LAYERS, layer_spans, survey

EYE = Eye()


def waves(wavelength_m, amplitude_m):
    turn = 2 * np.pi / wavelength_m
    return lambda x, y: amplitude_m * np.sin(turn * x) * np.sin(turn * y + 1)


def on_block(x, y, size_m, at_x, at_y):
    """Well within the block, so that no edge is near."""
    return np.maximum(abs(at_x - x), abs(at_y - y)) < 0.4 * size_m


@pytest.mark.parametrize('height', [0.12, 0.3])
@pytest.mark.parametrize(('distance', 'size'), [(1.5, 0.3), (2.5, 0.4), (4.0, 0.5), (6.0, 0.6)])
def test_block_is_as_high_above_the_ground_near_and_far(distance, size, height):
    terrain, _, x, y = EYE.survey(block(0.1, distance, size, height))
    top = on_block(0.1, distance, size, x, y)
    assert np.count_nonzero(top) > 10
    np.testing.assert_allclose(terrain.height_m[top], height, atol=0.01)
    around = (np.maximum(abs(x - 0.1), abs(y - distance)) > 0.75 * size) & terrain.measured
    np.testing.assert_allclose(terrain.height_m[around], 0, atol=0.01)


@pytest.mark.parametrize(('rise_x', 'rise_y'), [(0.2, 0.0), (0.0, 0.2), (-0.1, -0.15)])
def test_block_on_a_slope_is_as_high_as_it_is_above_the_slope(rise_x, rise_y):
    height = together(tilted(rise_x, rise_y), block(0.0, 2.0, 0.4, 0.25))
    terrain, _, x, y = EYE.survey(height)
    # Heights count along the normal of the ground plane, which here is level.
    np.testing.assert_allclose(terrain.height_m[on_block(0, 2, 0.4, x, y)], 0.25, atol=0.02)
    around = (np.hypot(x, y - 2) > 0.5) & (y < 6) & terrain.measured
    np.testing.assert_allclose(terrain.height_m[around], 0, atol=0.02)


@pytest.mark.parametrize('ground', ['its own', 'another'])
def test_ground_plane_need_not_be_that_of_the_ground(ground):
    # A plane that leans 4 degrees forward and 2 to the side, and lies 5 cm too deep.
    normal = Gravity.from_angles(EYE.pitch_deg - 4, 2.0).up
    plane = EYE.level_ground if ground == 'its own' else GroundPlane(normal, 1.25, normal)
    terrain, _, x, y = EYE.survey(block(0.0, 2.0, 0.4, 0.25), ground=plane)
    np.testing.assert_allclose(terrain.height_m[on_block(0, 2, 0.4, x, y)], 0.25, atol=0.03)
    around = (np.hypot(x, y - 2) > 0.5) & (y < 6) & terrain.measured
    np.testing.assert_allclose(terrain.height_m[around], 0, atol=0.02)


@pytest.mark.parametrize(('wavelength', 'amplitude'), [(2.0, 0.05), (3.0, 0.1), (4.0, 0.2)])
def test_undulating_ground_is_ground(wavelength, amplitude):
    terrain, _, _, y = EYE.survey(waves(wavelength, amplitude))
    near = (y > 0) & (y < 5)
    assert np.ptp((waves(wavelength, amplitude))(*np.mgrid[-2:2:0.1, 0:5:0.1])) > 1.8 * amplitude
    assert np.abs(terrain.height_m[near]).max() < 0.03


def test_hollow_is_as_deep_as_it_is():
    terrain, _, x, y = EYE.survey(block(0.0, 2.0, 0.4, -0.15))
    assert terrain.height_m[on_block(0, 2, 0.4, x, y)].max() < 0.01
    assert np.abs(terrain.height_m[(y < 1.5) & terrain.measured]).max() < 0.02


def test_wall_is_not_what_it_stands_on():
    # Steeper than the rover climbs: were it ground, nothing could stand out of it.
    terrain, _, _, y = EYE.survey(bank(80, 3.0))
    assert np.nanmax(terrain.height_m) > 0.5
    assert np.abs(terrain.height_m[(y > 0) & (y < 2.5)]).max() < 0.01


def test_pixels_without_a_match_have_neither_height_nor_scale():
    disparity, _, _ = EYE.look(flat)
    expected = EYE.expected()
    disparity[40:60, 30:50] = 0
    noise_px = np.full_like(disparity, 0.1)
    found = survey(disparity, noise_px, expected, EYE.camera, EYE.level_ground, DetectorConfig())
    missing = disparity == 0
    assert missing[0].all()
    assert missing[40:60, 30:50].all()
    np.testing.assert_array_equal(np.isnan(found.height_m), missing)
    np.testing.assert_array_equal(found.measured, ~missing)
    np.testing.assert_array_equal(np.isinf(found.noise_m), missing)
    np.testing.assert_array_equal(found.pixels_per_metre == 0, missing)
    np.testing.assert_allclose(found.height_m[~missing], 0, atol=1e-4)
    for array in (found.height_m, found.noise_m, found.pixels_per_metre):
        assert array.dtype == np.float32
        assert array.shape == EYE.camera.shape


def test_a_calibration_of_double_precision_makes_no_images_of_it():
    size = [np.float64(value) for value in (200.0, 200.0, 99.5, 74.5, 0.15)]
    camera = StereoCamera(200, 150, *size)
    ground = DisparityPlane(np.float64(0), np.float64(0.2), np.float64(12)).in_space(camera, None)
    expected = DisparityPlane.from_ground(ground, camera).disparity(camera)
    disparity = np.maximum(expected, 0).astype(np.float32)
    found = survey(disparity, 0 * disparity + 0.1, expected, camera, ground, DetectorConfig())
    for array in (found.height_m, found.noise_m, found.eye_m, found.pixels_per_metre):
        assert array.dtype == np.float32
    for layer in found.layers:
        assert layer.eye_m.dtype == layer.ground_m.dtype == layer.noise_m.dtype == np.float32


def test_nothing_matched_at_all():
    nothing = np.zeros(EYE.camera.shape, np.float32)
    found = survey(
        nothing, nothing + 0.1, EYE.expected(), EYE.camera, EYE.level_ground, DetectorConfig()
    )
    assert not found.measured.any()
    assert found.layers == ()


def test_beyond_the_range_there_is_no_height_but_noise():
    terrain, disparity, _, _ = EYE.survey(flat, max_range=3.0)
    far = (disparity > 0) & (disparity < EYE.camera.disparity_at(3.0))
    assert far.any()
    np.testing.assert_array_equal(terrain.measured, (disparity > 0) & ~far)
    assert np.isfinite(terrain.noise_m[far]).all()


def test_image_is_as_large_as_its_distance_says():
    terrain, disparity, _, _ = EYE.survey(flat)
    seen = disparity > 0
    depth_m = EYE.camera.depth_m(disparity[seen])
    np.testing.assert_allclose(terrain.pixels_per_metre[seen], EYE.camera.fx / depth_m, rtol=1e-4)


def test_noise_on_the_ground_grows_with_the_distance():
    terrain, disparity, _, _ = EYE.survey(flat, noise_px=0.2)
    seen = disparity > 0
    expected = EYE.height_m * 0.2 / disparity[seen]
    np.testing.assert_allclose(terrain.noise_m[seen], expected, rtol=1e-4)
    middle = terrain.noise_m[:, 100]
    assert (np.diff(middle[np.isfinite(middle)]) < 0).all()


def test_noise_is_that_of_each_pixel():
    disparity, _, _ = EYE.look(flat)
    noise_px = np.full_like(disparity, 0.1)
    noise_px[:, 100:] = 0.3
    found = survey(
        disparity, noise_px, EYE.expected(), EYE.camera, EYE.level_ground, DetectorConfig()
    )
    np.testing.assert_allclose(
        found.noise_m[100:, 100:], 3 * found.noise_m[100:, 99::-1], rtol=1e-5
    )


@pytest.mark.parametrize('height', [0.2, 0.4])
def test_noise_follows_how_far_below_the_eye_a_point_is(height):
    terrain, disparity, x, y = EYE.survey(block(0.0, 2.0, 0.4, height), noise_px=0.1)
    within = on_block(0, 2, 0.4, x, y)
    assert np.count_nonzero(within) > 10
    expected = (EYE.height_m - height) * 0.1 / disparity[within]
    np.testing.assert_allclose(terrain.noise_m[within], expected, rtol=1e-3)


@pytest.mark.parametrize('rise', [-0.1, 0.2, 0.35])
def test_noise_on_a_bank_is_what_an_error_of_disparity_makes_of_heights_over_it(rise):
    disparity, _, y = EYE.look(bank(math.degrees(math.atan(rise)), 4.0))
    error_px = 0.02
    off = disparity + np.float32(error_px) * (disparity > 0)
    terrain = survey(
        disparity,
        np.full_like(disparity, error_px),
        EYE.expected(),
        EYE.camera,
        EYE.level_ground,
        DetectorConfig(),
    )
    on_bank = (y > 5) & (y < 12) & terrain.measured
    assert np.count_nonzero(on_bank) > 500
    # By hand: where the point comes to lie, over the bank under it.
    points = reproject(np.where(disparity > 0, off, 0).astype(np.float32), EYE.camera)
    _, y_off, z_off = np.moveaxis(points @ EYE.axes.T, -1, 0)
    moved_m = z_off + EYE.height_m - rise * np.maximum(y_off - 4.0, 0)
    np.testing.assert_allclose(
        terrain.noise_m[on_bank], np.abs(moved_m[on_bank]), rtol=0.15, atol=1e-3
    )
    assert np.median(terrain.eye_m[on_bank]) == pytest.approx(EYE.height_m + 4.0 * rise, rel=0.05)


def test_what_stands_as_high_as_the_eye_is_not_without_noise():
    terrain, disparity, _, y = EYE.survey(bank(80, 2.0), noise_px=0.1)
    as_high = (y > 2.2) & (disparity > 0)
    assert as_high.any()
    least = 0.3 * EYE.height_m * 0.1 / disparity[as_high]
    np.testing.assert_allclose(terrain.noise_m[as_high], least, rtol=1e-4)


def test_cells_double_from_span_to_span():
    spans = list(layer_spans(EYE.camera, EYE.height_m, DetectorConfig()))
    cells, ends = zip(*spans, strict=True)
    assert len(spans) == MAX_LAYERS
    np.testing.assert_allclose(cells, 0.04 * 2.0 ** np.arange(MAX_LAYERS))
    assert ends[-1] == math.inf
    # Where rows lie a cell and a half apart or so: with the cell as the square of the distance.
    np.testing.assert_allclose(np.square(ends[:-1]) / cells[:-1], np.square(ends[0]) / 0.04)
    assert ends[0] == pytest.approx(math.sqrt(EYE.camera.fy * 1.2 * 0.04 * 2))


@pytest.mark.parametrize(('max_range', 'layers'), [(3.0, 1), (4.0, 2), (40.0, 5)])
def test_spans_end_with_the_range(max_range, layers):
    spans = list(layer_spans(EYE.camera, EYE.height_m, DetectorConfig(max_range=max_range)))
    assert len(spans) == layers
    assert spans[-1][1] == math.inf


def test_first_cell_follows_the_step():
    (cell, _), *_ = layer_spans(EYE.camera, EYE.height_m, DetectorConfig(max_step=0.25))
    assert cell == pytest.approx(0.1)


def test_layers_are_the_spans_and_share_no_pixel():
    terrain, disparity, _, y = EYE.survey(flat)
    spans = list(layer_spans(EYE.camera, EYE.height_m, DetectorConfig()))
    assert [layer.positions.cell_m for layer in terrain.layers] == [cell for cell, _ in spans]
    count = np.zeros(disparity.shape, int)
    for layer in terrain.layers:
        count[layer.rows] += layer.pixels
    np.testing.assert_array_equal(count, disparity > 0)
    nearest = -math.inf
    for layer, (_, farthest) in zip(terrain.layers, spans, strict=True):
        distance = y[layer.rows][layer.pixels]
        assert nearest - 1e-3 <= distance.min() <= distance.max() <= farthest + 1e-3
        nearest = farthest
        # Seen somewhat beyond, so that the ground does not end where the layer does.
        assert layer.positions.inside[layer.pixels].all()
        assert layer.ground_m.shape == layer.seen.shape == layer.positions.shape


def test_a_far_layer_does_not_look_at_what_is_near():
    terrain, _, _, y = EYE.survey(flat)
    for nearer, layer in zip(terrain.layers, terrain.layers[1:], strict=False):
        end = y[nearer.rows][nearer.pixels].max()
        seen = y[layer.rows][layer.positions.inside]
        assert end / 1.25 - 1.0 - 0.1 <= seen.min() < end


def test_without_layers_one_map_serves_all():
    terrain, disparity, _, _ = EYE.survey(block(0.1, 2.5, 0.4, 0.3), layered=False)
    (layer,) = terrain.layers
    assert layer.positions.cell_m == pytest.approx(0.04)
    np.testing.assert_array_equal(layer.pixels, (disparity > 0)[layer.rows])
    assert np.nanmax(terrain.height_m) == pytest.approx(0.3, abs=0.01)


def test_layers_without_a_pixel_are_left_out():
    eye = Eye(pitch_deg=75.0)
    terrain, _, _, _ = eye.survey(flat)
    assert [layer.positions.cell_m for layer in terrain.layers] == pytest.approx([0.04])
    far = Eye(pinhole(200, 150, 15.0, 0.15), pitch_deg=1.0)
    (_, end), *_ = layer_spans(far.camera, far.height_m, DetectorConfig())
    terrain, _, _, y = far.survey(flat)
    assert y[terrain.measured].min() > end
    assert terrain.layers[0].positions.cell_m == pytest.approx(0.08)


def test_noisy_pixels_hold_the_ground_less():
    disparity, x, y = EYE.look(flat)
    noise_px = np.full_like(disparity, 0.05)
    spoilt = (np.hypot(x, y - 2) < 0.6) & (np.arange(200) % 2 == 0)
    # Every second column is 5 cm too low and says so.
    disparity[spoilt] *= 1 - 0.05 / EYE.height_m
    heights = []
    for told in (0.05, 5.0):
        noise_px[spoilt] = told
        found = survey(
            disparity, noise_px, EYE.expected(), EYE.camera, EYE.level_ground, DetectorConfig()
        )
        heights.append(np.median(found.height_m[(np.hypot(x, y - 2) < 0.4) & ~spoilt]))
    assert heights[0] > 0.015
    assert abs(heights[1]) < 0.005
