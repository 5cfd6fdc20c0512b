"""The compared methods, and the listing against the printed loops."""

from __future__ import annotations

import math
import sys
from functools import cache
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic import Box, Plane, View, mast, render

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.grey_pair import grey_pair
from rover_obstacle_detection.errors import (
    ConfigurationError,
    MissingExtraError,
    UnjudgeablePairError,
)
from rover_obstacle_detection.evaluation.methods.dense_stereo import match_densely
from rover_obstacle_detection.evaluation.methods.image_only import cluster_levels, edged_regions
from rover_obstacle_detection.evaluation.methods.listing import Listing
from rover_obstacle_detection.evaluation.methods.names import METHOD_DESCRIPTIONS
from rover_obstacle_detection.evaluation.methods.registry import METHODS, make_method
from rover_obstacle_detection.evaluation.methods.sparse_stereo import (
    correlate_points,
    foerstner_points,
    guided_disparity,
    without_outliers,
)

LIBRARIES = {'patchwork': 'pypatchworkpp', 'cloth': 'CSF'}
SOLID = ('hybrid', 'depth_only', 'patchwork', 'cloth', 'wang')


@cache
def view_with_box() -> View:
    return render(mast(solids=(Box(0.0, 1.2, 0.3, 0.3, 0.25),)))


def made(name: str, config: DetectorConfig | None = None) -> Any:
    if name in LIBRARIES:
        pytest.importorskip(LIBRARIES[name], reason='needs the extra peers')
    return make_method(name, config)


def test_every_method_has_a_description() -> None:
    assert list(METHODS) == list(METHOD_DESCRIPTIONS)


@pytest.mark.parametrize('name', METHODS)
def test_method_returns_a_binary_mask(name: str) -> None:
    view = view_with_box()
    mask = made(name)(view.scene.camera, view.left, view.right)
    assert mask.shape == view.left.shape
    assert mask.dtype == np.uint8
    assert set(np.unique(mask)) == {0, 255}


@pytest.mark.parametrize('name', METHODS)
def test_blank_pair_gives_an_empty_mask_or_is_refused(name: str) -> None:
    view = view_with_box()
    blank = np.full(view.left.shape, 128, np.uint8)
    if name == 'hybrid':
        with pytest.raises(UnjudgeablePairError, match='neither image shows any texture'):
            made(name)(view.scene.camera, blank, blank)
        return
    mask = made(name)(view.scene.camera, blank, blank)
    assert mask.shape == blank.shape
    assert not mask.any()


@pytest.mark.parametrize('name', SOLID)
def test_3d_methods_find_a_tall_box(name: str) -> None:
    view = view_with_box()
    flagged = made(name)(view.scene.camera, view.left, view.right) != 0
    assert (flagged & view.obstacle).sum() >= 0.5 * view.obstacle.sum()
    far_off = ~cv2.dilate(view.obstacle.astype(np.uint8), np.ones((61, 61))).astype(bool)
    # The windows of the sparse pipeline are coarse on so small an image.
    assert (flagged & far_off).mean() < (0.2 if name == 'wang' else 0.01)


@pytest.mark.parametrize('name', ['depth_only', 'patchwork', 'cloth', 'wang'])
def test_box_below_the_clearance_is_free(name: str) -> None:
    view = view_with_box()
    config = DetectorConfig(max_step=0.5)
    flagged = made(name, config)(view.scene.camera, view.left, view.right) != 0
    assert (flagged & view.obstacle).sum() < 0.2 * view.obstacle.sum()


def test_dense_stereo_finds_disparity_and_ground() -> None:
    view = view_with_box()
    scene = match_densely(view.scene.camera, view.left, view.right, DetectorConfig())
    matched = scene.disparity > 0
    assert matched.mean() > 0.8
    error = np.abs(scene.disparity - view.disparity)[matched]
    assert np.median(error) < 0.15
    assert scene.plane is not None
    assert scene.plane.height_m == pytest.approx(1.0, abs=0.03)
    assert scene.plane.pitch_deg == pytest.approx(46.0, abs=1.5)


def test_level_cloud_has_the_ground_below_and_ahead() -> None:
    view = render(mast())
    scene = match_densely(view.scene.camera, view.left, view.right, DetectorConfig())
    cloud = scene.level_points(scene.disparity > 0)
    assert np.median(cloud[:, 2]) == pytest.approx(-1.0, abs=0.03)
    assert cloud[:, 0].min() > 0.1, 'x is forward'
    left_half = np.zeros_like(scene.disparity, bool)
    left_half[:, : view.scene.camera.width // 2 - 2] = True
    assert (scene.level_points((scene.disparity > 0) & left_half)[:, 1] > 0).all(), 'y is left'


def test_depth_only_passes_sloping_flat_ground() -> None:
    view = render(mast(planes=(Plane.uphill(8.0),)))
    mask = made('depth_only')(view.scene.camera, view.left, view.right)
    assert (mask != 0).mean() < 0.002


def test_unknown_method_is_refused_with_a_hint() -> None:
    with pytest.raises(ConfigurationError, match=r"'hybird'.*did you mean hybrid\?"):
        make_method('hybird')


@pytest.mark.parametrize('name', LIBRARIES)
def test_missing_library_is_named_with_its_remedy(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, LIBRARIES[name], None)
    with pytest.raises(MissingExtraError, match=rf'{name} needs (.*), .* pip install \1$'):
        make_method(name)


@pytest.mark.parametrize('name', LIBRARIES)
def test_libraries_print_nothing(name: str, capfd: pytest.CaptureFixture[str]) -> None:
    view = view_with_box()
    made(name)(view.scene.camera, view.left, view.right)
    assert capfd.readouterr().out == ''


def textured(shape: tuple[int, int], seed: int = 0) -> NDArray[np.uint8]:
    noise = np.random.default_rng(seed).uniform(0, 255, shape).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 1.2)
    return cv2.normalize(smooth, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)


def test_foerstner_points_lie_on_corners_not_edges() -> None:
    grey = np.full((80, 80), 50, np.uint8)
    grey[40:, 40:] = 200
    points = foerstner_points(grey)
    assert len(points)
    assert (np.abs(points - 40) <= 4).all()


def test_sparse_matching_recovers_a_shift() -> None:
    wide = textured((120, 260))
    left, right = wide[:, :200].copy(), wide[:, 12:212].copy()
    camera = StereoCamera(200, 120, 150.0, 150.0, 99.5, 59.5, 0.1)
    matches = without_outliers(correlate_points(left, right, camera, 0.5))
    assert len(matches) > 100
    shifts = matches[:, 0] - matches[:, 2]
    assert (np.abs(shifts - 12) <= 1).mean() > 0.98
    disparity = guided_disparity(left, right, camera, matches)
    matched = disparity > 0
    assert matched.mean() > 0.6
    assert np.median(np.abs(disparity[matched] - 12)) < 0.05


def test_guided_matching_is_subpixel_accurate() -> None:
    view = view_with_box()
    grey_left, grey_right = grey_pair(view.left, view.right, view.scene.camera)
    matches = without_outliers(correlate_points(grey_left, grey_right, view.scene.camera, 0.3))
    disparity = guided_disparity(grey_left, grey_right, view.scene.camera, matches)
    matched = disparity > 0
    assert np.median(np.abs(disparity - view.disparity)[matched]) < 0.15


def test_image_only_finds_a_dark_rock_on_plain_ground() -> None:
    rock = np.s_[60:100, 120:170]
    image = np.full((240, 320), 130, np.uint8)
    image[rock] = 60
    image += np.random.default_rng(0).integers(0, 10, image.shape, np.uint8)
    flagged = made('image_only')(
        StereoCamera(320, 240, 300.0, 300.0, 159.5, 119.5, 0.1), image, image
    )
    assert (flagged[rock] != 0).mean() > 0.95
    flagged[rock] = 0
    assert (flagged != 0).mean() < 0.01


def test_clusters_separate_grey_levels() -> None:
    grey = np.repeat(np.array([10, 90, 160, 240], np.uint8), 100).reshape(20, 20)
    clusters = cluster_levels(grey)
    assert len({int(clusters.ravel()[100 * index]) for index in range(4)}) == 4
    assert (clusters.ravel()[:100] == clusters[0, 0]).all()


def test_region_without_edges_is_dropped() -> None:
    area = np.zeros((100, 100), bool)
    area[10:30, 10:30] = area[60:80, 60:80] = True
    edges = np.zeros_like(area)
    edges[8:32, 8:32] = True
    kept = edged_regions(area, edges)
    assert kept[20, 20]
    assert not kept[70, 70]


def listing_as_printed(camera: StereoCamera, left_img: Any, right_img: Any) -> NDArray[np.uint8]:
    """Section 4.2 of the study with its loops over the whole image; three lines corrected."""
    stereo = cv2.StereoSGBM_create(
        minDisparity=0,
        numDisparities=16 * 3,
        blockSize=5,
        P1=8 * 3 * 5 * 5,
        P2=32 * 3 * 5 * 5,
        disp12MaxDiff=1,
        uniquenessRatio=8,
        speckleWindowSize=50,
        speckleRange=2,
        preFilterCap=63,
        mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )
    disparity = stereo.compute(left_img, right_img).astype(np.float32) / 16.0
    disparity[disparity <= 0] = 0
    disparity = cv2.medianBlur(disparity, 5)
    h, w = left_img.shape
    fov_rad = 2 * math.atan(h / (2 * camera.fy))
    fy = h / (2 * math.tan(fov_rad / 2))
    fx = fy * w / h
    q = np.float32(
        [[1, 0, 0, -w / 2], [0, 1, 0, -h / 2], [0, 0, 0, fx], [0, 0, 1 / camera.baseline_m, 0]]
    )
    points_3d = cv2.reprojectImageTo3D(disparity, q)
    z = points_3d[:, :, 2]
    mean_shifted = cv2.pyrMeanShiftFiltering(
        cv2.cvtColor(left_img, cv2.COLOR_GRAY2BGR), sp=15, sr=20
    )
    segmented_gray = cv2.cvtColor(mean_shifted, cv2.COLOR_BGR2GRAY)
    _, segmented_bin = cv2.threshold(segmented_gray, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    num_labels, labels = cv2.connectedComponents(segmented_bin)
    cleaned_labels = np.zeros_like(labels)
    current_label = 1
    for label in range(1, num_labels):
        region_mask = labels == label
        if np.sum(region_mask) >= 50:
            cleaned_labels[region_mask] = current_label
        current_label += 1
    num_regions = np.max(cleaned_labels)
    region_seed_count = np.zeros(num_regions + 1, dtype=int)
    ys, xs = np.where((z > 0) & (z < 10))
    for y, x in zip(ys, xs, strict=True):
        if cleaned_labels[y, x] > 0:
            region_seed_count[cleaned_labels[y, x]] += 1
    obstacle_map = np.zeros_like(cleaned_labels, dtype=bool)
    for region_label in range(1, num_regions + 1):
        region_mask = cleaned_labels == region_label
        ys, xs = np.where(region_mask)
        if len(ys) < 10:
            continue
        for y_start in range(ys.min(), ys.max(), 5):
            for x_start in range(xs.min(), xs.max(), 5):
                y_end, x_end = min(y_start + 5, ys.max() + 1), min(x_start + 5, xs.max() + 1)
                if np.sum(region_mask[y_start:y_end, x_start:x_end]) < 3:
                    continue
                window = points_3d[y_start:y_end, x_start:x_end, :]
                window = window[np.isfinite(window).all(axis=2)]
                if len(window) < 3:
                    continue
                values = window[:, 2].reshape(-1, 1)
                a = np.hstack([window[:, 2:3], np.ones((len(window), 1))])
                coeff, _, _, _ = np.linalg.lstsq(a, values, rcond=None)
                roughness = np.mean(np.abs(values - a @ coeff))
                if roughness > 0.0005 or np.max(values) - np.min(values) > 0.005:
                    update = np.zeros_like(region_mask, dtype=bool)
                    update[y_start:y_end, x_start:x_end] = True
                    obstacle_map |= update & region_mask
                if region_seed_count[region_label] < 10 and np.mean(left_img[region_mask]) < 50:
                    obstacle_map |= region_mask
    image = obstacle_map.astype(np.uint8) * 255
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (7, 7))
    image = cv2.morphologyEx(image, cv2.MORPH_CLOSE, kernel, iterations=2)
    return cv2.morphologyEx(image, cv2.MORPH_OPEN, kernel, iterations=2)


def test_listing_matches_the_printed_loops() -> None:
    view = view_with_box()
    left = view.left.copy()
    # Several regions, a dark one among them.
    left[40:44] = 5
    left[:, 150:156] = 5
    expected = listing_as_printed(view.scene.camera, left, view.right)
    assert 0.02 < (expected > 0).mean() < 0.98
    np.testing.assert_array_equal(Listing()(view.scene.camera, left, view.right), expected)
