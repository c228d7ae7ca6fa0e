"""Motion made by formula: a robot that trots or paces with feet that do not slip."""

import numpy as np

from loco_drake.common.rotations import (
    quat_conjugate,
    quat_multiply,
    quat_rotate,
    yaw_quat,
)
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import parse_label
from loco_drake.motion.motion import FPS, Motion, make_motion

# Phase of each foot behind RL, as a share of the stride.
PHASES = {"trot": (0.5, 0.0, 0.0, 0.5), "pace": (0.0, 0.5, 0.0, 0.5)}


def synthetic_motion(
    label: str = "dog-trot",
    seconds: float = 3.0,
    speed: float = 0.8,
    turn: float = 0.0,
    period: float = 0.5,
    phase: float = 0.0,
    recording: str = "made",
    split: str = "train",
    name: str = "go2",
) -> Motion:
    """Returns a motion along an arc; the speed in m/s, the turn in rad/s."""
    robot = get_robot(name)
    time = np.arange(round(seconds * FPS) + 1) / FPS
    yaw = turn * time
    path = np.stack((np.cos(yaw), np.sin(yaw)), axis=-1) * speed / FPS
    xy = np.concatenate(([[0.0, 0.0]], np.cumsum(path[:-1], axis=0)))
    beat = 2 * np.pi * time / period
    height = robot.stand_height - 0.01 + 0.008 * np.cos(2 * beat)
    p_WB = np.concatenate((xy, height[:, None]), axis=-1)
    gait = label.split("-")[1]
    cycle = (time[:, None] / period + phase + np.array(PHASES[gait])) % 1.0
    contacts = cycle < 0.5
    # Where a foot is along the way it makes under the trunk, from 1/2 to -1/2.
    swing = np.clip(cycle * 2 - 1, 0.0, 1.0)
    along = np.where(contacts, 0.5 - cycle * 2, 0.5 * -np.cos(np.pi * swing))
    p_HF = np.zeros((len(time), 4, 3))
    side = np.sign(robot.p_BHip[:, 1]) * 0.14
    p_HF[..., 0] = robot.p_BHip[:, 0] + along * speed * period / 2
    p_HF[..., 1] = side
    lift = 0.06 * np.sin(np.pi * swing) ** 2 * ~contacts
    p_HF[..., 2] = robot.foot_radius + lift - height[:, None]
    q_HB = np.zeros((len(time), 4))
    pitch = 0.03 * np.sin(beat)
    q_HB[:, 0], q_HB[:, 2] = np.cos(pitch / 2), np.sin(pitch / 2)
    return make_motion(
        robot=name,
        label=parse_label(label),
        joint_names=robot.joint_names,
        base_position=p_WB,
        base_quaternion=quat_multiply(yaw_quat(yaw), q_HB),
        joint_positions=robot.leg_joints(
            quat_rotate(quat_conjugate(q_HB)[:, None], p_HF)
        ),
        contacts=contacts,
        provenance={"recording": recording, "split": split},
    )
