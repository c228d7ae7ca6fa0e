"""Left-right symmetry: what a mirrored robot sees, and what it does.

The robots are their own mirror images, so that what is good for one is good, mirrored,
for its image. Networks that are averaged over both (Abdolhosseini et al. 2019, "On
learning symmetric locomotion") know this from the start: whatever they learn of one
side holds for the other.
"""

from typing import TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from loco_drake.control.observation import OBSERVATION_LAYOUT
from loco_drake.models.legs import (
    MIRROR_AXIAL,
    MIRROR_JOINT_SIGNS,
    MIRROR_JOINTS,
    MIRROR_LEGS,
    MIRROR_POLAR,
)

_KEEP = (np.arange(1), np.ones(1))
_POLAR = (np.arange(3), MIRROR_POLAR)
_AXIAL = (np.arange(3), MIRROR_AXIAL)
_JOINTS = (MIRROR_JOINTS, MIRROR_JOINT_SIGNS)
_LEGS = (MIRROR_LEGS, np.ones(4))

# What each part of the observation is made of, once or several times in a row.
_PARTS = {
    "gravity_B": _POLAR,
    "w_WB_B": _AXIAL,
    "v_WB_H": _POLAR,
    "height": _KEEP,
    "joint_positions": _JOINTS,
    "joint_velocities": _JOINTS,
    "last_action": _JOINTS,
    "plan_joint_velocities": _JOINTS,
    "plan_joints": _JOINTS,
    "plan_p_H": _POLAR,
    "plan_R_B": _AXIAL,
    "plan_v_H": _POLAR,
    "plan_w_H": _AXIAL,
    "plan_contacts": _LEGS,
    "label": _KEEP,
}


def _observation_mirror() -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    sources, signs, start = [], [], 0
    for name, size in OBSERVATION_LAYOUT:
        order, sign = _PARTS[name]
        for first in range(start, start + size, len(order)):
            sources.append(first + order)
            signs.append(sign)
        start += size
    return np.concatenate(sources), np.concatenate(signs)


_SOURCES, _SIGNS = _observation_mirror()
_JOINT_SIGNS_TORCH = torch.tensor(MIRROR_JOINT_SIGNS, dtype=torch.float32)
_SIGNS_TORCH = torch.tensor(_SIGNS, dtype=torch.float32)

Values = TypeVar("Values", NDArray[np.float64], NDArray[np.float32], Tensor)


def mirror_observations(observations: Values) -> Values:
    """Returns what the mirror image observes, shape (..., OBSERVATION_SIZE)."""
    if isinstance(observations, Tensor):
        return observations[..., _SOURCES] * _SIGNS_TORCH
    return (observations[..., _SOURCES] * _SIGNS).astype(observations.dtype)


def mirror_actions(actions: Values) -> Values:
    """Returns what the mirror image does, shape (..., 12)."""
    if isinstance(actions, Tensor):
        return actions[..., MIRROR_JOINTS] * _JOINT_SIGNS_TORCH
    return (actions[..., MIRROR_JOINTS] * MIRROR_JOINT_SIGNS).astype(actions.dtype)
