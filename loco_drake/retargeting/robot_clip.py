"""A robot's motion as keypoints, to be retargeted to another robot as an animal's is.

The motion's toes stand still, its contacts are sharp and nothing in it is noise. The
robot's virtual hips are where :mod:`loco_drake.retargeting.scaling` puts the other
robot's, so legs that hang straight down do so again. Roll of the trunk is lost, as that
of animals is; grounding gives it back.
"""

import numpy as np

from loco_drake.common.errors import InputError
from loco_drake.common.rotations import quat_rotate
from loco_drake.models.quadruped import Quadruped
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.motion.motion import Motion
from loco_drake.motion.quality import toe_trajectories
from loco_drake.retargeting.inverse_kinematics import LegSolver
from loco_drake.retargeting.report import RetargetReport
from loco_drake.retargeting.retarget import retarget_clip
from loco_drake.retargeting.scaling import (
    AS_RECORDED,
    ContactConfig,
    RetargetConfig,
    SmoothingConfig,
    Variant,
)

# A toe in stance is on the ground and still, one that swings soon neither.
_CONTACT = ContactConfig(
    land_height=0.06,
    leave_height=0.08,
    land_speed=0.15,
    land_speed_ratio=0.05,
    leave_speed=0.25,
    leave_speed_ratio=0.1,
    shortest_stance=0.03,
    shortest_swing=0.03,
)
_SMOOTHING = SmoothingConfig(base=8.0, toes=10.0)


def retarget_motion(
    motion: Motion,
    known: Quadruped,
    robot: Quadruped,
    solver: LegSolver | None = None,
    variant: Variant = AS_RECORDED,
) -> tuple[Motion, RetargetReport]:
    """Returns a motion of the robot ``known`` as one of ``robot``, and a report on it.

    Contacts are the motion's. A ``solver`` of the robot can be used again.

    Raises:
        InputError: if the motion changes its gait, or cannot be retargeted.
    """
    if len(motion.gait_changes) > 1:
        raise InputError("A motion that changes its gait cannot be retargeted.")
    return retarget_clip(
        keypoints_of(motion, known),
        robot,
        config=config_of(known),
        solver=solver,
        variant=variant,
        contacts=motion.contacts,
    )


def keypoints_of(motion: Motion, robot: Quadruped) -> KeypointClip:
    """Returns the keypoints of a motion of ``robot``; their source is the motion's.

    Withers and hip are ahead of the trunk's origin and behind it by half the distance
    of the virtual hips, the toes' lowest points are on the ground.
    """
    half = _half_length(robot)
    ahead = quat_rotate(motion.base_quaternion, np.array([half, 0.0, 0.0]))
    toes = toe_trajectories(motion, robot) - np.array([0.0, 0.0, robot.foot_radius])
    return KeypointClip(
        source=motion.source,
        gait=motion.gait,
        fps=motion.fps,
        withers=motion.base_position + ahead,
        hip=motion.base_position - ahead,
        toes=toes,
        provenance={**motion.provenance, "moved_from": robot.name},
    )


def config_of(robot: Quadruped) -> RetargetConfig:
    """Returns the retargeting configuration of :func:`keypoints_of` a robot."""
    half, height = _half_length(robot), robot.stand_height
    x, y, _ = robot.p_BV.T
    return RetargetConfig(
        stance_height=height,
        front_hip=float(x[:2].mean() - half) / height,
        rear_hip=float(x[2:].mean() + half) / height,
        hip_spread=float(np.abs(y).mean()) / height,
        contact=_CONTACT,
        smoothing=_SMOOTHING,
    )


def _half_length(robot: Quadruped) -> float:
    """Returns half the distance of the virtual hips, front from rear, m."""
    x = robot.p_BV[:, 0]
    return float(x[:2].mean() - x[2:].mean()) / 2
