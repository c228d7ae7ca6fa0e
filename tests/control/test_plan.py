import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from loco_drake.common.errors import InputError
from loco_drake.control.plan import (
    PLAN_DT,
    join_plans,
    plan_from_motion,
    standing_plan,
)
from loco_drake.models.legs import LEGS
from loco_drake.models.robots import AddRobotModel
from loco_drake.motion.gaits import GaitLabel
from tests.synthetic_motion import synthetic_motion


@pytest.fixture(scope="module")
def plant():
    plant = MultibodyPlant(0.0)
    AddRobotModel(Parser(plant), "go2", visual=False)
    plant.Finalize()
    return plant


def test_q_and_v_are_in_the_order_of_the_plant(go2, plant):
    motion = synthetic_motion("dog-trot", 1.0, 0.5, 0.3)
    plan = plan_from_motion(go2, motion)
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, plan.q[7])
    plant.SetVelocities(context, plan.v[7])
    base = plant.GetBodyByName("base")
    X_WB = plant.EvalBodyPoseInWorld(context, base)
    V_WB = plant.EvalBodySpatialVelocityInWorld(context, base)
    np.testing.assert_allclose(X_WB.translation(), motion.base_position[7])
    np.testing.assert_allclose(V_WB.rotational(), motion.base_angular_velocity[7])
    np.testing.assert_allclose(V_WB.translational(), motion.base_velocity[7])
    for j, name in enumerate(motion.joint_names):
        joint = plant.GetJointByName(name)
        assert joint.get_angle(context) == motion.joint_positions[7, j]
        assert joint.get_angular_rate(context) == motion.joint_velocities[7, j]


def test_toes_are_where_the_plant_has_them(trot, plant):
    context = plant.CreateDefaultContext()
    for k in (0, 33, 120):
        plant.SetPositions(context, trot.q[k])
        for leg, p_WF in zip(LEGS, trot.p_WF[k], strict=True):
            frame = plant.GetFrameByName(f"{leg}_foot")
            X_WF = frame.CalcPoseInWorld(context)
            np.testing.assert_allclose(X_WF.translation(), p_WF, atol=1e-12)


def test_copies_are_the_same_object_and_arrays_read_only(trot):
    assert copy.deepcopy(trot) is trot
    assert copy.copy(trot) is trot
    with pytest.raises(ValueError, match="read-only"):
        trot.q[0, 0] = 2.0


def test_a_plan_does_not_change_with_the_arrays_that_it_was_made_of(trot):
    """Neither through an array, nor a view of it, nor a view of a frozen array."""
    q, v = trot.q.copy(), trot.v.copy()
    frozen = v[:]
    v.setflags(write=False)
    plan = replace(trot, q=q[:], v=v)
    q[:, 4] += 1.0
    frozen[:, 3] += 1.0
    np.testing.assert_array_equal(plan.q, trot.q)
    np.testing.assert_array_equal(plan.v, trot.v)


def test_a_plan_that_was_pickled_is_as_immutable(trot):
    """Worker processes get plans so."""
    plan = pickle.loads(pickle.dumps(trot))
    for name in (*_arrays(), "state", "p_BoF_H"):
        np.testing.assert_array_equal(getattr(plan, name), getattr(trot, name))
        assert not getattr(plan, name).flags.writeable


@pytest.mark.parametrize(
    ("name", "spoil", "message"),
    [
        ("q", lambda a: a[:, :-1], "its v one that goes"),
        ("q", lambda a: a[0], "q must have the shape"),
        ("v", lambda a: np.hstack((a, a)), "its v one that goes with that"),
        ("vdot", lambda a: a[:-1], "vdot"),
        ("p_WF", lambda a: a[:, :3], "p_WF"),
        ("contacts", lambda a: a.astype(float), "contacts must be of type bool"),
        ("labels", lambda a: a + 0.7, "labels must be of type int64"),
        ("labels", lambda a: a + 45, "indices from 0 to 44"),
        ("labels", lambda a: a - 5, "indices from 0 to 44"),
        ("path_time", lambda a: a[::-1], "path_time must never decrease"),
        ("q", lambda a: 1.1 * a, "length 1.1"),
        ("v", lambda a: a * np.nan, "must be finite"),
        ("q", lambda a: a.astype(str), "q must be of type float64"),
    ],
)
def test_what_is_no_plan_is_refused_by_the_arrays_name(trot, name, spoil, message):
    with pytest.raises(InputError, match=message):
        replace(trot, **{name: spoil(getattr(trot, name))})


def test_samples_are_due_on_the_plans_own_clock(trot):
    shifted = replace(trot, start_time=3.0)
    assert shifted.index(3.0) == 0
    assert shifted.index(3.0 + 7 * PLAN_DT) == 7
    assert shifted.index(3.0 + 7.4 * PLAN_DT) == 7
    assert shifted.index(0.0) == 0  # before it starts: its first sample
    assert shifted.index(99.0) == len(trot) - 1  # after it ends: its last
    assert shifted.end_time == pytest.approx(3.0 + 4.0)


def test_a_plan_cut_in_two_and_joined_is_the_plan(trot):
    tail = trot.slice(50)
    assert tail.start_time == pytest.approx(1.0)
    head = replace(trot, **{n: getattr(trot, n)[:50].copy() for n in _arrays()})
    joined = join_plans(head, tail)
    assert joined.start_time == trot.start_time
    for name in _arrays():
        np.testing.assert_array_equal(getattr(joined, name), getattr(trot, name))


def _arrays():
    return ("q", "v", "vdot", "p_WF", "contacts", "labels", "path_time")


def test_motion_of_another_rate_or_robot_is_refused(go2):
    motion = synthetic_motion("dog-trot", 1.0)
    with pytest.raises(InputError, match="25"):
        plan_from_motion(go2, replace(motion, fps=25.0))
    with pytest.raises(InputError, match="of a1, not of go2"):
        plan_from_motion(go2, replace(motion, robot="a1"))
    names = ("x", *motion.joint_names[1:])
    with pytest.raises(InputError, match=r"joints .* FL_hip_joint, FL_thigh_joint"):
        plan_from_motion(go2, replace(motion, joint_names=names))


def test_a_plan_has_the_gait_of_each_frame(go2):
    """Also one that no shipped network knows, and one that changes on the way."""
    motion = synthetic_motion("dog-trot", 1.0)
    waltz = GaitLabel("dog", "waltz")
    plan = plan_from_motion(go2, replace(motion, gait="waltz"))
    assert set(plan.labels) == {waltz.index}
    pace = GaitLabel("dog", "pace")
    several = replace(motion, gait_changes=((0, pace), (20, waltz)))
    labels = plan_from_motion(go2, several.slice(15, 45)).labels
    assert labels.tolist() == [pace.index] * 5 + [waltz.index] * 25


def test_the_standing_plan_has_its_soles_on_the_ground(go2):
    plan = standing_plan(go2)
    np.testing.assert_allclose(plan.p_WF[0, :, 2], go2.foot_radius, atol=1e-12)
