"""Left-right symmetry: every step that a robot makes is learned from twice.

The robots are their own mirror images, so that what is good for one is good, mirrored,
for its image. Observations and actions mirror by swapping and negating entries; each
minibatch is joined by its mirror image, and the normalizer sees both (Abdolhosseini et
al. 2019, "On learning symmetric locomotion"; Mittal et al. 2024, "Symmetry
considerations for learning task symmetric robot policies").
"""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.type_aliases import RolloutBufferSamples

from loco_drake.motion import (
    MIRROR_AXIAL,
    MIRROR_JOINT_SIGNS,
    MIRROR_JOINTS,
    MIRROR_LEGS,
    MIRROR_POLAR,
)
from loco_drake.systems.observation import OBSERVATION_LAYOUT

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


def _observation_mirror() -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    sources, signs, start = [], [], 0
    for name, size in OBSERVATION_LAYOUT:
        order, sign = _PARTS[name]
        for first in range(start, start + size, len(order)):
            sources.append(first + order)
            signs.append(sign)
        start += size
    return np.concatenate(sources), np.concatenate(signs).astype(np.float32)


_SOURCES, _SIGNS = _observation_mirror()


def mirror_observations(observations: NDArray[Any]) -> NDArray[Any]:
    """Returns what the mirror image observes, shape (..., OBSERVATION_SIZE)."""
    return observations[..., _SOURCES] * _SIGNS


def mirror_actions(actions: NDArray[Any]) -> NDArray[Any]:
    """Returns what the mirror image does, shape (..., 12)."""
    return actions[..., MIRROR_JOINTS] * MIRROR_JOINT_SIGNS


class SymmetricRolloutBuffer(RolloutBuffer):
    """Yields minibatches of twice the size: each step and its mirror image.

    The image has the value, advantage and probability of the step itself: behaviour
    that is symmetric at the start, as a new policy's is, is kept so.
    """

    def _get_samples(
        self, batch_inds: NDArray[np.int64], env: Any = None
    ) -> RolloutBufferSamples:
        steps = super()._get_samples(batch_inds, env)
        images = {
            "observations": mirror_observations(self.observations[batch_inds]),
            "actions": mirror_actions(self.actions[batch_inds]),
        }
        both = {}
        for name, value in steps._asdict().items():
            image = value
            if name in images:
                image = self.to_torch(images[name].astype(np.float32))
            both[name] = torch.cat((value, image))
        return RolloutBufferSamples(**both)


class SymmetricStatistics(RunningMeanStd):
    """Mean and variance of observations and their mirror images."""

    def update(self, arr: NDArray[Any]) -> None:
        """Takes observations (N, OBSERVATION_SIZE) into account."""
        super().update(np.concatenate((arr, mirror_observations(arr))))
