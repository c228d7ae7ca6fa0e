import numpy as np
import pytest

from loco_drake.common.rotations import quat_rotate
from loco_drake.generation import features as ft
from loco_drake.generation.footing import start_footing, step_footing
from loco_drake.models.robots import get_robot
from tests.generation.paths import integrate_path

GO2 = get_robot("go2")
ORIGIN = np.zeros((1, 3))


def toes_of(q):
    p_BF = GO2.toe_positions(q[..., 7:])
    return quat_rotate(q[..., None, :4], p_BF) + q[..., None, 4:7]


def slip(q, contacts):
    """Median speed in m/s of feet that stand in two frames."""
    standing = contacts[1:] & contacts[:-1]
    return np.median(
        np.linalg.norm(np.diff(toes_of(q)[..., :2], axis=0), axis=-1)[standing] * 50
    )


def test_a_motion_without_slip_is_left_alone(make_synthetic):
    features = ft.motion_features(GO2, make_synthetic("dog-trot", 2.0, 0.8))[None]
    _, q, contacts = step_footing(GO2, start_footing(ORIGIN), features)
    plain = ft.positions(GO2, features, integrate_path(GO2, features, ORIGIN))
    np.testing.assert_allclose(q, plain, atol=2e-3)
    assert (contacts == (features[..., ft.CONTACTS] > 0.5)).all()


def test_feet_of_a_motion_that_slips_stand(make_synthetic):
    """A base that is told 1.15 times the speed of its legs slips .12 m/s."""
    features = ft.motion_features(GO2, make_synthetic("dog-trot", 4.0, 0.8))[None]
    features[..., 0] *= 1.15
    plain = ft.positions(GO2, features, integrate_path(GO2, features, ORIGIN))
    down = features[0, :, ft.CONTACTS] > 0.5
    assert slip(plain[0], down) == pytest.approx(0.12, abs=0.01)
    _, q, contacts = step_footing(GO2, start_footing(ORIGIN), features)
    assert slip(q[0], contacts[0]) < 1e-3
    # The path is now nearer to what the feet say.
    true, raw, mended = 0.8 * 4.0, plain[0, -1, 4], q[0, -1, 4]
    assert abs(mended - true) < 0.8 * abs(raw - true)


def test_the_base_is_drawn_to_its_feet_without_a_jolt(make_synthetic):
    """Its correction changes by at most .15 (.05 * 60 mm + itself) a frame."""
    features = ft.motion_features(GO2, make_synthetic("dog-trot", 4.0, 0.8))[None]
    features[..., 0] *= 1.15
    plain = ft.positions(GO2, features, integrate_path(GO2, features, ORIGIN))
    _, q, _ = step_footing(GO2, start_footing(ORIGIN), features)
    correction = np.diff((q - plain)[0, :, 4:6], axis=0)
    assert np.abs(correction).max() > 5e-4
    assert np.abs(np.diff(correction, axis=0)).max() < 2 * 0.15 * 0.05 * 0.06


def test_no_toe_is_below_the_ground(make_synthetic):
    features = ft.motion_features(GO2, make_synthetic("dog-pace", 2.0, 0.8))[None]
    features[..., ft.HEIGHT] -= 0.03 / GO2.stand_height
    plain = ft.positions(GO2, features, integrate_path(GO2, features, ORIGIN))
    assert toes_of(plain)[..., 2].min() < GO2.foot_radius - 0.025
    _, q, _ = step_footing(GO2, start_footing(ORIGIN), features)
    assert toes_of(q)[..., 2].min() > GO2.foot_radius - 1e-9


def test_a_contact_must_be_likely_to_begin_and_unlikely_to_end(make_synthetic):
    features = ft.motion_features(GO2, make_synthetic("dog-pace", 2.0, 0.8))[None]
    features[..., ft.CONTACTS] = 0.0
    likely = [0.5, 0.6, 0.5, 0.5, 0.4, 0.5]
    features[0, : len(likely), ft.CONTACTS.start] = likely
    _, _, contacts = step_footing(GO2, start_footing(ORIGIN), features)
    assert contacts[0, :6, 0].tolist() == [False, True, True, True, False, False]


def test_frames_in_two_parts_are_those_in_one(make_synthetic):
    random = np.random.default_rng(0)
    features = ft.motion_features(GO2, make_synthetic("dog-trot", 2.0, 0.8, 0.5))
    features = np.stack((features, features[::-1]))
    features += random.normal(scale=0.02, size=features.shape)
    start = start_footing(np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]]))
    _, whole, contacts = step_footing(GO2, start, features)
    middle, a, contacts_a = step_footing(GO2, start, features[:, :33])
    _, b, contacts_b = step_footing(GO2, middle, features[:, 33:])
    np.testing.assert_array_equal(np.concatenate((a, b), axis=1), whole)
    np.testing.assert_array_equal(
        np.concatenate((contacts_a, contacts_b), axis=1), contacts
    )


def test_joints_stay_within_their_limits(make_synthetic):
    random = np.random.default_rng(0)
    features = ft.motion_features(GO2, make_synthetic("dog-trot", 2.0, 0.8))[None]
    features[..., ft.JOINTS] += random.normal(scale=0.8, size=(1, 101, 12))
    _, q, _ = step_footing(GO2, start_footing(ORIGIN), features)
    assert (q[..., 7:] >= GO2.joint_lower).all()
    assert (q[..., 7:] <= GO2.joint_upper).all()


def test_a_leg_that_cannot_fold_raises_the_base(make_synthetic):
    """At a quarter of the stand height calves are at their limit."""
    features = ft.motion_features(GO2, make_synthetic("dog-pace", 1.0, 0.0))[None]
    features[..., ft.HEIGHT] = 0.25
    _, q, _ = step_footing(GO2, start_footing(ORIGIN), features)
    assert (q[..., 7:] >= GO2.joint_lower).all()
    assert (q[..., 6] > 0.3 * GO2.stand_height).all()
    assert toes_of(q)[..., 2].min() > GO2.foot_radius - 1e-3
