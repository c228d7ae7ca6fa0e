import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from loco_drake.control.reward import reward_terms

JOINTS, JOINT_VELOCITIES, TOES, POSE, VELOCITY = range(5)


def terms_at_40(robot, plan, state):
    return reward_terms(robot, plan.state[40], plan.p_BoF_H[40], state)


@pytest.fixture
def state(trot):
    return trot.state[40].copy()


def test_a_perfect_match_is_worth_one(go2, trot, state):
    terms = terms_at_40(go2, trot, state)
    np.testing.assert_allclose(terms, [0.5, 0.05, 0.2, 0.15, 0.1])
    assert terms.sum() == pytest.approx(1.0)


def test_joints_fall_with_the_sum_of_squares(go2, trot, state):
    state[7:19] += 0.1
    terms = terms_at_40(go2, trot, state)
    assert terms[JOINTS] == pytest.approx(0.5 * np.exp(-5 * 12 * 0.01))
    assert terms[POSE] == pytest.approx(0.15)


def test_joint_velocities(go2, trot, state):
    state[25] += 3.0
    terms = terms_at_40(go2, trot, state)
    assert terms[JOINT_VELOCITIES] == pytest.approx(0.05 * np.exp(-0.1 * 9))
    np.testing.assert_allclose(terms[[0, 2, 3, 4]], [0.5, 0.2, 0.15, 0.1])


def test_toes_are_compared_from_each_base_in_its_own_heading(go2, trot, state):
    """Moving or turning the robot as a whole leaves its toes where they were."""
    state[4:7] += [0.3, -0.2, 0.05]
    turn = Rotation.from_euler("z", 0.4)
    own = Rotation.from_quat(state[:4], scalar_first=True)
    state[:4] = (turn * own).as_quat(scalar_first=True)
    assert terms_at_40(go2, trot, state)[TOES] == pytest.approx(0.2)


def test_toes_fall_with_their_distance(go2, trot, state):
    """Hip and thigh at rest, calf alone turned: the toe moves by a chord."""
    state[9] += 0.2
    chord = 2 * go2.calf_length * np.sin(0.1)
    terms = terms_at_40(go2, trot, state)
    assert terms[TOES] == pytest.approx(0.2 * np.exp(-40 * chord**2))


def test_the_base_falls_with_distance_and_with_the_angle_in_so3(go2, trot, state):
    state[4:7] += [0.1, 0.0, -0.05]
    turn = Rotation.from_rotvec([0.1, -0.2, 0.3])
    own = Rotation.from_quat(state[:4], scalar_first=True)
    state[:4] = (turn * own).as_quat(scalar_first=True)
    terms = terms_at_40(go2, trot, state)
    e_p, e_R = 0.1**2 + 0.05**2, 0.1**2 + 0.2**2 + 0.3**2
    assert terms[POSE] == pytest.approx(0.15 * np.exp(-20 * e_p - 10 * e_R))


def test_the_sign_of_a_quaternion_does_not_matter(go2, trot, state):
    state[:4] *= -1
    assert terms_at_40(go2, trot, state).sum() == pytest.approx(1.0)


def test_base_velocity(go2, trot, state):
    state[19:25] += [0.5, 0.0, 0.0, 0.0, 0.2, 0.0]
    terms = terms_at_40(go2, trot, state)
    expected = 0.1 * np.exp(-2 * 0.2**2 - 0.2 * 0.5**2)
    assert terms[VELOCITY] == pytest.approx(expected)


def test_many_robots_are_scored_at_once(go2, trot, state):
    random = np.random.default_rng(0)
    states = state + 0.05 * random.standard_normal((6, 37))
    states[:, :4] /= np.linalg.norm(states[:, :4], axis=1, keepdims=True)
    together = reward_terms(go2, trot.state[40:46], trot.p_BoF_H[40:46], states)
    for k in range(6):
        alone = reward_terms(go2, trot.state[40 + k], trot.p_BoF_H[40 + k], states[k])
        np.testing.assert_allclose(together[k], alone, rtol=1e-12)
