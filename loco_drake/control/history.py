"""What a policy without privileged observations remembers of an episode.

A memory holds whether the episode has begun, the offset of the plan from the robot by
odometry, and the last measurements, newest first. Before there are enough of them, the
first one stands for those that would be earlier. H is the heading frame, as in
:mod:`.observation`.
"""

import numpy as np
import torch
from torch import Tensor

from loco_drake.control.observation import (
    LOOK_AHEAD,
    MIRROR_OBSERVATION,
    MIRROR_OBSERVATION_SIGNS,
    PLACES,
)
from loco_drake.control.plan import PLAN_DT

# Parts of the observation that are remembered, or how much of them: of the plan, that
# of the next sample.
_REMEMBERED = {
    "gravity_B": 3,
    "w_WB_B": 3,
    "joint_positions": 12,
    "joint_velocities": 12,
    "last_action": 12,
    "plan_joint_velocities": 12,
    "plan_joints": 12,
    "plan_v_H": 3,
    "plan_contacts": 4,
}
# Their places in the observation; a frame is all of them.
FRAME = np.concatenate(
    [PLACES[name].start + np.arange(size) for name, size in _REMEMBERED.items()]
)
FRAME_SIZE = len(FRAME)
_ENDS = np.cumsum([size for size in _REMEMBERED.values()]).tolist()
# Where each part is in a frame.
FRAME_PLACES = {
    name: slice(end - size, end)
    for (name, size), end in zip(_REMEMBERED.items(), _ENDS, strict=True)
}
# How a frame is mirrored left-right, as MIRROR_OBSERVATION is for the observation.
MIRROR_FRAME = np.searchsorted(FRAME, MIRROR_OBSERVATION[FRAME])
MIRROR_FRAME_SIGNS = MIRROR_OBSERVATION_SIGNS[FRAME]

_BEGUN = slice(0, 1)
_OFFSET = slice(1, 3)
_FRAMES = slice(3, None)
MAX_OFFSET = 1.0  # m along each axis; further away no policy was trained


def memory_size(history: int) -> int:
    """Returns the size of a memory of so many measurements."""
    return _FRAMES.start + history * FRAME_SIZE


def make_memory(offset: Tensor, frames: Tensor) -> Tensor:
    """Returns a memory from what :func:`recall` returns."""
    begun = torch.ones_like(offset[..., :1])
    return torch.cat((begun, offset, frames.flatten(-2)), dim=-1)


def recall(observation: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
    """Returns offsets (..., 2), m, and frames (..., history, FRAME_SIZE).

    The offset is that of the plan's present sample from the robot, in H.
    """
    frames = memory[..., _FRAMES].reshape(*memory.shape[:-1], -1, FRAME_SIZE)
    first = observation[..., None, FRAME].expand_as(frames)
    begun = memory[..., _BEGUN, None] > 0
    return memory[..., _OFFSET], torch.where(begun, frames, first)


def remember(observation: Tensor, memory: Tensor, velocity: Tensor) -> Tensor:
    """Returns the memory for the next sample.

    ``velocity`` (..., 3) is v_WB_H, m/s, by which the robot moves on from here.
    """
    offset, frames = recall(observation, memory)
    present = observation[..., None, FRAME]
    frames = torch.cat((present, frames[..., :-1, :]), dim=-2)
    return make_memory(_odometry(observation, offset, velocity), frames)


def _odometry(observation: Tensor, offset: Tensor, velocity: Tensor) -> Tensor:
    """Returns the offset one sample later, in the H of then."""
    plan_v_H = observation[..., PLACES["plan_v_H"]][..., :2]  # from now to the next
    x, y = (offset + PLAN_DT * (plan_v_H - velocity[..., :2])).unbind(-1)
    gravity_B, w_B = (observation[..., PLACES[k]] for k in ("gravity_B", "w_WB_B"))
    yaw = -PLAN_DT * (gravity_B * w_B).sum(-1)
    cosine, sine = torch.cos(yaw), torch.sin(yaw)
    turned = torch.stack((cosine * x + sine * y, cosine * y - sine * x), dim=-1)
    return turned.clamp(-MAX_OFFSET, MAX_OFFSET)


def planned(observation: Tensor) -> Tensor:
    """Returns v_WB_H, m/s, and height, m, of the plan's next sample, shape (..., 4)."""
    plan_p_H, plan_v_H = (observation[..., PLACES[k]] for k in ("plan_p_H", "plan_v_H"))
    height = plan_p_H[..., 2:3] + observation[..., PLACES["height"]]
    return torch.cat((plan_v_H[..., :3], height), dim=-1)


def completed(
    observation: Tensor, velocity: Tensor, height: Tensor, offset: Tensor
) -> Tensor:
    """Returns an observation with other values in its privileged parts.

    How the plan moves on from its next sample, and how high it is, remains as observed;
    no robot needs its position for that.

    Args:
        observation: shape (..., OBSERVATION_SIZE).
        velocity: v_WB_H, m/s, shape (..., 3).
        height: of the base, m, shape (..., 1).
        offset: of the plan's present sample from the robot in H, m, shape (..., 2).
    """
    v, z, p, plan_v = (PLACES[k] for k in ("v_WB_H", "height", "plan_p_H", "plan_v_H"))
    shape = (*observation.shape[:-1], len(LOOK_AHEAD), 3)
    plan_p_H = observation[..., p].reshape(shape)
    next_xy = offset + PLAN_DT * observation[..., plan_v][..., :2]
    xy = plan_p_H[..., :2] - plan_p_H[..., :1, :2] + next_xy[..., None, :]
    up = plan_p_H[..., 2:] + (observation[..., z] - height)[..., None, :]
    parts = (
        observation[..., : v.start],
        velocity,
        height,
        observation[..., z.stop : p.start],
        torch.cat((xy, up), dim=-1).flatten(-2),
        observation[..., p.stop :],
    )
    return torch.cat(parts, dim=-1)
