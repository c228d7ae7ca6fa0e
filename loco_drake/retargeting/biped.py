"""Retargeting of human clips to motions of a humanoid."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.tree import ModelInstanceIndex

from loco_drake.common.arrays import Array, Bools
from loco_drake.common.rotations import quat_conjugate, quat_rotate
from loco_drake.models.biped import Biped
from loco_drake.motion import quality
from loco_drake.motion.biped_clip import BipedClip
from loco_drake.motion.gaits import GaitLabel
from loco_drake.motion.motion import FPS, Motion, make_motion
from loco_drake.retargeting.biped_correction import correct
from loco_drake.retargeting.biped_scaling import (
    BipedTargets,
    foot_marks,
    scale_to_biped,
    upper_marks,
)
from loco_drake.retargeting.bounds import judged
from loco_drake.retargeting.contacts import UPRIGHT
from loco_drake.retargeting.inverse_kinematics import Linkage, PointSolver, Solution
from loco_drake.retargeting.preparation import prepare
from loco_drake.retargeting.scaling import (
    AS_RECORDED,
    RetargetConfig,
    Variant,
    load_config,
    resample_points,
    smoothing_in_time,
)

_ROUNDS = 4
_SAME_PITCH = 2e-3  # rad


@dataclass(frozen=True)
class BipedReport:
    """Quality of one retargeted clip; names are those of :class:`.RetargetReport`.

    Slip, depth, limits and speeds are computed from joints and pelvis alone, by the
    functions of :mod:`loco_drake.motion.quality`, of all eight spheres of the soles.
    """

    frames: int  # of the motion
    frames_per_second: float  # frames of the motion per second of computing
    toe_error_rmse_m: float  # of the feet against the targets that the solver was given
    correction_rmse_m: float  # of the soles' targets against the paper's formula
    trunk_correction_rmse_m: float  # of the pelvis against the paper's formula
    arm_error_rmse_m: float  # of elbows and wrists against their targets
    stance_slip_median_mps: float | None  # None if no foot ever stands
    penetration_max_m: float  # deepest, of a sole
    joint_limit_violations: int  # number of joint angles
    joint_limit_margin_rad: float  # smallest distance of a joint from its limit
    joint_speed_ratio_max: float  # highest speed over its limit
    scale: float  # the robot's hip height over the person's
    time_scale: float  # how long the motion lasts, over the recording
    mirrored: bool  # whether left and right are exchanged
    on_feet_share: float  # of the frames in which the person is on its feet
    feet_apart_min_m: float  # smallest distance between the middles of the soles
    lowest_joint_m: float  # height of the lowest joint over the ground, feet excluded
    unsolved_frames: int  # for which inverse kinematics of legs or arms failed
    # A sentence for each figure outside its bound, see bounds.
    warnings: tuple[str, ...] = ()


class BipedSolver:
    """Solves for the joints of one humanoid: its legs exactly, the rest nearly."""

    def __init__(self, robot: Biped, fps: float) -> None:
        self.robot = robot
        count = robot.leg_joints
        feet = [(f, p) for f in robot.foot_frames for p in foot_marks(robot)]
        legs = _linkage(robot, robot.AddLegs, slice(count), tuple(feet))
        upper = _linkage(
            robot, robot.AddUpperBody, slice(count, None), upper_marks(robot)
        )
        self.legs = PointSolver(legs, fps)
        self.upper = PointSolver(upper, fps, exact=False)

    def solve_legs(self, targets: BipedTargets) -> Solution:
        """Returns the legs' joints in rad, as they are ordered."""
        p_BF = in_trunk(targets, targets.foot_points(self.robot))
        return self.legs.solve(p_BF.reshape(len(p_BF), -1, 3))

    def foot_pitches(self, targets: BipedTargets, joints: Array) -> Array:
        """Returns the pitches (T, 2) in rad of the feet that the legs' joints give."""
        p_B = np.array([self.legs.positions(q) for q in joints])
        left, right, heel = np.moveaxis(p_B.reshape(len(p_B), 2, 3, 3), 2, 0)
        sole = quat_rotate(targets.q_WB[:, None], (left + right) / 2 - heel)
        ahead = sole[..., 0] * np.cos(targets.yaw) + sole[..., 1] * np.sin(targets.yaw)
        return np.arctan2(sole[..., 2], ahead)


def retarget_biped(
    clip: BipedClip,
    robot: Biped,
    *,
    config: RetargetConfig | None = None,
    solver: BipedSolver | None = None,
    variant: Variant = AS_RECORDED,
) -> tuple[Motion, BipedReport]:
    """Returns ``clip`` as a motion of ``robot`` at 50 Hz, and a report on its quality.

    Contacts are those of toes left and right and of heels, in the places of FL, FR, RL
    and RR.

    Raises:
        InputError: if the clip is too short.
    """
    began = time.perf_counter()
    config = config or load_config(clip.source)
    solver = solver or BipedSolver(robot, FPS)
    clip = clip.mirrored() if variant.mirror else clip
    height = config.stance_height or float(np.median(clip.middle[:, 2]))
    ready = prepare(clip, height, robot.hip_height, config, variant, resample_biped)
    formula = scale_to_biped(ready.clip, height, robot, config)
    config = smoothing_in_time(config, ready.time_scale)
    targets, (joints, solved) = follow(formula, ready.contacts, solver, config)
    motion = make_motion(
        robot=robot.name,
        label=GaitLabel(clip.source, clip.gait),
        joint_names=robot.joint_names,
        base_position=targets.p_WB,
        base_quaternion=targets.q_WB,
        joint_positions=joints,
        contacts=ready.contacts,
        provenance=ready.clip.provenance,
    )
    seconds = time.perf_counter() - began
    p_WF = quality.toe_trajectories(motion, robot)
    soles = p_WF.reshape(len(p_WF), 2, 2, 2, 3).mean(axis=(1, 3))
    upper = joints[:, robot.leg_joints :]
    placed = np.array([solver.upper.positions(q) for q in upper])
    margins = np.minimum(joints - robot.joint_lower, robot.joint_upper - joints)
    report = BipedReport(
        frames=len(motion),
        frames_per_second=len(motion) / seconds,
        toe_error_rmse_m=quality.distance_rmse(soles, targets.p_WS),
        correction_rmse_m=quality.distance_rmse(targets.p_WS, formula.p_WS),
        trunk_correction_rmse_m=quality.distance_rmse(targets.p_WB, formula.p_WB),
        arm_error_rmse_m=quality.distance_rmse(placed[:, 3:], targets.p_BUpper[:, 3:]),
        stance_slip_median_mps=quality.stance_slip_median(p_WF, robot.foot_radius, FPS),
        penetration_max_m=quality.penetration_max(p_WF, robot.foot_radius),
        joint_limit_violations=quality.joint_limit_violations(joints, robot),
        joint_limit_margin_rad=float(margins.min()),
        joint_speed_ratio_max=quality.joint_speed_ratio_max(joints, robot, FPS),
        scale=ready.scale,
        time_scale=ready.time_scale,
        mirrored=variant.mirror,
        on_feet_share=float(on_feet(clip).mean()),
        feet_apart_min_m=float(
            np.linalg.norm(soles[:, 0] - soles[:, 1], axis=-1).min()
        ),
        lowest_joint_m=_lowest_joint(motion, robot),
        unsolved_frames=int((~solved).sum()),
    )
    return judged(motion, report, robot)


def follow(
    formula: BipedTargets, contacts: Bools, solver: BipedSolver, config: RetargetConfig
) -> tuple[BipedTargets, Solution]:
    """Returns corrected targets, and joints for them.

    Where an ankle cannot turn as far as the formula asks, the sole's pitch is what it
    can reach, and its lower end is planted anew.
    """
    asked, robot = formula, solver.robot
    bent = np.zeros_like(formula.pitch, dtype=bool)
    for _ in range(_ROUNDS):
        targets = correct(asked, contacts, bent, robot, config)
        legs = solver.solve_legs(targets)
        reached = solver.foot_pitches(targets, legs.joints)
        off = np.abs(reached - targets.pitch) > _SAME_PITCH
        if not off.any():
            break
        bent |= off
        asked = replace(asked, pitch=np.where(off, reached, asked.pitch))
    upper = solver.upper.solve(targets.p_BUpper)
    joints = np.concatenate((legs.joints, upper.joints), axis=1)
    return targets, Solution(joints, legs.solved & upper.solved)


def resample_biped(clip: BipedClip, fps: float) -> BipedClip:
    """Returns the clip at ``fps``; see :func:`.scaling.resample`."""
    parts = (clip.spine, clip.legs, clip.arms)
    spine, legs, arms = resample_points(parts, clip.fps, fps)
    return replace(clip, fps=fps, spine=spine, legs=legs, arms=arms)


def on_feet(clip: BipedClip) -> Bools:
    """Returns in which frames the person is on its feet, or over them, shape (T,).

    Then the hips are nearly as high over the lower foot as they are far from it, and
    the neck is above them.
    """
    soles = clip.legs[:, :, 3:].mean(axis=2)
    k = soles[..., 2].argmin(axis=1)
    lower = soles[np.arange(len(soles)), k]
    away = np.linalg.norm(clip.middle - lower, axis=-1)
    over = clip.middle[:, 2] - lower[:, 2] > UPRIGHT * away
    spine = clip.spine[:, 2] - clip.middle
    return over & (spine[:, 2] > UPRIGHT / 2 * np.linalg.norm(spine, axis=-1))


def in_trunk(targets: BipedTargets, points: Array) -> Array:
    """Returns points (T, ..., 3) in W as they are in B, m."""
    extra = (1,) * (points.ndim - 2)
    q_BW = quat_conjugate(targets.q_WB).reshape(-1, *extra, 4)
    return quat_rotate(q_BW, points - targets.p_WB.reshape(-1, *extra, 3))


def _linkage(
    robot: Biped,
    add_model: Callable[[Parser], ModelInstanceIndex],
    joints: slice,
    points: tuple[tuple[str, Array], ...],
) -> Linkage:
    return Linkage(
        add_model=add_model,
        trunk_frame=robot.trunk_frame,
        joint_names=robot.joint_names[joints],
        lower=robot.joint_lower[joints],
        upper=robot.joint_upper[joints],
        speed_limits=robot.joint_speed_limits[joints],
        rest=robot.stand_joints[joints],
        points=points,
    )


def _lowest_joint(motion: Motion, robot: Biped) -> float:
    """Returns the least height of the joints but those at the ankles, m."""
    p_B = robot.joint_origins(motion.joint_positions)
    p_W = quat_rotate(motion.base_quaternion[:, None], p_B)
    heights = motion.base_position[:, None, 2] + p_W[..., 2]
    half = robot.leg_joints // 2
    ankles = {k + side * half for side in (0, 1) for k in (half - 2, half - 1)}
    others = [k for k in range(heights.shape[1]) if k not in ankles]
    return float(heights[:, others].min(initial=inf))
