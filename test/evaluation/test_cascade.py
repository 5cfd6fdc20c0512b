"""The cascade of boosted features, on small hand-made images."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.evaluation.methods.cascade import (
    BOX,
    CORNERS,
    GRADIENT,
    GREY,
    MARGIN,
    MAX_OVERLAP,
    PATTERNS,
    SCALE_STEP,
    STRIDE,
    WHOLE,
    WINDOW,
    BoostedCascade,
    Cascade,
    Feature,
    Numbers,
    Stage,
    Values,
    Windows,
    all_windows,
    covered,
    overlaps,
    windows_of,
    without_overlap,
)

CAMERA = StereoCamera(120, 90, 100.0, 100.0, 59.5, 44.5, 0.1)
# Whole window, grey level and gradient.
EVERYTHING = [Feature(channel, WHOLE, 0, 0, *WINDOW) for channel in (GREY, GRADIENT)]


def noise(height: int, width: int, seed: int = 0) -> NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(0, 256, (height, width), np.uint8)


def with_edge(grey: NDArray[np.uint8]) -> NDArray[np.float64]:
    return np.pad(grey, MARGIN, mode='edge').astype(np.float64)


def patches(image: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
    """Windows row by row, one at a time."""
    for row in range(0, image.shape[0] - WINDOW[0] + 1, STRIDE):
        for column in range(0, image.shape[1] - WINDOW[1] + 1, STRIDE):
            yield image[row : row + WINDOW[0], column : column + WINDOW[1]]


def value_in(patch: NDArray[np.float64], feature: Feature) -> float:
    """Add up a feature cell by cell."""
    total = 0.0
    for (row, column), weight in np.ndenumerate(PATTERNS[feature.pattern]):
        top = feature.row + row * feature.height
        left = feature.column + column * feature.width
        total += weight * patch[top : top + feature.height, left : left + feature.width].mean()
    return total


def numbers_of(windows: Windows) -> Numbers:
    return np.arange(len(windows.starts))


@pytest.mark.parametrize('pattern', range(len(PATTERNS)))
def test_features_are_the_same_as_cell_by_cell(pattern: int) -> None:
    grey = noise(15, 21)
    windows = windows_of(grey)
    image = with_edge(grey)
    slopes = [cv2.Sobel(image, cv2.CV_64F, *order) for order in ((1, 0), (0, 1))]
    gradient = np.hypot(*slopes)
    gradient /= gradient.mean()
    height, width = (6, 5) if pattern != WHOLE else (13, 17)
    feature = Feature(GREY, pattern, 1, 2, height, width)
    expected = [value_in(patch, feature) / patch.std() for patch in patches(image)]
    values = windows.values(feature, numbers_of(windows))
    np.testing.assert_allclose(values, expected, rtol=1e-6, atol=1e-9)
    assert len(values) == 2 * 3
    feature = feature._replace(channel=GRADIENT)
    expected = [value_in(patch, feature) for patch in patches(gradient)]
    values = windows.values(feature, numbers_of(windows))
    np.testing.assert_allclose(values, expected, rtol=1e-5, atol=1e-5)


def test_touching_cells_share_corners() -> None:
    assert [len(corners) for corners in CORNERS] == [6, 6, 8, 8, 9, 8, 4]


def test_grey_features_do_not_depend_on_brightness_and_contrast() -> None:
    grey = noise(20, 30) // 4
    features = [Feature(GREY, pattern, 0, 0, 6, 6) for pattern in range(WHOLE)]
    for feature in features:
        dark, bright = (
            windows.values(feature, numbers_of(windows))
            for windows in (windows_of(grey), windows_of(2 * grey + 60))
        )
        np.testing.assert_allclose(bright, dark, atol=1e-9)
        assert np.abs(dark).max() > 0.1


def test_flat_windows_have_finite_features() -> None:
    windows = windows_of(np.full((20, 30), 7, np.uint8))
    values = [windows.values(feature, numbers_of(windows)) for feature in EVERYTHING]
    np.testing.assert_allclose(values[0], 7)
    np.testing.assert_allclose(values[1], 0)


def test_boxes_reach_the_edges_at_every_scale() -> None:
    levels = list(all_windows(noise(90, 120)))
    for number, windows in enumerate(levels):
        scale = SCALE_STEP**number
        np.testing.assert_allclose(windows.boxes[0], (0, 0, BOX[1] * scale, BOX[0] * scale))
        end = (windows.boxes[:, :2] + windows.boxes[:, 2:]).max(axis=0)
        assert (np.abs(end - (120, 90)) <= (STRIDE + 0.5) * scale).all()
        assert len(windows.boxes) == len(windows.deviation) == len(windows.starts)
    assert BOX[1] * SCALE_STEP ** len(levels) > 90, 'the largest boxes fill the image'


def test_an_image_smaller_than_a_box_has_no_windows() -> None:
    assert not list(all_windows(noise(BOX[0] - 1, 100)))
    boxes, scores = Cascade([]).detect(noise(100, BOX[1] - 1))
    assert boxes.shape == (0, 4)
    assert scores.shape == (0,)


def brighter_below(least: float, weight: float = 1.0) -> Stage:
    """Let pass windows whose lower half is brighter, in standard deviations."""
    below = Feature(GREY, 1, 0, 0, WINDOW[0] // 2, WINDOW[1])
    return Stage([below], [least], [weight], 0.0)


def test_a_stage_adds_and_subtracts_weights() -> None:
    windows = windows_of(noise(30, 40))
    numbers = numbers_of(windows)[::2]
    features = [Feature(GREY, 0, 0, 0, 10, 5), Feature(GRADIENT, WHOLE, 3, 3, 8, 8)]
    scores = Stage(features, [0.02, 1.0], [1.0, -0.25], 0.0).scores(windows, numbers)
    first = windows.values(features[0], numbers) > 0.02
    second = windows.values(features[1], numbers) > 1.0
    np.testing.assert_allclose(scores, np.where(first, 1, -1) - np.where(second, 0.25, -0.25))
    assert len(np.unique(scores)) == 4


def test_each_stage_only_sees_what_those_before_let_pass() -> None:
    seen: list[Numbers] = []

    class Watched(Stage):
        def scores(self, windows: Windows, numbers: Numbers) -> Values:
            seen.append(numbers)
            return super().scores(windows, numbers)

    def watched(stage: Stage) -> Stage:
        return Watched(stage.features, stage.thresholds, stage.weights, stage.min_score)

    windows = windows_of(noise(60, 80))
    stages = [brighter_below(0.0), brighter_below(0.05), brighter_below(0.0, weight=2.5)]
    numbers, scores = Cascade([watched(stage) for stage in stages]).survivors(windows)
    values = windows.values(stages[0].features[0], numbers_of(windows))
    np.testing.assert_array_equal(seen[0], numbers_of(windows))
    np.testing.assert_array_equal(seen[1], np.flatnonzero(values > 0))
    np.testing.assert_array_equal(seen[2], np.flatnonzero(values > 0.05))
    assert 0 < len(seen[2]) < len(seen[1]) < len(seen[0])
    np.testing.assert_array_equal(numbers, seen[2])
    np.testing.assert_array_equal(scores, 2.5)


def test_a_model_is_the_same_after_writing_and_reading() -> None:
    model = Cascade([brighter_below(0.1), brighter_below(-0.2, weight=0.3)])
    assert Cascade.from_json(model.to_json()) == model
    assert model.to_json().count('\n') == 2 + len(model.stages)


def boxes_at(*columns: float) -> NDArray[np.float64]:
    return np.array([(column, 0, 10, 10) for column in columns], np.float64)


def test_overlap_is_intersection_over_union() -> None:
    boxes = np.array([(0, 0, 10, 20)], np.float64)
    others = np.array([(0, 0, 10, 20), (5, 10, 10, 20), (10, 0, 5, 5), (2, 2, 2, 2)], np.float64)
    np.testing.assert_allclose(overlaps(boxes, others), [[1, 50 / 350, 0, 4 / 200]])


def test_the_better_one_of_two_overlapping_boxes_is_kept() -> None:
    # The second overlaps both neighbours too much, and these overlap each other little.
    boxes = boxes_at(0, 4, 8, 50)
    assert overlaps(boxes[:1], boxes[1:2])[0, 0] > MAX_OVERLAP > overlaps(boxes[:1], boxes[2:3])
    kept, scores = without_overlap(boxes, np.array([2.0, 1.0, 3.0, -5.0]))
    np.testing.assert_array_equal(kept, boxes_at(8, 0, 50))
    np.testing.assert_array_equal(scores, [3, 2, -5])
    kept, scores = without_overlap(boxes, np.array([2.0, 4.0, 3.0, -5.0]))
    np.testing.assert_array_equal(kept, boxes_at(4, 50))
    np.testing.assert_array_equal(scores, [4, -5])


def marked(boxes: Sequence[Any], shape: tuple[int, int]) -> NDArray[np.bool_]:
    return covered(np.array(boxes, np.float64).reshape(-1, 4), shape)


def test_the_mask_is_the_union_of_the_boxes() -> None:
    expected = np.zeros((20, 30), bool)
    expected[2:6, 3:13] = True
    expected[4:9, 10:16] = True
    boxes = [(3.2, 1.9, 10, 4), (10, 4, 6, 5)]
    np.testing.assert_array_equal(marked(boxes, (20, 30)), expected)
    assert not marked([], (20, 30)).any()


def test_boxes_end_with_the_image() -> None:
    area = marked([(20, 15, 100, 100)], (20, 30))
    assert area[15:, 20:].all()
    assert area.sum() == 5 * 10


def test_the_method_flags_boxes_of_the_left_image_alone() -> None:
    left, right = noise(90, 120), noise(90, 120, seed=1)
    method = BoostedCascade(Cascade([brighter_below(0.3)]))
    mask = method(CAMERA, left, right)
    boxes, _ = method.cascade.detect(left)
    assert len(boxes)
    np.testing.assert_array_equal(mask != 0, covered(boxes, left.shape))
    np.testing.assert_array_equal(mask, method(CAMERA, left, noise(90, 120, seed=2)))


def test_the_model_of_the_package_has_small_stages_first() -> None:
    stages = BoostedCascade().cascade.stages
    sizes = [len(stage.features) for stage in stages]
    assert sizes == sorted(sizes)
    assert len(sizes) > 3
    for stage in stages:
        assert len(stage.features) == len(stage.thresholds) == len(stage.weights)
        for feature in stage.features:
            cells = PATTERNS[feature.pattern].shape
            assert feature.row + cells[0] * feature.height <= WINDOW[0]
            assert feature.column + cells[1] * feature.width <= WINDOW[1]
            assert feature.channel == GRADIENT or feature.pattern != WHOLE


def test_the_model_of_the_package_finds_a_rock_with_its_shadow() -> None:
    image = np.full((90, 120), 130, np.float32)
    cv2.ellipse(image, (66, 52), (22, 9), 0, 0, 360, 40, cv2.FILLED)
    cv2.ellipse(image, (56, 45), (20, 15), 0, 0, 360, 190, cv2.FILLED)
    image += np.random.default_rng(0).normal(0, 4, image.shape)
    image = cv2.GaussianBlur(image, (0, 0), 0.8)
    grey = np.clip(image, 0, 255).astype(np.uint8)
    flagged = BoostedCascade()(CAMERA, grey, grey) != 0
    assert flagged[35:55, 42:70].mean() > 0.8
    assert flagged[:, :20].mean() < 0.2
