"""Retargeting of one recording of an animal to one Motion of a robot."""

import time
from dataclasses import asdict, dataclass, replace

import numpy as np

from loco_drake.models.quadruped import Quadruped
from loco_drake.motion import quality
from loco_drake.motion.gaits import GaitLabel
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.motion.motion import FPS, Motion, make_motion
from loco_drake.retargeting.bounds import outside_bounds
from loco_drake.retargeting.contacts import detect_contacts, resample_contacts
from loco_drake.retargeting.correction import correct
from loco_drake.retargeting.inverse_kinematics import LegSolver
from loco_drake.retargeting.scaling import (
    AS_RECORDED,
    Variant,
    frames_on_feet,
    in_time,
    on_feet,
    resample,
    scale_to_robot,
    smoothing_in_time,
    stance_height,
    track_width,
)
from loco_drake.retargeting.source_config import RetargetConfig, load_config


@dataclass(frozen=True)
class RetargetReport:
    """Quality of one retargeted clip, see :mod:`loco_drake.motion.quality`.

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
        time_scale: how long the motion lasts, over the recording.
        mirrored: whether left and right are exchanged.
        on_feet_share: share of the recording's frames in which the animal is on its
            feet; None where the source's configuration says how high it stands.
        on_feet_frames: those frames, in the recording's numbers, such as "240-420".
        trunk_height_ratio: median height of the recording's trunk over the stance
            height that the scale is of.
        toes_in_place_share: share of the frames in which a toe is on its own side of
            the trunk, and a front toe ahead of the rear one, of the worst toe.
        source_track_m: how far left of the right toes the recording's left ones are.
        unsolved_frames: for which inverse kinematics found no solution.
        warnings: a sentence for each figure outside its bound, see :mod:`.bounds`.
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
    time_scale: float
    mirrored: bool
    on_feet_share: float | None
    on_feet_frames: str | None
    trunk_height_ratio: float
    toes_in_place_share: float
    source_track_m: float
    unsolved_frames: int
    warnings: tuple[str, ...] = ()


def retarget_clip(
    clip: KeypointClip,
    robot: Quadruped,
    *,
    config: RetargetConfig | None = None,
    solver: LegSolver | None = None,
    variant: Variant = AS_RECORDED,
) -> tuple[Motion, RetargetReport]:
    """Returns ``clip`` as a motion of ``robot`` at 50 Hz, and a report on its quality.

    Args:
        clip: at any rate.
        robot: to move.
        config: of the clip's source; the shipped one if None.
        solver: of this robot, to be used again for many clips.
        variant: the clip mirrored, or in time for the animal's Froude number.

    Raises:
        InputError: if the clip is too short or not of an animal on its feet.
    """
    began = time.perf_counter()
    config = config or load_config(clip.source)
    solver = solver or LegSolver(robot, FPS)
    clip = clip.mirrored() if variant.mirror else clip
    height = stance_height(clip, config)
    scale = robot.stand_height / height
    raw_contacts = detect_contacts(clip, height, config.contact)
    time_scale = variant.time_scale(scale)
    timed = in_time(clip, time_scale)
    resampled = resample(timed, FPS)
    formula = scale_to_robot(resampled, height, robot, config)
    contacts = resample_contacts(raw_contacts, timed.fps, FPS, len(resampled))
    targets = correct(formula, contacts, robot, smoothing_in_time(config, time_scale))
    joints, solved = solver.solve(targets.p_BF)
    motion = make_motion(
        robot=robot.name,
        label=GaitLabel(clip.source, clip.gait),
        joint_names=robot.joint_names,
        base_position=targets.p_WB,
        base_quaternion=targets.q_WB,
        joint_positions=joints,
        contacts=contacts,
        provenance=timed.provenance,
    )
    seconds = time.perf_counter() - began
    p_WF = quality.toe_trajectories(motion, robot)
    standing = None if config.stance_height is not None else on_feet(clip)
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
        scale=scale,
        time_scale=time_scale,
        mirrored=variant.mirror,
        on_feet_share=None if standing is None else float(standing.mean()),
        on_feet_frames=None if standing is None else frames_on_feet(clip, standing),
        trunk_height_ratio=float(
            np.median((clip.withers + clip.hip)[:, 2]) / 2 / height
        ),
        toes_in_place_share=quality.toes_in_place_share(joints, robot),
        source_track_m=track_width(clip),
        unsolved_frames=int((~solved).sum()),
    )
    report = replace(report, warnings=outside_bounds(asdict(report), robot))
    kept = ("scale", "toe_error_rmse_m", "correction_rmse_m")
    figures = {name: f"{getattr(report, name):.6g}" for name in kept}
    if report.warnings:
        figures["warnings"] = "; ".join(report.warnings)
    return replace(motion, provenance={**motion.provenance, **figures}), report
