from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.study.parameters import StudyParameters
from rover_obstacle_detection.detection.study.products import StudyProducts

CAMERA = StereoCamera(40, 30, 40.0, 40.0, 19.5, 14.5, 0.5)
UP = Gravity.from_angles(46.0).up
PRODUCTS = ('regions', 'is_seed', 'seeds', 'roughness', 'step', 'elevation_m')


def products(segment=None, **changes):
    """Level ground a metre below; left and right half are regions, the right one unmatched."""
    disparity = DisparityPlane.from_ground(GroundPlane(UP, 1.0, UP), CAMERA).disparity(CAMERA)
    disparity[:, 20:] = 0
    halves = np.repeat([[1, 2]], 20, axis=1).astype(np.int32) * np.ones((30, 1), np.int32)
    return StudyProducts(
        np.full(CAMERA.shape, 90, np.uint8),
        disparity,
        CAMERA,
        np.array(UP, np.float32),
        segment or (lambda grey: halves),
        StudyParameters(**changes),
        min_seed_points=10,
    )


def test_products_of_level_ground():
    found = products()
    assert found.is_seed.tolist()[1:] == [True, False]
    np.testing.assert_array_equal(found.seeds, found.regions == 1)
    matched = found.disparity > 0
    np.testing.assert_allclose(found.elevation_m[matched], -1, atol=1e-5)
    assert np.isnan(found.elevation_m[~matched]).all()
    for image in (found.roughness, found.step):
        np.testing.assert_allclose(image[matched], 0, atol=1e-4)
        assert np.isnan(image[:, 25:]).all()


def test_far_matches_make_a_seed():
    given = products()
    far = replace(given, disparity=np.where(given.disparity > 0, np.float32(0.5), np.float32(0)))
    assert far.is_seed.tolist()[1:] == [True, False]


@pytest.mark.parametrize(('size_px', 'columns'), [(3, 21), (9, 24)])
def test_window_size_is_a_parameter(size_px, columns):
    found = products(window_size_px=size_px)
    assert np.isfinite(found.step[15]).sum() == columns
    # The last of these windows has a single column of points, which defines no plane.
    assert np.isfinite(found.roughness[15]).sum() == columns - 1


@pytest.mark.parametrize('name', PRODUCTS)
def test_products_are_computed_once_and_read_only(name):
    found = products()
    first = getattr(found, name)
    assert getattr(found, name) is first
    with pytest.raises(ValueError, match='read-only'):
        first[...] = 0


def test_regions_are_segmented_only_on_access():
    segmented = []

    def segment(grey):
        segmented.append(grey)
        return np.ones(grey.shape, np.int32)

    found = products(segment)
    assert np.isfinite(found.step).any()
    assert not segmented
    assert found.seeds.all()
    assert len(segmented) == 1
    assert segmented[0] is found.grey
