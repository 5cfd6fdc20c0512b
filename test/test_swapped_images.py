from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.swapped_images import are_swapped

CAMERA = StereoCamera(
    width=320, height=240, fx=200.0, fy=200.0, cx=159.5, cy=119.5, baseline_m=0.1
)


def pair(shift: int) -> tuple[np.ndarray, np.ndarray]:
    texture = np.random.default_rng(1).integers(0, 256, (240, 480), np.uint8)
    return texture[:, 80:400], texture[:, 80 + shift : 400 + shift]


@pytest.mark.parametrize('shift', [5, 20, 60])
def test_only_the_wrong_order_is_reported_as_swapped(shift: int) -> None:
    left, right = pair(shift)

    assert not are_swapped(left, right, CAMERA)
    assert are_swapped(right, left, CAMERA)


def test_an_offset_of_the_principal_points_is_not_a_swap() -> None:
    camera = StereoCamera(
        width=320, height=240, fx=200.0, fy=200.0, cx=159.5, cy=119.5, baseline_m=0.1,
        cx_right=189.5,
    )  # fmt: skip
    left, right = pair(-10)

    assert not are_swapped(left, right, camera)
    assert are_swapped(left, right, CAMERA)


def test_images_without_matches_are_not_reported_as_swapped() -> None:
    noise = np.random.default_rng(2).integers(0, 256, (2, 240, 320), np.uint8)
    dark = np.zeros((240, 320), np.uint8)

    assert not are_swapped(noise[0], noise[1], CAMERA)
    assert not are_swapped(dark, dark, CAMERA)
