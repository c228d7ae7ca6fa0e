"""Grounding: the trunk's motion nearest to a given one that the feet's forces explain.

Toes keep their paths in the world, and with them footholds, clearance, stride period
and phase lags. In each frame the trunk is turned by a small rotation vector theta and
shifted by d, both in the world, and the legs follow. With x = [theta, d] of all frames
and f the forces of the feet in contact, a convex program finds the minimum:

    min  |x|^2 + |D x|^2 + |change of joints|^2 + |change of f|^2 + |s|^2
    s.t. s = what f does not give of the wrench [L', m (c'' - g)],
         f within friction and never pulling, 0 in the air,
         joints within limits of position and speed, knees above the ground,

where each term is weighted, s most, and D are third differences; the change of f is
that from frame to frame. c and L are of all bodies, as in
:mod:`loco_drake.motion.momentum`. They are linearized about the last iterate, as are
joints, knees and the arms of the forces, and the program is solved again until these
agree. A flight that cannot be as long as planned keeps its duration and some error.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from loco_drake.common.arrays import Array, Bools
from loco_drake.common.rotations import (
    quat_conjugate,
    quat_error,
    quat_exp,
    quat_multiply,
    quat_rotate,
)
from loco_drake.models.robots import Robot
from loco_drake.motion.momentum import (
    free_fall_error,
    mass_model,
    momentum_error,
    positions,
)
from loco_drake.motion.motion import Motion, make_motion
from loco_drake.motion.quality import distance_rmse, toe_trajectories
from loco_drake.retargeting.correction import KNEE_CLEARANCE
from loco_drake.retargeting.grounding_program import (
    GroundingConfig,
    Linearization,
    solve_step,
)
from loco_drake.retargeting.inverse_kinematics import LegSolver

_DAMPING = 1e-6  # m^2/rad^2, of legs that are nearly straight
# Of the speed limits, which inverse kinematics meets to a thousandth.
_SPEED_SHARE = 0.98
_CLOSE_ENOUGH = 1e-3  # m and rad, of a step
_STEP = 1e-6  # m and rad, of differences


@dataclass(frozen=True)
class GroundingReport:
    """What physics a grounded motion obeys, and how far it was moved for that."""

    free_fall_error_mps2: float | None  # see motion.momentum
    momentum_error: float  # the same
    # Before grounding.
    free_fall_error_before_mps2: float | None
    momentum_error_before: float
    # Of the toes relative to the trunk, in its frame; in the world they are not moved.
    ground_correction_rmse_m: float
    joint_correction_rmse_rad: float  # over frames and joints
    base_shift_rmse_m: float
    base_turn_rmse_rad: float


class Grounded(NamedTuple):
    """The result of :func:`ground`."""

    motion: Motion  # its provenance has the figures of the report
    report: GroundingReport
    solved: Bools  # frames for which inverse kinematics found a solution, (T,)


def ground(
    motion: Motion,
    robot: Robot,
    solver: LegSolver | None = None,
    config: GroundingConfig | None = None,
) -> Grounded:
    """Returns ``motion`` with the trunk moved as the forces of its feet allow.

    Args:
        motion: motion of ``robot`` whose contacts say which feet stand.
        robot: the robot, with its masses.
        solver: a solver for the robot's legs at the motion's rate.
        config: weights; see :class:`.grounding_program.GroundingConfig`.
    """
    config = config or GroundingConfig()
    solver = solver or LegSolver(robot, motion.fps)
    p_WF = toe_trajectories(motion, robot)
    q = positions(motion)
    forces = np.zeros_like(p_WF)
    for _ in range(config.iterations):
        step, forces = solve_step(linearize(motion, robot, q, p_WF, forces), config)
        q = _moved(q, step, p_WF, robot)
        if np.abs(step).max() < _CLOSE_ENOUGH:
            break
    joints, solved = solver.solve(_in_trunk(q, p_WF))
    grounded = make_motion(
        robot=motion.robot,
        label=motion.label,
        joint_names=motion.joint_names,
        base_position=q[:, 4:7],
        base_quaternion=q[:, :4],
        joint_positions=joints,
        contacts=motion.contacts,
        provenance=motion.provenance,
        fps=motion.fps,
    )
    report = grounding_report(motion, grounded, robot)
    told = {k: f"{x:.6g}" for k, x in vars(report).items() if x is not None}
    grounded = replace(
        grounded,
        gait_changes=motion.gait_changes,
        provenance={**motion.provenance, **told},
    )
    return Grounded(grounded, report, solved)


def grounding_report(before: Motion, after: Motion, robot: Robot) -> GroundingReport:
    """Returns what grounding did to the motion ``before``."""
    toes = [
        _in_trunk(positions(motion), toe_trajectories(motion, robot))
        for motion in (before, after)
    ]
    turn = quat_error(before.base_quaternion, after.base_quaternion)
    joints = after.joint_positions - before.joint_positions
    return GroundingReport(
        free_fall_error_mps2=free_fall_error(after, robot),
        momentum_error=momentum_error(after, robot),
        free_fall_error_before_mps2=free_fall_error(before, robot),
        momentum_error_before=momentum_error(before, robot),
        ground_correction_rmse_m=distance_rmse(*toes),
        joint_correction_rmse_rad=float(np.sqrt((joints**2).mean())),
        base_shift_rmse_m=distance_rmse(before.base_position, after.base_position),
        base_turn_rmse_rad=float(np.sqrt((turn**2).sum(axis=1).mean())),
    )


def linearize(
    motion: Motion, robot: Robot, q: Array, p_WF: Array, forces: Array
) -> Linearization:
    """Returns the motion at ``q`` and its derivatives by the trunk's pose, toes fixed.

    Args:
        motion: the motion before grounding.
        robot: the robot, with its masses.
        q: the last iterate, shape (T, 7 + J).
        p_WF: toes in m, shape (T, 4, 3).
        forces: of the feet in the last iterate, in robot weights, shape (T, 4, 3).
    """
    model = mass_model(robot)
    velocities = following(q, p_WF, robot)
    matrices = model.momentum_matrices(q, velocities)
    momentum = model.momentum(q, motion.fps)
    start = positions(motion)
    knees, knee_matrices = _knee_heights(q, p_WF, robot)
    return Linearization(
        moved=np.hstack((quat_error(start[:, :4], q[:, :4]), (q - start)[:, 4:7])),
        com=momentum.com,
        com_matrices=matrices[:, 3:] / model.mass,
        angular=momentum.angular,
        angular_matrices=matrices[:, :3],
        joints=q[:, 7:],
        joints_moved=(q - start)[:, 7:],
        joint_matrices=velocities[:, 6:],
        joint_lower=robot.joint_lower,
        joint_upper=robot.joint_upper,
        joint_step=_SPEED_SHARE * robot.joint_speed_limits / motion.fps,
        knees=knees - KNEE_CLEARANCE,
        knee_matrices=knee_matrices,
        soles=p_WF - [0.0, 0.0, robot.foot_radius],
        forces=forces,
        contacts=motion.contacts,
        mass=model.mass,
        height=robot.stand_height,
        fps=motion.fps,
    )


def following(q: Array, p_WF: Array, robot: Robot) -> Array:
    """Returns velocities v (T, 6 + J, 6) of a robot whose toes stand still.

    Column n is for a trunk whose [w_WB_W, v_WB_W] is the n-th unit vector.
    """
    frames = len(q)
    # The velocity of a point of the trunk at the toe, by column: w x p + v.
    turning = np.cross(np.eye(3), (p_WF - q[:, None, 4:7])[:, :, None])
    moving = np.broadcast_to(np.eye(3), turning.shape)
    toes_W = np.concatenate((turning, moving), axis=2)  # (T, 4, 6, 3)
    toes_B = quat_rotate(quat_conjugate(q[:, None, None, :4]), toes_W)
    J = robot.toe_jacobians(q[:, 7:])  # (T, 4, 3, n)
    JT = np.swapaxes(J, -1, -2)
    damped = JT @ J + _DAMPING * np.eye(J.shape[-1])
    joints = -np.linalg.solve(damped, JT @ np.swapaxes(toes_B, -1, -2))
    trunk = np.broadcast_to(np.eye(6), (frames, 6, 6))
    return np.concatenate((trunk, joints.reshape(frames, -1, 6)), axis=1)


def _knee_heights(q: Array, p_WF: Array, robot: Robot) -> tuple[Array, Array]:
    """Returns the knees' heights in m, (T, 4), and their derivatives, (T, 4, 6)."""

    def heights(q: Array) -> Array:
        p_BKnee = robot.knee_positions(q[:, 7:])
        z: Array = q[:, None, 6] + quat_rotate(q[:, None, :4], p_BKnee)[..., 2]
        return z

    steps = _STEP * np.eye(6)
    ahead = [heights(_moved(q, step[None], p_WF, robot)) for step in steps]
    behind = [heights(_moved(q, -step[None], p_WF, robot)) for step in steps]
    difference = (np.array(ahead) - np.array(behind)) / (2 * _STEP)
    return heights(q), np.moveaxis(difference, 0, -1)


def _moved(q: Array, step: Array, p_WF: Array, robot: Robot) -> Array:
    """Returns ``q`` with the trunk moved by steps (T or 1, 6), the toes at p_WF."""
    moved = q.copy()
    moved[:, :4] = quat_multiply(quat_exp(step[:, :3]), q[:, :4])
    moved[:, 4:7] += step[:, 3:]
    moved[:, 7:] = robot.nearest_joints(_in_trunk(moved, p_WF))
    return moved


def _in_trunk(q: Array, p_WF: Array) -> Array:
    """Returns p_BF of toes p_WF, both in m and of shape (T, 4, 3)."""
    return quat_rotate(quat_conjugate(q[:, None, :4]), p_WF - q[:, None, 4:7])
