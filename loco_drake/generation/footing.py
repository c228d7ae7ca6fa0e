"""Foot locking: stance feet stay where they land, and no foot is below the ground.

Base velocity and joint angles from a decoder never agree exactly, and the difference
appears as sliding feet. Here a foot in contact is held at its foothold, the base's path
is corrected toward the position implied by the stance feet, and the offset of a swing
foot decays. Every frame depends on earlier ones only.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.rotations import quat_conjugate, quat_rotate, rotate_plane
from loco_drake.generation import features as ft
from loco_drake.generation.features import positions
from loco_drake.models.robots import Robot
from loco_drake.motion.motion import FPS

Array = NDArray[np.float64]

BASE_GAIN = 0.05  # share of the stance feet's mean offset that moves the base
BASE_EASE = 0.15  # low-pass factor of this shift per frame
SWING_DECAY = 0.8  # of a swing foot's offset, per frame
SETTLING = 0.5  # share of its height that a stance foot loses per frame
REACH = 0.06  # m, largest offset of a foot; beyond it, the foot slides
TOUCHING, LIFTING = 0.55, 0.45  # probabilities at which a contact begins and ends


@dataclass(frozen=True, eq=False)
class Footing:
    """State of base and feet after a frame, for B motions."""

    pose: Array  # x, y in m and yaw in rad of the base, shape (B, 3)
    shift: Array  # displacement of the base by the feet in the frame, m, shape (B, 2)
    anchor: Array  # foothold of each foot, x and y in m, shape (B, 4, 2)
    offset: Array  # displacement of each toe in W, m, shape (B, 4, 3)
    contacts: NDArray[np.bool_]  # feet in stance, shape (B, 4)


def start_footing(pose: Array) -> Footing:
    """Returns the footing of a base at ``pose`` (B, 3) without contacts."""
    batch = len(pose)
    return Footing(
        pose=pose,
        shift=np.zeros((batch, 2)),
        anchor=np.zeros((batch, 4, 2)),
        offset=np.zeros((batch, 4, 3)),
        contacts=np.zeros((batch, 4), dtype=np.bool_),
    )


def step_footing(
    robot: Robot, footing: Footing, features: Array
) -> tuple[Footing, Array, NDArray[np.bool_]]:
    """Places T frames of B motions in the world, from the footing of the frame before.

    Contacts in features (B, T, SIZE) are probabilities. Returns the footing after the
    last frame, q (B, T, 19) as in :func:`.features.positions`, and contacts (B, T, 4).
    """
    likely = features[..., ft.CONTACTS]
    pose, shift, anchor = footing.pose, footing.shift, footing.anchor
    offset, down = footing.offset, footing.contacts
    # Relative to the ground under the trunk.
    p_HF = _toes(robot, positions(robot, features, np.zeros((*likely.shape[:2], 3))))
    turn = features[..., ft.YAW_RATE][..., 0] / FPS
    step_H = features[..., ft.VELOCITY] * robot.stand_height / FPS
    poses, offsets, contacts = [], [], []
    for k in range(features.shape[1]):
        yaw = pose[:, 2] + turn[:, k]
        xy = pose[:, :2] + rotate_plane(step_H[:, k], pose[:, 2] + turn[:, k] / 2)
        toes = xy[:, None] + rotate_plane(p_HF[:, k, :, :2], yaw[:, None])
        was_down = down
        down = likely[:, k] > np.where(was_down, LIFTING, TOUCHING)
        landing = down & ~was_down
        anchor = np.where(landing[..., None], toes + offset[..., :2], anchor)
        wanted = anchor - toes
        size = np.sqrt((wanted * wanted).sum(axis=-1, keepdims=True))
        held = wanted * np.minimum(1.0, REACH / np.maximum(size, REACH))
        # Move the base toward the mean position implied by the stance feet.
        weight = down[..., None] / np.maximum(down.sum(axis=1), 1)[:, None, None]
        wish = BASE_GAIN * (held * weight).sum(axis=1)
        shift = shift + BASE_EASE * (wish - shift)
        xy, toes = xy + shift, toes + shift[:, None]
        level = offset[..., 2] + SETTLING * (
            robot.foot_radius - p_HF[:, k, :, 2] - offset[..., 2]
        )
        offset = np.where(
            down[..., None],
            np.concatenate((held - shift[:, None], level[..., None]), axis=-1),
            SWING_DECAY * offset,
        )
        anchor = np.where(down[..., None], toes + offset[..., :2], anchor)
        pose = np.concatenate((xy, yaw[:, None]), axis=-1)
        poses.append(pose)
        offsets.append(offset)
        contacts.append(down)
    after = Footing(pose, shift, anchor, offset, down)
    q = positions(robot, features, np.stack(poses, axis=1))
    moved = np.stack(offsets, axis=1)
    return after, _move_toes(robot, q, moved), np.stack(contacts, axis=1)


def _toes(robot: Robot, q: Array) -> Array:
    """Returns p_WF of the toes, shape (..., 4, 3)."""
    p_BF = robot.toe_positions(q[..., 7:])
    return quat_rotate(q[..., None, :4], p_BF) + q[..., None, 4:7]


def _move_toes(robot: Robot, q: Array, offset: Array) -> Array:
    """Returns q with the toes moved by ``offset`` in W, and none below the ground.

    The base is raised where a leg cannot fold far enough.
    """
    p_WF = _toes(robot, q) + offset
    p_WF[..., 2] = np.maximum(p_WF[..., 2], robot.foot_radius)
    q = _reach(robot, q, p_WF)
    sunk = np.maximum(robot.foot_radius - _toes(robot, q)[..., 2], 0.0).max(axis=-1)
    if sunk.any():
        q[..., 6] += sunk
        q = _reach(robot, q, p_WF)
    return q


def _reach(robot: Robot, q: Array, p_WF: Array) -> Array:
    """Returns q with the joints, within limits, that take the toes nearest to p_WF."""
    p_BF = quat_rotate(quat_conjugate(q[..., None, :4]), p_WF - q[..., None, 4:7])
    return np.concatenate((q[..., :7], robot.nearest_joints(p_BF)), axis=-1)
