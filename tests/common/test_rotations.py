"""Held against scipy, single quaternions and arrays of them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from loco_drake.common import rotations as mut


@pytest.fixture
def quaternions():
    """Some at random, and the awkward: none, nearly none, half a turn, sign flipped."""
    q = np.random.default_rng(0).standard_normal((20, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    awkward = [[1, 0, 0, 0], [-1, 0, 0, 0], [1, 1e-12, 0, 0], [0, 0, 0.6, 0.8]]
    return np.concatenate((q, awkward))


def of(q):
    return Rotation.from_quat(q, scalar_first=True)


def test_products(quaternions):
    a, b = quaternions[:-1], quaternions[1:]
    expected = (of(a) * of(b)).as_matrix()
    np.testing.assert_allclose(
        of(mut.quat_multiply(a, b)).as_matrix(), expected, atol=1e-12
    )
    for i in range(len(a)):
        single = mut.quat_multiply(a[i], b[i])
        np.testing.assert_allclose(of(single).as_matrix(), expected[i], atol=1e-12)
    np.testing.assert_allclose(
        mut.quat_multiply(a[0], b), mut.quat_multiply(a[:1], b), atol=1e-15
    )


def test_rotating_vectors(quaternions):
    p = np.random.default_rng(1).standard_normal((len(quaternions), 3))
    expected = of(quaternions).apply(p)
    np.testing.assert_allclose(mut.quat_rotate(quaternions, p), expected, atol=1e-12)
    back = mut.quat_rotate(mut.quat_conjugate(quaternions), expected)
    np.testing.assert_allclose(back, p, atol=1e-12)


def test_matrices(quaternions):
    expected = of(quaternions).as_matrix()
    np.testing.assert_allclose(mut.quat_to_matrix(quaternions), expected, atol=1e-12)
    for q, R in zip(quaternions, expected, strict=True):
        np.testing.assert_allclose(mut.quat_to_matrix(q), R, atol=1e-12)


def test_logarithm_and_exponential(quaternions):
    vectors = mut.quat_log(quaternions)
    assert np.linalg.norm(vectors, axis=1).max() <= np.pi + 1e-12
    np.testing.assert_allclose(
        Rotation.from_rotvec(vectors).as_matrix(),
        of(quaternions).as_matrix(),
        atol=1e-12,
    )
    np.testing.assert_allclose(
        of(mut.quat_exp(vectors)).as_matrix(), of(quaternions).as_matrix(), atol=1e-12
    )


def test_errors_are_in_so3_and_expressed_in_the_world(quaternions):
    a, b = quaternions[:10], quaternions[10:20]
    expected = (of(b) * of(a).inv()).as_rotvec()
    np.testing.assert_allclose(mut.quat_error(a, b), expected, atol=1e-9)
    for i in range(len(a)):
        np.testing.assert_allclose(mut.quat_error(a[i], b[i]), expected[i], atol=1e-9)
    np.testing.assert_allclose(mut.quat_error(a[0], -a[0]), 0.0, atol=1e-9)


def test_headings():
    yaw = np.linspace(-3, 3, 7)
    tilted = Rotation.from_euler("z", yaw[:, None]) * Rotation.from_euler("y", 0.4)
    q = tilted.as_quat(scalar_first=True)
    np.testing.assert_allclose(mut.yaw_of(q), yaw)
    np.testing.assert_allclose(mut.yaw_of(mut.yaw_quat(yaw)), yaw)
    for q_WB, angle in zip(q, yaw, strict=True):
        R_WH = mut.heading_matrix(mut.quat_to_matrix(q_WB))
        expected = Rotation.from_euler("z", angle).as_matrix()
        np.testing.assert_allclose(R_WH, expected, atol=1e-12)
    straight_up = Rotation.from_euler("y", -np.pi / 2).as_matrix()
    assert np.isfinite(mut.heading_matrix(straight_up)).all()


def test_vectors_turn_in_the_plane():
    random = np.random.default_rng(2)
    vectors, angles = random.standard_normal((5, 2)), random.uniform(-7, 7, 5)
    turns = Rotation.from_rotvec(np.outer(angles, [0, 0, 1]))
    expected = turns.apply(np.pad(vectors, ((0, 0), (0, 1))))[:, :2]
    np.testing.assert_allclose(mut.rotate_plane(vectors, angles), expected, atol=1e-12)


def test_signs_are_made_continuous(quaternions):
    q = mut.quat_continuous(quaternions)
    assert ((q[1:] * q[:-1]).sum(axis=1) >= 0).all()
    np.testing.assert_allclose(np.abs(q), np.abs(quaternions))


def test_angular_velocity_of_a_steady_turn():
    w_W = np.array([0.3, -1.0, 2.0])
    start = Rotation.from_euler("xyz", [0.2, 0.5, -0.4])
    t = np.arange(50)[:, None] * 0.02
    q = (Rotation.from_rotvec(t * w_W) * start).as_quat(scalar_first=True)
    q[10:20] *= -1
    expected = np.tile(w_W, (50, 1))
    np.testing.assert_allclose(mut.angular_velocity(q, 0.02), expected, atol=1e-9)
