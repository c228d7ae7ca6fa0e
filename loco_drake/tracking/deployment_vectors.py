"""Five situations with what an exported policy observes and does in them."""

from typing import Any

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.rotations import quat_exp, quat_multiply, yaw_quat
from loco_drake.control.action import joint_targets, set_points
from loco_drake.control.actor import Actor
from loco_drake.control.actor_file import act
from loco_drake.control.observation import LOOK_AHEAD, observe, preview
from loco_drake.control.plan import PLAN_DT, Plan, make_plan
from loco_drake.control.state import ORIENTATION, split, unit_base
from loco_drake.models.robots import Robot
from loco_drake.motion.gaits import any_label

COUNT = 5
TOLERANCE = 1e-5  # of observation, action and target: networks compute in 32 bits


def make_vectors(actor: Actor, robot: Robot) -> list[dict[str, Any]]:
    """Returns COUNT situations, the same for each export of a policy.

    Each holds

    - q (19,), v (18,), last_action (12,): the state of the robot and its last action
    - plan_q (K, 19), plan_v (K, 18), plan_contacts (K, 4): the K samples ahead of the
      plan; plan_q_now (19,), plan_v_now (18,): the sample that is due
    - label: the plan's
    - observation, action (12,), set_points (12,) of the plan, and target (12,), what
      the PD is given
    - of a policy with a history memory and next_memory; in the first situation an
      episode begins
    """
    random = np.random.default_rng(0)
    labels = actor.config.labels
    vectors = []
    for i in range(COUNT):
        memory = random.standard_normal(actor.memory_size) * (i > 0)
        memory[:1] = np.sign(i)  # whether the episode has begun
        label = labels[i % len(labels)]
        vectors.append(_vector(actor, robot, random, label, memory))
    return vectors


def _vector(
    actor: Actor,
    robot: Robot,
    random: np.random.Generator,
    label: str,
    memory: Array,
) -> dict[str, Any]:
    plan = _plan(robot, random, any_label(label).index)
    state = unit_base(plan.state[0] + 0.05 * random.standard_normal(37))
    # A quaternion and its negative are the same orientation.
    state[ORIENTATION] *= random.choice((-1.0, 1.0))
    last_action = random.standard_normal(12)
    ahead = preview(plan, 0.0)
    observation = observe(robot, ahead, state, last_action)
    action, next_memory = act(actor, observation, memory)
    due = set_points(robot, plan)[1]
    q, v = split(state)
    values: dict[str, Array] = {
        "q": q,
        "v": v,
        "last_action": last_action,
        "plan_q": ahead.q,
        "plan_v": ahead.v,
        "plan_contacts": ahead.contacts.astype(np.float64),
        "plan_q_now": plan.q[0],
        "plan_v_now": plan.v[0],
        "observation": observation,
        "action": action,
        "set_points": due,
        "target": joint_targets(due, action)[:12],
    }
    if actor.memory_size:
        values |= {"memory": memory, "next_memory": next_memory}
    return {"label": label, **{name: x.tolist() for name, x in values.items()}}


def _plan(robot: Robot, random: np.random.Generator, label: int) -> Plan:
    """Returns a short plan near the standing pose, with any heading."""
    times = PLAN_DT * np.arange(LOOK_AHEAD[-1] + 1)[:, None]
    v0, slope = random.standard_normal(18), 4 * random.standard_normal(18)
    v = v0 + slope * times
    change = v0 * times + slope * times**2 / 2
    yaw = yaw_quat(random.uniform(-np.pi, np.pi, ()))
    orientation = quat_multiply(quat_exp(change[:, :3]), yaw)
    position = random.standard_normal(3) * [2.0, 2.0, 0.03]
    position[2] += robot.stand_height
    joints = robot.stand_joints + 0.2 * random.standard_normal(12)
    q = np.hstack((orientation, position + change[:, 3:6], joints + change[:, 6:]))
    return make_plan(
        robot,
        q=q,
        v=v,
        contacts=random.random((len(q), 4)) < 0.6,
        labels=np.full(len(q), label),
    )
