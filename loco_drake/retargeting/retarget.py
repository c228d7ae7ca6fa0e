"""One recording of an animal -> one Motion of a robot."""

import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from loco_drake import motion_quality as quality
from loco_drake.gaits import GaitLabel
from loco_drake.keypoints import KeypointClip
from loco_drake.models.kinematics import leg_joints, toe_positions
from loco_drake.models.robots import Robot
from loco_drake.motion import FPS, Motion, make_motion
from loco_drake.retargeting.config import RetargetConfig, load_config
from loco_drake.retargeting.contacts import detect_contacts, resample_contacts
from loco_drake.retargeting.feet import plant_feet
from loco_drake.retargeting.inverse_kinematics import LegSolver
from loco_drake.retargeting.scaling import (
    Targets,
    resample,
    scale_to_robot,
    stance_height,
)
from loco_drake.retargeting.smoothing import smooth
from loco_drake.retargeting.trunk import folded_length, raise_trunk
from loco_drake.rotations import quat_rotate


@dataclass(frozen=True)
class RetargetReport:
    """How well one clip was retargeted, see :mod:`loco_drake.motion_quality`.

    Attributes:
        frames: of the motion.
        frames_per_second: frames of the motion per second of computing.
        toe_error_rmse_m: of the toes against the targets that the solver was given.
        correction_rmse_m: of those targets against the paper's formula.
        trunk_correction_rmse_m: of the trunk's position against the paper's formula.
        stance_slip_median_mps: None if no toe ever stands.
        penetration_max_m: deepest.
        joint_limit_violations: number of joint angles.
        joint_speed_ratio_max: highest speed over its limit.
        scale: the robot's stance height over the animal's.
    """

    frames: int
    frames_per_second: float
    toe_error_rmse_m: float
    correction_rmse_m: float
    trunk_correction_rmse_m: float
    stance_slip_median_mps: float | None
    penetration_max_m: float
    joint_limit_violations: int
    joint_speed_ratio_max: float
    scale: float


def retarget_clip(
    clip: KeypointClip,
    robot: Robot,
    *,
    config: RetargetConfig | None = None,
    solver: LegSolver | None = None,
) -> tuple[Motion, RetargetReport]:
    """Returns ``clip`` as a motion of ``robot`` at 50 Hz, and how good it is.

    Args:
        clip: at any rate.
        robot: to move.
        config: of the clip's source; the shipped one if None.
        solver: of this robot, to be used again for many clips.

    Raises:
        InputError: if the clip is too short or not of an animal on its feet.
    """
    began = time.perf_counter()
    config = config or load_config(clip.source)
    solver = solver or LegSolver(robot, FPS)
    height = stance_height(clip, config)
    raw_contacts = detect_contacts(clip, height, config.contact)
    resampled = resample(clip, FPS)
    formula = scale_to_robot(resampled, height, robot, config)
    contacts = resample_contacts(raw_contacts, clip.fps, FPS, len(resampled))
    targets = correct(formula, contacts, robot, config)
    joints = solver.solve(targets.p_BF)
    motion = make_motion(
        robot=robot.name,
        label=GaitLabel(clip.source, clip.gait),
        joint_names=robot.joint_names,
        base_position=targets.p_WB,
        base_quaternion=targets.q_WB,
        joint_positions=joints,
        contacts=contacts,
        provenance=clip.provenance,
    )
    seconds = time.perf_counter() - began
    p_WF = quality.toe_trajectories(motion, robot)
    report = RetargetReport(
        frames=len(motion),
        frames_per_second=len(motion) / seconds,
        toe_error_rmse_m=quality.distance_rmse(p_WF, targets.p_WF),
        correction_rmse_m=quality.distance_rmse(targets.p_WF, formula.p_WF),
        trunk_correction_rmse_m=quality.distance_rmse(targets.p_WB, formula.p_WB),
        stance_slip_median_mps=quality.stance_slip_median(p_WF, robot.foot_radius, FPS),
        penetration_max_m=quality.penetration_max(p_WF, robot.foot_radius),
        joint_limit_violations=quality.joint_limit_violations(joints, robot),
        joint_speed_ratio_max=quality.joint_speed_ratio_max(joints, robot, FPS),
        scale=robot.stand_height / height,
    )
    kept = ("scale", "toe_error_rmse_m", "correction_rmse_m")
    figures = {name: f"{getattr(report, name):.6g}" for name in kept}
    return replace(motion, provenance={**motion.provenance, **figures}), report


def correct(
    formula: Targets,
    contacts: NDArray[np.bool_],
    robot: Robot,
    config: RetargetConfig,
) -> Targets:
    """Returns targets at 50 Hz that a robot can follow, near to the formula's.

    Trunk and toes move smoothly, toes in contact stand still on the ground, those that
    swing stay above it, none is nearer or further than its leg reaches, and the trunk
    is high enough for the legs to fold and the knees to clear the ground.
    """
    smoothing = config.smoothing
    targets = Targets(
        p_WB=smooth(formula.p_WB, smoothing.base, FPS),
        yaw=smooth(formula.yaw, smoothing.base, FPS),
        pitch=smooth(formula.pitch, smoothing.base, FPS),
        p_WF=plant_feet(formula.p_WF, contacts, robot.foot_radius, smoothing.toes, FPS),
    )
    return within_reach(raise_trunk(targets, robot, FPS), robot)


def within_reach(targets: Targets, robot: Robot) -> Targets:
    """Returns ``targets`` with toes that the joints' limits do not allow moved nearer.

    A toe nearer to its hip than the leg folds is moved down the trunk's z axis. A leg
    that is too short points at its target, which comes to lie at its end.
    """
    p_BF = targets.p_BF
    x, y, z = np.moveaxis(p_BF - robot.p_BHip, -1, 0)
    # In the plane of the leg, whose distance from the hip's axis is the offset.
    square = 1.001 * folded_length(robot) ** 2 + robot.abduction_offset**2
    drop = np.sqrt(np.maximum(square - x**2 - y**2, 0.0))
    lowered = p_BF.copy()
    lowered[..., 2] = np.minimum(p_BF[..., 2], robot.p_BHip[:, 2] - drop)
    folds = x**2 + y**2 + z**2 < square
    goal = np.where(folds[..., None], lowered, p_BF)
    joints = np.clip(leg_joints(robot, goal), robot.joint_lower, robot.joint_upper)
    reachable = toe_positions(robot, joints)
    beyond = np.linalg.norm(reachable - p_BF, axis=-1, keepdims=True) > 1e-9
    p_WF = targets.p_WB[:, None] + quat_rotate(targets.q_WB[:, None], reachable)
    return replace(targets, p_WF=np.where(beyond, p_WF, targets.p_WF))
