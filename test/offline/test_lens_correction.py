import cv2
import numpy as np
import pytest
from synthetic import pinhole

from rover_obstacle_detection.detection.rectification.lens_distortion import (
    NO_DISTORTION,
    LensDistortion,
    Lenses,
)
from rover_obstacle_detection.messages.calibration import CameraInfo, StereoCalibration
from rover_obstacle_detection.messages.rectification import Rectification
from rover_obstacle_detection.offline.inspection.lens_correction import (
    difference,
    median_lenses,
    with_lens,
    without_border,
)

CAMERA = pinhole(320, 240, 75.0, 0.1)
K = (CAMERA.fx, 0, CAMERA.cx, 0, CAMERA.fy, CAMERA.cy, 0, 0, 1)
P = (CAMERA.fx, 0, CAMERA.cx, -20.0, 0, CAMERA.fy, CAMERA.cy, 0, 0, 0, 1, 0)
STRAIGHT = tuple(np.identity(3).ravel())
TURNED = tuple(cv2.Rodrigues(np.array([0.01, -0.02, 0.005]))[0].ravel())
LENS = LensDistortion(0.03, -0.01)


def rectified_places(info):
    """Column and row in the raw image of each pixel of the rectified image."""
    columns, rows = np.indices(CAMERA.shape, np.float32)[::-1]
    rectification = Rectification(info, 'test')
    image = np.dstack([columns, rows, np.zeros_like(rows)])
    return rectification(image)[..., :2]


@pytest.mark.parametrize(
    ('model', 'd', 'r'),
    [
        ('plumb_bob', (0.0,) * 5, STRAIGHT),
        ('', (), STRAIGHT),
        ('plumb_bob', (-0.2, 0.04, 0.001, 0.0, 0.0), TURNED),
        ('rational_polynomial', (0.1, 0.05, 0.0, 0.0, 0.01, 0.3, 0.02, 0.0), TURNED),
        ('equidistant', (0.01, -0.005, 0.0, 0.0), TURNED),
    ],
)
def test_rectification_also_removes_the_distortion(model, d, r):
    info = CameraInfo(320, 240, model, d, K, r, P)
    changed, off_px = with_lens(info, LENS)
    assert off_px < 0.2
    assert (changed.k, changed.r, changed.p) == (info.k, info.r, info.p)
    assert changed.distortion_model == model

    x, y = CAMERA.rays()
    stretch = 1 + LENS.stretch(x, y)
    columns, rows = x * stretch * CAMERA.fx + CAMERA.cx, y * stretch * CAMERA.fy + CAMERA.cy
    former = rectified_places(info)
    wanted = cv2.remap(former, columns, rows, cv2.INTER_LINEAR, borderValue=(-1, -1))
    found = rectified_places(changed)
    inside = (wanted.min(axis=-1) > 1) & (found.min(axis=-1) > 1)
    inside &= (columns < 318) & (rows < 238)
    assert inside.mean() > 0.7
    assert np.abs(wanted - former)[inside].max() > 2
    assert np.quantile(np.abs(wanted - found)[inside], 0.99) < 0.5


def test_without_other_distortion_the_coefficients_are_the_lens_s():
    info, off_px = with_lens(CameraInfo(320, 240, 'plumb_bob', (), K, STRAIGHT, P), LENS)
    assert info.d == pytest.approx((0.03, -0.01, 0, 0, 0), abs=1e-6)
    assert off_px == pytest.approx(0, abs=1e-4)


def test_a_lens_without_distortion_changes_nothing():
    info = CameraInfo(320, 240, 'plumb_bob', (0.1, 0, 0, 0, 0), K, TURNED, P)
    assert with_lens(info, NO_DISTORTION) == (info, 0)


def test_coefficients_about_a_far_axis_do_not_fit():
    aside = tuple(cv2.Rodrigues(np.array([0.0, 0.4, 0.0]))[0].ravel())
    _, off_px = with_lens(CameraInfo(320, 240, 'equidistant', (0.0,) * 4, K, aside, P), LENS)
    assert off_px > 0.2


def stereo(*lenses):
    projections = (*P[:3], 0.0, *P[4:]), P
    left, right = (
        with_lens(CameraInfo(320, 240, 'plumb_bob', (), K, STRAIGHT, p), lens)[0]
        for lens, p in zip(lenses, projections, strict=True)
    )
    return StereoCalibration(left, right, 'test')


def test_images_are_enlarged_until_no_border_is_black():
    former, changed = stereo(NO_DISTORTION, NO_DISTORTION), stereo(LENS, NO_DISTORTION)
    assert Rectification(changed.left, 'test').seen_share < 0.98
    found = without_border(changed, former)
    assert 1.01 < found.camera.fx / CAMERA.fx < 1.1
    assert found.camera.fy / CAMERA.fy == pytest.approx(found.camera.fx / CAMERA.fx)
    assert found.camera.baseline_m == pytest.approx(changed.camera.baseline_m)
    assert (found.camera.cx, found.camera.cy) == (CAMERA.cx, CAMERA.cy)
    assert (found.left.k, found.left.d) == (changed.left.k, changed.left.d)
    assert Rectification(found.left, 'test').seen_share > 0.999
    assert (
        np.count_nonzero(Rectification(found.left, '')(np.ones(CAMERA.shape, np.uint8)) == 0) < 20
    )


def test_images_without_a_black_border_keep_their_focal_length():
    barrel = LensDistortion(-0.03)
    changed = stereo(barrel, barrel)
    assert without_border(changed, stereo(NO_DISTORTION, NO_DISTORTION)) is changed


def test_the_difference_has_nothing_in_common():
    found = difference(Lenses(LensDistortion(0.03, -0.01), LensDistortion(-0.01, 0.01)))
    assert found.left.coefficients == pytest.approx((0.02, -0.01, 0))
    assert found.right.coefficients == pytest.approx((-0.02, 0.01, 0))
    assert not difference(Lenses(LENS, LENS))


def test_outliers_do_not_move_the_median():
    lenses = [Lenses(LensDistortion(k1, k2)) for k1, k2 in ((0.01, 0), (0.03, -0.005), (0.2, 0.1))]
    found = median_lenses(lenses, CAMERA)
    assert found.left.coefficients == pytest.approx((0.03, -0.005, 0), abs=1e-6)
    assert not found.right
    assert not median_lenses([Lenses(), Lenses(), lenses[0]], CAMERA)
