from __future__ import annotations

import numpy as np
import pytest
import synthetic
import waves

from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT, RowAlignment
from rover_obstacle_detection.detection.stereo.coarse import CoarseMatcher, coarse_camera
from rover_obstacle_detection.detection.stereo.parameters import StereoParameters

CAMERA = synthetic.pinhole(640, 480, 60.0, 0.06)


def mean_of_blocks(image, size):
    rows, columns = image.shape
    return image.reshape(rows // size, size, columns // size, size).mean(axis=(1, 3))


def matched_coarsely(pair, camera, rows=STRAIGHT, **parameters):
    p = StereoParameters(**parameters)
    reduced = Frame(pair, camera).resized(coarse_camera(camera, p))
    return CoarseMatcher(camera, reduced.camera, p)(reduced.pair, rows)


@pytest.mark.parametrize(
    ('width', 'height', 'coarse'),
    [(1024, 768, (192, 256)), (640, 480, (120, 160)), (320, 240, (120, 160)), (64, 48, (48, 64))],
)
def test_small_images_are_reduced_less(width, height, coarse):
    camera = synthetic.pinhole(width, height, 60.0, 0.06)
    found = coarse_camera(camera, StereoParameters())
    assert found == camera.resized(coarse[1], coarse[0])


@pytest.mark.parametrize('offset', [0.0, 7.5])
def test_coarse_disparity_is_in_reduced_pixels(offset):
    scene = synthetic.mast(camera=synthetic.pinhole(320, 240, 60.0, 0.06, offset=offset))
    view = synthetic.render(scene)
    found = matched_coarsely((view.left, view.right), scene.camera)
    valid = found > 0
    assert valid.mean() > 0.7
    assert np.abs(found - mean_of_blocks(view.disparity, 2) / 2)[valid].mean() < 0.2


def test_known_row_shift_is_followed():
    plane = DisparityPlane(0.0, 0.06, 24.0)
    rows = RowAlignment(4.0, 0.03)
    pair = waves.stereo_pair(CAMERA, plane, rows, shortest_px=16)
    truth = mean_of_blocks(plane.disparity(CAMERA), 4) / 4

    def median_error(rows):
        found = matched_coarsely(pair, CAMERA, rows)
        assert (found > 0).mean() > 0.5
        return np.median(np.abs(found - truth)[found > 0])

    assert median_error(rows.reduced(4.0)) < 0.15
    assert median_error(STRAIGHT) > 0.5


def test_smallest_disparity_is_in_full_size_pixels():
    plane = DisparityPlane(0.0, 0.05, 26.0)
    pair = waves.stereo_pair(CAMERA, plane, shortest_px=16)
    assert plane.disparity(CAMERA).min() > 13
    found = matched_coarsely(pair, CAMERA, min_disparity_px=12)
    assert (found > 0).mean() > 0.9
    beyond = matched_coarsely(pair, CAMERA, min_disparity_px=28)
    assert found[found > 0].min() >= 3
    assert beyond[beyond > 0].min() >= 7


def test_number_of_disparities_is_in_full_size_pixels():
    pair = waves.stereo_pair(CAMERA, DisparityPlane(0.0, 0.2, 60.0), shortest_px=16)
    found = matched_coarsely(pair, CAMERA, disparity_range_px=64)
    assert (found > 0).any()
    assert found.max() < 16
    # By default the range reaches to the nearest distance, here 111 px.
    assert matched_coarsely(pair, CAMERA).max() > 24
