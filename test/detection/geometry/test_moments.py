"""Planes from moments."""

from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.geometry.moments import Moments, planes_from_moments


def moments_of(u, v, h, weight):
    def total(values, a, b):
        return np.array([np.sum(weight * values * u**a * v**b)])

    powers = (0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)
    sums = [total(np.ones_like(u), *each) for each in powers]
    heights = [total(h, *each) for each in powers[:3]]
    return Moments(*sums, *heights)


@pytest.fixture
def points():
    generator = np.random.default_rng(1)
    centre = np.array([[2.0], [-1.0], [0.0]])
    return centre + generator.normal(size=(3, 40)), generator.uniform(size=40)


def test_plane_is_recovered(points):
    (u, v, _), weight = points
    found = planes_from_moments(moments_of(u, v, 0.3 + 0.2 * u - 0.1 * v, weight))
    assert found.height[0] == pytest.approx(0.3)
    assert found.rise_u[0] == pytest.approx(0.2)
    assert found.rise_v[0] == pytest.approx(-0.1)


def test_fit_is_that_of_weighted_least_squares(points):
    (u, v, h), weight = points
    found = planes_from_moments(moments_of(u, v, h, weight))
    design = np.column_stack((np.ones_like(u), u, v)) * np.sqrt(weight)[:, np.newaxis]
    expected, *_ = np.linalg.lstsq(design, h * np.sqrt(weight), rcond=None)
    fitted = [found.height[0], found.rise_u[0], found.rise_v[0]]
    np.testing.assert_allclose(fitted, expected, rtol=1e-9)


def test_points_on_a_line_have_no_determinant():
    u = np.arange(5.0)
    found = planes_from_moments(moments_of(u, 2 * u, u, np.ones(5)))
    assert found.determinant[0] == pytest.approx(0, abs=1e-9)
    assert planes_from_moments(moments_of(u, 2 * u, u, np.ones(5)), ridge=0.5).determinant[0] > 0.1


def test_ridge_is_added_to_both_variances(points):
    (u, v, h), weight = points
    moments = moments_of(u, v, h, weight)
    plain, ridged = planes_from_moments(moments), planes_from_moments(moments, ridge=0.5)
    assert ridged.variance_u == pytest.approx(plain.variance_u + 0.5)
    assert ridged.variance_v == pytest.approx(plain.variance_v + 0.5)
    assert ridged.covariance == plain.covariance


def test_without_points_the_plane_is_zero():
    nothing = np.zeros(0)
    found = planes_from_moments(moments_of(nothing, nothing, nothing, nothing))
    assert found.height[0] == found.rise_u[0] == found.rise_v[0] == 0
