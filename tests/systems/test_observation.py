import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from loco_drake.control.observation import (
    LOOK_AHEAD,
    OBSERVATION_LAYOUT,
    OBSERVATION_SIZE,
    Preview,
    observe,
    preview,
)
from loco_drake.control.plan import PLAN_DT, make_plan
from loco_drake.motion.gaits import GAITS, SOURCES

TIME = 30 * PLAN_DT


@pytest.fixture
def state(trot):
    """Somewhere near the plan."""
    random = np.random.default_rng(1)
    state = trot.state[30] + 0.05 * random.standard_normal(37)
    state[:4] /= np.linalg.norm(state[:4])
    return state


def parts(observation):
    bounds = np.cumsum([size for _, size in OBSERVATION_LAYOUT])[:-1]
    names = [name for name, _ in OBSERVATION_LAYOUT]
    return dict(zip(names, np.split(observation, bounds), strict=True))


def test_each_part_is_what_the_layout_says(go2, trot, state):
    """By scipy's rotations, from the definitions."""
    action = np.linspace(-1, 1, 12)
    seen = parts(observe(go2, preview(trot, TIME), state, action))
    R_WB = Rotation.from_quat(state[:4], scalar_first=True)
    yaw = np.arctan2(R_WB.as_matrix()[1, 0], R_WB.as_matrix()[0, 0])
    R_HW = Rotation.from_euler("z", -yaw)
    np.testing.assert_allclose(seen["gravity_B"], R_WB.inv().apply([0, 0, -1]))
    np.testing.assert_allclose(seen["w_WB_B"], R_WB.inv().apply(state[19:22]))
    np.testing.assert_allclose(seen["v_WB_H"], R_HW.apply(state[22:25]))
    assert seen["height"] == state[6]
    np.testing.assert_allclose(seen["joint_positions"], state[7:19] - go2.stand_joints)
    np.testing.assert_allclose(seen["joint_velocities"], state[25:] / 10)
    np.testing.assert_array_equal(seen["last_action"], action)
    k = 30 + LOOK_AHEAD
    np.testing.assert_allclose(
        seen["plan_joint_velocities"], trot.v[31, 6:] / 10, atol=1e-12
    )
    np.testing.assert_allclose(
        seen["plan_joints"], (trot.q[k, 7:] - state[7:19]).ravel()
    )
    np.testing.assert_allclose(
        seen["plan_p_H"], R_HW.apply(trot.q[k, 4:7] - state[4:7]).ravel(), atol=1e-12
    )
    R_WP = Rotation.from_quat(trot.q[k, :4], scalar_first=True)
    np.testing.assert_allclose(
        seen["plan_R_B"], (R_WB.inv() * R_WP).as_rotvec().ravel(), atol=1e-9
    )
    np.testing.assert_allclose(
        seen["plan_v_H"], R_HW.apply(trot.v[k, 3:6]).ravel(), atol=1e-12
    )
    np.testing.assert_allclose(
        seen["plan_w_H"], R_HW.apply(trot.v[k, :3]).ravel(), atol=1e-12
    )
    np.testing.assert_array_equal(seen["plan_contacts"], trot.contacts[k].ravel())
    label = np.zeros(12)
    label[SOURCES.index("dog")] = label[4 + GAITS.index("trot")] = 1
    np.testing.assert_array_equal(seen["label"], label)


def test_it_does_not_depend_on_where_the_robot_goes(go2, trot, state):
    """World, robot and plan turned and moved together look the same."""
    action = np.zeros(12)
    turn = Rotation.from_euler("z", 2.0)
    shift = np.array([5.0, -3.0, 0.0])

    def moved(q, v):
        q, v = q.copy(), v.copy()
        own = Rotation.from_quat(q[..., :4], scalar_first=True)
        q[..., :4] = (turn * own).as_quat(scalar_first=True)
        q[..., 4:7] = turn.apply(q[..., 4:7]) + shift
        v[..., :3] = turn.apply(v[..., :3])
        v[..., 3:6] = turn.apply(v[..., 3:6])
        return q, v

    q, v = moved(trot.q, trot.v)
    plan = make_plan(
        go2, q=q, v=v, contacts=trot.contacts.copy(), labels=trot.labels.copy()
    )
    there = np.concatenate(moved(state[:19], state[19:]))
    np.testing.assert_allclose(
        observe(go2, preview(plan, TIME), there, action),
        observe(go2, preview(trot, TIME), state, action),
        atol=1e-9,
    )


def test_at_the_plans_end_its_last_sample_is_shown(go2, trot, state):
    seen = parts(observe(go2, preview(trot, trot.end_time), state, np.zeros(12)))
    joints = seen["plan_joints"].reshape(len(LOOK_AHEAD), 12)
    np.testing.assert_array_equal(joints, np.tile(joints[0], (len(LOOK_AHEAD), 1)))


def test_many_robots_are_observed_at_once(go2, trot, state):
    ahead = preview(trot, TIME)
    many = Preview(
        *(np.stack([x, x]) for x in (ahead.q, ahead.v, ahead.contacts, ahead.label))
    )
    states = np.stack([state, trot.state[30]])
    seen = observe(go2, many, states, np.zeros((2, 12)))
    for own, state_i in zip(seen, states, strict=True):
        alone = observe(go2, ahead, state_i, np.zeros(12))
        np.testing.assert_allclose(own, alone, rtol=1e-12, atol=1e-15)


def test_the_layout_adds_up(go2, trot, state):
    assert observe(go2, preview(trot, TIME), state, np.zeros(12)).shape == (
        OBSERVATION_SIZE,
    )
