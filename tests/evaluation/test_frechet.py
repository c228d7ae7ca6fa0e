import numpy as np
import pytest
from scipy.linalg import sqrtm

from loco_drake.evaluation.distances import frechet_distance, moments

UNIFORM = np.ones(200)


def features(seed=0, shift=0.0):
    random = np.random.default_rng(seed)
    return random.normal(size=(200, 5)) @ np.diag([1.0, 2, 3, 0.5, 0.1]) + shift


def test_a_set_and_itself():
    a = moments(features(), UNIFORM)
    assert frechet_distance(a, a) == pytest.approx(0.0, abs=1e-9)


def test_a_shift_counts_its_square():
    """By (3, 4, 0, 0, 0): 25."""
    a = moments(features(), UNIFORM)
    b = moments(features(shift=np.array([3.0, 4, 0, 0, 0])), UNIFORM)
    assert frechet_distance(a, b) == pytest.approx(25.0)


def test_one_dimension_by_hand():
    """Deviations 1 and 3 (2 and 0 apart, and 6 and 0): (3 - 1)^2, and no shift."""
    a = moments(np.array([[-1.0], [1.0]]), np.ones(2))
    b = moments(np.array([[-3.0], [3.0]]), np.ones(2))
    assert frechet_distance(a, b) == pytest.approx(4.0, abs=1e-5)


def test_against_the_matrix_root():
    a, b = (moments(features(seed), UNIFORM) for seed in (0, 1))
    b = (b[0], b[1] + 0.3 * np.ones((5, 5)))
    root = sqrtm(a[1] @ b[1]).real
    expected = ((a[0] - b[0]) ** 2).sum() + np.trace(a[1] + b[1] - 2 * root)
    assert frechet_distance(a, b) == pytest.approx(expected, rel=1e-4)


def test_singular_covariances_do_no_harm():
    """Fewer vectors than channels."""
    a = moments(features()[:3], np.ones(3))
    assert frechet_distance(a, a) == pytest.approx(0.0, abs=1e-6)
    b = moments(features(1)[:3], np.ones(3))
    assert 0 < frechet_distance(a, b) < np.inf


def test_moments_weigh_rows_and_share_among_sides():
    """A vector that weighs 3 is three vectors; two sides of a row are half each."""
    rows = features()[:4]
    mean, covariance = moments(rows[:2], np.array([1.0, 3.0]))
    np.testing.assert_allclose(mean, (rows[0] + 3 * rows[1]) / 4)
    repeated = rows[[0, 1, 1, 1]]
    np.testing.assert_allclose(covariance, np.cov(repeated.T, bias=True), atol=1e-12)
    sides = moments(rows.reshape(2, 2, 5), np.ones(2))
    np.testing.assert_allclose(sides[1], np.cov(rows.T, bias=True), atol=1e-12)
