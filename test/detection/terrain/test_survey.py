from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from relief import PARAMETERS, PosedCamera, bank, block, flat, tilted, together
from synthetic import pinhole

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.geometry.reprojection import reproject
from rover_obstacle_detection.detection.terrain import survey as module
from rover_obstacle_detection.detection.terrain.survey import (
    layer_spans,
    rows_with,
    survey,
    survey_layers,
)

POSED = PosedCamera()


def waves(wavelength_m, amplitude_m):
    turn = 2 * np.pi / wavelength_m
    return lambda x, y: amplitude_m * np.sin(turn * x) * np.sin(turn * y + 1)


def on_block(x, y, size_m, at_x, at_y):
    """Pixels on the block, away from its edges."""
    found = np.maximum(abs(at_x - x), abs(at_y - y)) < 0.4 * size_m
    assert np.count_nonzero(found) > 10
    return found


def surveyed(disparity, noise_px=0.1, posed=POSED):
    return survey(posed.stereo(disparity, noise_px), PARAMETERS)


def spans(posed=POSED, **parameters):
    return list(layer_spans(posed.camera, posed.height_m, replace(PARAMETERS, **parameters)))


@pytest.mark.parametrize('height', [0.12, 0.3])
@pytest.mark.parametrize(('distance', 'size'), [(1.5, 0.3), (2.5, 0.4), (4.0, 0.5), (6.0, 0.6)])
def test_height_of_a_block_near_and_far(distance, size, height):
    terrain, _, x, y = POSED.survey(block(0.1, distance, size, height))
    top = on_block(0.1, distance, size, x, y)
    np.testing.assert_allclose(terrain.height_m[top], height, atol=0.01)
    around = (np.maximum(abs(x - 0.1), abs(y - distance)) > 0.75 * size) & terrain.measured
    np.testing.assert_allclose(terrain.height_m[around], 0, atol=0.01)


@pytest.mark.parametrize(('rise_x', 'rise_y'), [(0.2, 0.0), (0.0, 0.2), (-0.1, -0.15)])
def test_height_of_a_block_is_above_the_slope_it_stands_on(rise_x, rise_y):
    height = together(tilted(rise_x, rise_y), block(0.0, 2.0, 0.4, 0.25))
    terrain, _, x, y = POSED.survey(height)
    # Heights are along the normal of the ground plane, which is level here.
    np.testing.assert_allclose(terrain.height_m[on_block(0, 2, 0.4, x, y)], 0.25, atol=0.02)
    around = (np.hypot(x, y - 2) > 0.5) & (y < 6) & terrain.measured
    np.testing.assert_allclose(terrain.height_m[around], 0, atol=0.02)


def test_height_hardly_depends_on_the_ground_plane():
    # A plane that leans 4 degrees forward and 2 to the side, and lies 5 cm too deep.
    normal = Gravity.from_angles(POSED.pitch_deg - 4, 2.0).up
    plane = GroundPlane(normal, 1.25, normal)
    terrain, _, x, y = POSED.survey(block(0.0, 2.0, 0.4, 0.25), ground=plane)
    np.testing.assert_allclose(terrain.height_m[on_block(0, 2, 0.4, x, y)], 0.25, atol=0.03)
    around = (np.hypot(x, y - 2) > 0.5) & (y < 6) & terrain.measured
    np.testing.assert_allclose(terrain.height_m[around], 0, atol=0.02)


@pytest.mark.parametrize(('wavelength', 'amplitude'), [(2.0, 0.05), (3.0, 0.1), (4.0, 0.2)])
def test_undulating_ground_has_no_height(wavelength, amplitude):
    terrain, _, _, y = POSED.survey(waves(wavelength, amplitude))
    near = (y > 0) & (y < 5)
    assert np.abs(terrain.height_m[near]).max() < 0.03


def test_hollow_is_not_above_the_ground():
    terrain, _, x, y = POSED.survey(block(0.0, 2.0, 0.4, -0.15))
    assert terrain.height_m[on_block(0, 2, 0.4, x, y)].max() < 0.01
    assert np.abs(terrain.height_m[(y < 1.5) & terrain.measured]).max() < 0.02


def test_wall_is_not_ground():
    terrain, _, _, y = POSED.survey(bank(80, 3.0))
    assert np.nanmax(terrain.height_m) > 0.5
    assert np.abs(terrain.height_m[(y > 0) & (y < 2.5)]).max() < 0.01


def test_false_matches_in_the_sky_are_not_ground():
    posed = PosedCamera(pitch_deg=20.0)
    disparity, _, y = posed.look(flat)
    sky = disparity == 0
    depth_m = np.random.default_rng(0).uniform(0.3, 1.5, np.count_nonzero(sky))
    disparity[sky] = posed.camera.disparity_at(1.0) / depth_m
    terrain = surveyed(disparity, posed=posed)
    near = ~sky & (y < 8)
    np.testing.assert_allclose(terrain.height_m[near], 0, atol=0.02)
    assert terrain.height_m[sky].min() > 1


def test_pixels_without_a_match_have_neither_height_nor_scale():
    disparity, _, _ = POSED.look(flat)
    disparity[40:60, 30:50] = 0
    found = surveyed(disparity)
    missing = disparity == 0
    assert missing[0].all()
    assert missing[40:60, 30:50].all()
    np.testing.assert_array_equal(np.isnan(found.height_m), missing)
    np.testing.assert_array_equal(found.measured, ~missing)
    np.testing.assert_array_equal(np.isinf(found.noise_m), missing)
    np.testing.assert_array_equal(found.pixels_per_metre == 0, missing)
    np.testing.assert_allclose(found.height_m[~missing], 0, atol=1e-4)


def test_double_precision_calibration_gives_single_precision_images():
    size = [np.float64(value) for value in (200.0, 200.0, 99.5, 74.5, 0.15)]
    camera = StereoCamera(200, 150, *size)
    ground = DisparityPlane(np.float64(0), np.float64(0.2), np.float64(12)).in_space(camera, None)
    expected = DisparityPlane.from_ground(ground, camera).disparity(camera)
    disparity = np.maximum(expected, 0).astype(np.float32)
    found = survey(PosedCamera(camera).stereo(disparity, ground=ground), PARAMETERS)
    for array in (found.height_m, found.noise_m, found.camera_m, found.pixels_per_metre):
        assert array.dtype == np.float32
    assert found.layers
    for layer in found.layers:
        assert layer.camera_m.dtype == layer.ground_m.dtype == layer.noise_m.dtype == np.float32


def test_nothing_matched_has_no_layers():
    found = surveyed(np.zeros(POSED.camera.shape, np.float32))
    assert not found.measured.any()
    assert found.layers == ()


def test_pixels_beyond_the_range_have_noise_but_no_height():
    parameters = replace(PARAMETERS, max_range_m=3.0)
    terrain, disparity, _, _ = POSED.survey(flat, parameters=parameters)
    far = (disparity > 0) & (disparity < POSED.camera.disparity_at(3.0))
    assert far.any()
    np.testing.assert_array_equal(terrain.measured, (disparity > 0) & ~far)
    assert np.isfinite(terrain.noise_m[far]).all()


def test_image_scale_follows_depth():
    terrain, disparity, _, _ = POSED.survey(flat)
    seen = disparity > 0
    depth_m = POSED.camera.depth_m(disparity[seen])
    np.testing.assert_allclose(
        terrain.pixels_per_metre[seen], POSED.camera.fx / depth_m, rtol=1e-4
    )


def test_height_noise_grows_with_distance():
    terrain, disparity, _, _ = POSED.survey(flat, noise_px=0.2)
    seen = disparity > 0
    expected = POSED.height_m * 0.2 / disparity[seen]
    np.testing.assert_allclose(terrain.noise_m[seen], expected, rtol=1e-4)
    middle = terrain.noise_m[:, 100]
    assert (np.diff(middle[np.isfinite(middle)]) < 0).all()


def test_height_noise_follows_the_noise_of_each_pixel():
    disparity, _, _ = POSED.look(flat)
    noise_px = np.full_like(disparity, 0.1)
    noise_px[:, 100:] = 0.3
    found = surveyed(disparity, noise_px)
    np.testing.assert_allclose(
        found.noise_m[100:, 100:], 3 * found.noise_m[100:, 99::-1], rtol=1e-5
    )


@pytest.mark.parametrize('height', [0.2, 0.4])
def test_height_noise_follows_the_depth_below_the_camera(height):
    terrain, disparity, x, y = POSED.survey(block(0.0, 2.0, 0.4, height), noise_px=0.1)
    within = on_block(0, 2, 0.4, x, y)
    expected = (POSED.height_m - height) * 0.1 / disparity[within]
    np.testing.assert_allclose(terrain.noise_m[within], expected, rtol=1e-3)


@pytest.mark.parametrize('rise', [-0.1, 0.2, 0.35])
def test_height_noise_on_a_bank_is_the_effect_of_a_disparity_error(rise):
    disparity, _, y = POSED.look(bank(math.degrees(math.atan(rise)), 4.0))
    error_px = 0.02
    off = disparity + np.float32(error_px) * (disparity > 0)
    terrain = surveyed(disparity, error_px)
    on_bank = (y > 5) & (y < 12) & terrain.measured
    assert np.count_nonzero(on_bank) > 500
    # The height over the bank of each point, moved by the error.
    points = reproject(np.where(disparity > 0, off, 0).astype(np.float32), POSED.camera)
    _, y_off, z_off = np.moveaxis(points @ POSED.axes.T, -1, 0)
    moved_m = z_off + POSED.height_m - rise * np.maximum(y_off - 4.0, 0)
    np.testing.assert_allclose(
        terrain.noise_m[on_bank], np.abs(moved_m[on_bank]), rtol=0.15, atol=1e-3
    )
    camera_m = np.median(terrain.camera_m[on_bank])
    assert camera_m == pytest.approx(POSED.height_m + 4.0 * rise, rel=0.05)


def test_points_as_high_as_the_camera_have_height_noise():
    terrain, disparity, _, y = POSED.survey(bank(80, 2.0), noise_px=0.1)
    as_high = (y > 2.2) & (disparity > 0)
    assert as_high.any()
    least = 0.3 * POSED.height_m * 0.1 / disparity[as_high]
    np.testing.assert_allclose(terrain.noise_m[as_high], least, rtol=1e-4)


def test_cells_double_and_ends_follow_their_root():
    cells, ends = zip(*spans(), strict=True)
    np.testing.assert_allclose(cells, 0.04 * 2.0 ** np.arange(PARAMETERS.max_layers))
    # The distance between image rows on the ground grows with the square of the distance.
    np.testing.assert_allclose(np.square(ends[:-1]) / cells[:-1], np.square(ends[0]) / 0.04)
    assert ends[0] == pytest.approx(math.sqrt(POSED.camera.fy * 1.2 * 0.04 * 2))
    assert ends[-1] == math.inf


@pytest.mark.parametrize(('max_range', 'layers'), [(3.0, 1), (4.0, 2), (40.0, 5)])
def test_spans_end_with_the_range(max_range, layers):
    found = spans(max_range_m=max_range)
    assert len(found) == layers
    assert found[-1][1] == math.inf


def test_first_cell_follows_the_step():
    assert spans(max_step_m=0.05)[0][0] == pytest.approx(0.02)
    # Slopes are as fine for a rover that climbs higher.
    assert spans(max_step_m=0.25)[0][0] == pytest.approx(0.04)


def test_a_layer_has_a_bounded_number_of_cells_however_far_the_camera_sees():
    telephoto = PosedCamera(
        replace(POSED.camera, fx=15_000.0, fy=15_000.0), pitch_deg=40.0, height_m=200.0
    )
    found = spans(telephoto, max_range_m=1000.0)
    cells = [farthest_m / cell_m for cell_m, farthest_m in found]
    assert cells[:-1] == [PARAMETERS.max_cells] * (len(cells) - 1)
    assert found[-1][0] >= 1000.0 / PARAMETERS.max_cells


def test_what_lies_too_far_aside_is_left_out():
    # Level with the camera, the ground reaches far to both sides.
    disparity, x, _ = POSED.look(flat)
    few = replace(PARAMETERS, max_cells=40)
    terrain = survey_layers(POSED.stereo(disparity), [(0.04, math.inf)], few)
    (layer,) = terrain.layers
    assert layer.positions.shape[1] <= 40 + 2
    np.testing.assert_array_equal(
        terrain.measured, (disparity > 0) & (np.abs(x) < 0.8), err_msg='up to 20 cells of 0.04 m'
    )


def test_layers_follow_the_spans_and_share_no_pixel():
    terrain, disparity, _, y = POSED.survey(flat)
    assert [layer.positions.cell_m for layer in terrain.layers] == [cell for cell, _ in spans()]
    count = np.zeros(disparity.shape, int)
    for layer in terrain.layers:
        count[layer.rows] += layer.pixels
    np.testing.assert_array_equal(count, disparity > 0)
    nearest = -math.inf
    for layer, (_, farthest) in zip(terrain.layers, spans(), strict=True):
        distance = y[layer.rows][layer.pixels]
        assert nearest - 1e-3 <= distance.min() <= distance.max() <= farthest + 1e-3
        nearest = farthest
        # The map extends beyond the span, so the ground does not end where the layer does.
        assert layer.positions.inside[layer.pixels].all()
        assert layer.ground_m.shape == layer.seen.shape == layer.positions.shape


def test_cells_with_one_pixel_or_more_are_seen():
    disparity, _, y = POSED.look(flat)
    disparity[(y > 1.4) & (y < 1.8)] = 0
    layer = survey_layers(POSED.stereo(disparity), [(0.04, math.inf)], PARAMETERS).layers[0]
    places = layer.positions
    count = np.zeros(places.shape, int)
    cells = (np.rint(each[layer.pixels]).astype(int) for each in (places.row, places.column))
    np.add.at(count, tuple(cells), 1)
    assert (count == 1).any()
    np.testing.assert_array_equal(layer.seen, count > 0)


def test_far_layer_leaves_out_near_ground():
    terrain, _, _, y = POSED.survey(flat)
    for nearer, layer in zip(terrain.layers, terrain.layers[1:], strict=False):
        end = y[nearer.rows][nearer.pixels].max()
        seen = y[layer.rows][layer.positions.inside]
        assert end / 1.25 - 1.0 - 0.1 <= seen.min() < end


def test_one_layer_may_cover_all_distances():
    disparity, _, _ = POSED.look(block(0.1, 2.5, 0.4, 0.3))
    wide = replace(PARAMETERS, max_cells=2000)
    terrain = survey_layers(POSED.stereo(disparity), [(0.04, math.inf)], wide)
    (layer,) = terrain.layers
    assert layer.positions.cell_m == pytest.approx(0.04)
    np.testing.assert_array_equal(layer.pixels, (disparity > 0)[layer.rows])
    assert np.nanmax(terrain.height_m) == pytest.approx(0.3, abs=0.01)


def test_layers_without_a_pixel_are_left_out():
    near = PosedCamera(pitch_deg=75.0)
    terrain, _, _, _ = near.survey(flat)
    assert [layer.positions.cell_m for layer in terrain.layers] == pytest.approx([0.04])
    far = PosedCamera(pinhole(200, 150, 15.0, 0.15), pitch_deg=1.0)
    terrain, _, _, y = far.survey(flat)
    assert y[terrain.measured].min() > spans(far)[0][1]
    assert terrain.layers[0].positions.cell_m == pytest.approx(0.08)


def test_noisy_pixels_count_less():
    disparity, x, y = POSED.look(flat)
    noise_px = np.full_like(disparity, 0.05)
    spoilt = (np.hypot(x, y - 2) < 0.6) & (np.arange(200) % 2 == 0)
    # Every second column is 5 cm too low.
    disparity[spoilt] *= 1 - 0.05 / POSED.height_m
    heights = []
    for spoilt_noise_px in (0.05, 5.0):
        noise_px[spoilt] = spoilt_noise_px
        found = surveyed(disparity, noise_px)
        heights.append(np.median(found.height_m[(np.hypot(x, y - 2) < 0.4) & ~spoilt]))
    assert heights[0] > 0.015
    assert abs(heights[1]) < 0.005


def test_pixels_count_half_where_their_noise_is_the_relief_of_a_cell():
    disparity, _, _ = POSED.look(flat)
    noise_px = np.full_like(disparity, 1e-6)
    noise_px[:, 100:] += PARAMETERS.cell_relief_m * disparity[:, 100:] / POSED.height_m
    points = module._points_over_plane(POSED.stereo(disparity, noise_px), PARAMETERS)
    seen = disparity > 0
    np.testing.assert_allclose(points.trust[:, :100][seen[:, :100]], 1)
    np.testing.assert_allclose(points.trust[:, 100:][seen[:, 100:]], 0.5, rtol=1e-3)
    # Nothing is known better than to half a centimetre.
    least = PARAMETERS.min_noise_m**2
    np.testing.assert_allclose(points.information[:, :100][seen[:, :100]], 1 / least, rtol=1e-3)
    np.testing.assert_allclose(
        points.information[:, 100:][seen[:, 100:]],
        1 / (PARAMETERS.cell_relief_m**2 + least),
        rtol=1e-3,
    )


def test_what_rises_steeper_than_loose_ground_by_more_than_a_step_is_no_ground():
    down = PosedCamera(pitch_deg=85.0)
    disparity, _, y = down.look(flat)
    points = module._points_over_plane(down.stereo(disparity), PARAMETERS)
    # Behind the camera, level ground lies above any slope that begins under it.
    farthest_m = PARAMETERS.max_step_m / math.tan(math.radians(PARAMETERS.repose_deg))
    assert y.min() < -2 * farthest_m
    np.testing.assert_array_equal(points.trust > 0, (disparity > 0) & (y > -farthest_m))


def test_rows_with_marked_pixels():
    pixels = np.zeros((6, 4), bool)
    assert rows_with(pixels) == slice(0, 0)
    pixels[2, 3] = pixels[4, 0] = True
    assert rows_with(pixels) == slice(2, 5)
