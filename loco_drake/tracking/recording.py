"""What a robot did with a motion, as motion: the next references to learn from.

A policy tracks a motion in simulation, and what the robot did is written down. It obeys
physics, contact and motors included, as no recording of an animal does (Xu et al. 2025,
"PARC"). The base's own drift remains. Contacts are those that were planned: toes that
stand are fixed in place, and all is smoothed, as in retargeting.
"""

from dataclasses import dataclass

import numpy as np
import torch

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.common.rotations import quat_conjugate, quat_continuous, quat_rotate
from loco_drake.control.actor import Actor
from loco_drake.control.plan import Plan
from loco_drake.control.state import JOINTS, ORIENTATION, POSITION
from loco_drake.models.robots import Robot
from loco_drake.motion.motion import FPS, Motion, make_motion
from loco_drake.retargeting.correction import plant_feet, smooth
from loco_drake.retargeting.inverse_kinematics import LegSolver
from loco_drake.tracking.batch import TrackingBatch
from loco_drake.tracking.config import EnvironmentConfig, ResetNoise
from loco_drake.tracking.references import smooth_motions

# Cut-offs of what simulation adds, such as the ringing of a landing, Hz.
BASE_CUTOFF, TOE_CUTOFF = 8.0, 12.0

# So that attempts differ; on the plan otherwise.
_NOISE = ResetNoise(joints=0.01, velocities=0.05, position=0.0, heading=0.0)


@dataclass(frozen=True)
class Recording:
    """The best of some attempts at a motion."""

    motion: Motion  # what the robot did
    normalized_return: float  # of 100, see docs/tracking.md


def record(
    robot: Robot,
    actor: Actor,
    motion: Motion,
    *,
    attempts: int = 4,
    seed: int = 0,
    solver: LegSolver | None = None,
) -> Recording | None:
    """Returns the attempt with the highest return, None if all lose the motion.

    Raises:
        InputError: if the motion is of another robot, at another rate, or of several
            gaits.
    """
    if motion.gait_changes:
        raise InputError("Motion of several gaits cannot be recorded.")
    (plan,) = smooth_motions(robot, [motion])
    config = EnvironmentConfig(robot=robot.name, reset_noise=_NOISE)
    config.episode_steps = len(plan)
    batch = TrackingBatch([plan], config, attempts)
    random = np.random.default_rng(seed)
    for i in range(attempts):
        batch.reset(i, random, plan=0, sample=0)
    states, rewards = [batch.states], np.zeros(attempts)
    kept = np.ones(attempts, dtype=bool)
    for _ in range(len(plan) - 1):
        with torch.inference_mode():
            actions = actor(torch.from_numpy(batch.observe())).numpy()
        terms, lost, _ = batch.step(actions)
        kept &= ~lost
        rewards += terms.sum(axis=1)
        states.append(batch.states)
    if not kept.any():
        return None
    best = int(np.where(kept, rewards, -np.inf).argmax())
    q = np.array(states)[:, best, : 7 + len(robot.joint_names)]
    score = 100 * float(rewards[best]) / (len(plan) - 1)
    made = as_motion(robot, motion, plan, q, solver or LegSolver(robot, FPS))
    return Recording(made, score)


def as_motion(
    robot: Robot, motion: Motion, plan: Plan, q: Array, solver: LegSolver
) -> Motion:
    """Returns positions ``q`` (T, 7 + J) of a robot that tracked ``plan`` as motion.

    Label and provenance are those of ``motion``, which the plan was made of.
    """
    p_WB = smooth(q[POSITION], BASE_CUTOFF, FPS)
    q_WB = smooth(quat_continuous(q[ORIENTATION]), BASE_CUTOFF, FPS)
    q_WB = q_WB / np.linalg.norm(q_WB, axis=1, keepdims=True)
    p_BF = robot.toe_positions(q[JOINTS])
    p_WF = q[POSITION][:, None] + quat_rotate(q[ORIENTATION][:, None], p_BF)
    p_WF = plant_feet(p_WF, plan.contacts, robot.foot_radius, TOE_CUTOFF, FPS)
    p_BF = quat_rotate(quat_conjugate(q_WB)[:, None], p_WF - p_WB[:, None])
    # What was known of the motion before is not known of what was made of it.
    known = {k: v for k, v in motion.provenance.items() if "momentum_error" not in k}
    return make_motion(
        robot=robot.name,
        label=motion.label,
        joint_names=robot.joint_names,
        base_position=p_WB,
        base_quaternion=q_WB,
        joint_positions=solver.solve(robot.reachable_toes(p_BF)).joints,
        contacts=plan.contacts.copy(),
        provenance=known,
    )
