"""How well the rhythm of a person's steps is kept by a humanoid."""

import numpy as np

from loco_drake.common.rotations import quat_rotate, yaw_of
from loco_drake.evaluation.retargeting import GaitFidelity, gait_fidelity
from loco_drake.models.biped import Biped
from loco_drake.motion.biped_clip import BipedClip
from loco_drake.motion.gait_timing import Track
from loco_drake.motion.motion import Motion


def biped_fidelity(
    clip: BipedClip, motion: Motion, robot: Biped
) -> GaitFidelity | None:
    """Returns the errors of the gait timing of toes and heels, by gait_fidelity.

    ``clip`` is what the motion was made of, in its time. None if the person makes fewer
    than three strides.
    """
    height = robot.hip_height / float(motion.provenance["scale"])
    return gait_fidelity(person_track(clip, height), humanoid_track(motion, robot))


def person_track(clip: BipedClip, height: float) -> Track:
    """Returns the track of a person whose hips are ``height`` in m over the ground."""
    ahead = clip.forward
    return Track(
        fps=clip.fps,
        trunk=clip.middle[:, :2],
        yaw=np.arctan2(ahead[:, 1], ahead[:, 0]),
        soles=clip.toes,
        stance_height=height,
    )


def humanoid_track(motion: Motion, robot: Biped) -> Track:
    """Returns the track of a humanoid's motion."""
    p_B = robot.sole_ends(motion.joint_positions)
    p_W = motion.base_position[:, None] + quat_rotate(
        motion.base_quaternion[:, None], p_B
    )
    return Track(
        fps=motion.fps,
        trunk=motion.base_position[:, :2],
        yaw=yaw_of(motion.base_quaternion),
        soles=p_W - np.array([0.0, 0.0, robot.foot_radius]),
        stance_height=robot.hip_height,
    )
