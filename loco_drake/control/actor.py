"""The policy network, left-right symmetric.

The robots are mirror-symmetric: the mirror image of a good action is good for the
mirrored observation. The network averages over both (Abdolhosseini et al. 2019, "On
learning symmetric locomotion"), so whatever it learns about one side holds for the
other. One with a history also has a memory (:mod:`.history_actor`).
"""

from dataclasses import dataclass, field
from itertools import chain
from typing import Any, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from loco_drake.common.arrays import Array, Integers
from loco_drake.control.action import ACTION_SCALE
from loco_drake.control.feed_forward import FEED_FORWARD
from loco_drake.control.observation import (
    LAYOUT,
    Layout,
    layout_of,
    mirrored_layout,
)
from loco_drake.control.recovery import RECOVERY, share_of_recovery
from loco_drake.models.simulated import SimulatedRobot
from loco_drake.motion.motion import FPS

OBSERVATION_CLIP = 5.0  # standard deviations
# Parts of the observation that need the base's position in the world or its velocity.
PRIVILEGED = ("v_WB_H", "height", "plan_p_H")

Values = TypeVar("Values", Array, NDArray[np.float32], Tensor)


class Mirror:
    """Mirrors arrays and tensors by permuting the last axis and changing signs."""

    def __init__(self, order: Integers, signs: Array) -> None:
        # Copies, since torch takes no array that cannot be written.
        self._order, self._signs = order.copy(), signs.copy()
        self._signs_torch = torch.tensor(self._signs, dtype=torch.float32)

    def __call__(self, values: Values) -> Values:
        """Returns the mirror image of ``values``, of the same shape (..., N)."""
        if isinstance(values, Tensor):
            return values[..., self._order] * self._signs_torch.to(values.device)
        return (values[..., self._order] * self._signs).astype(values.dtype)


def mirrors(layout: Layout) -> tuple[Mirror, Mirror]:
    """Returns what mirrors observations (..., size) and actions (..., J)."""
    return (
        Mirror(layout.mirror, layout.mirror_signs),
        Mirror(layout.mirror_joints, layout.mirror_joint_signs),
    )


# Of robots with three joints a leg, (..., OBSERVATION_SIZE) and (..., 12).
mirror_observations, mirror_actions = mirrors(LAYOUT)


def unprivileged_mask(layout: Layout = LAYOUT) -> Tensor:
    """Returns a mask of the observation, 0 where it is privileged, (size,).

    Multiplying normalized observations by it sets privileged parts to their mean.
    """
    masks = ([name not in PRIVILEGED] * size for name, size in layout.parts)
    return torch.tensor(list(chain(*masks)), dtype=torch.float32)


@dataclass(kw_only=True)
class ActorConfig:
    """The properties that a policy was trained with; a mismatch is refused."""

    robot: str  # name of the robot
    labels: list[str]  # gait labels in the training
    # Widths of the hidden layers.
    hidden: list[int] = field(default_factory=lambda: [256, 128])
    # Names and sizes of the parts of the observation.
    observation_layout: list[list[Any]] = field(
        default_factory=lambda: list(LAYOUT.record)
    )
    # Number, from 1, of the joint whose mirror image each joint is, and the signs of
    # the angles there.
    mirror_joints: list[int] = field(
        default_factory=lambda: (LAYOUT.mirror_joints + 1).tolist()
    )
    mirror_signs: list[float] = field(default_factory=LAYOUT.mirror_joint_signs.tolist)
    action_scale: float = ACTION_SCALE  # rad per unit of action
    rate: float = FPS  # actions per second
    # The feed-forward that the actions add to.
    feed_forward: str = FEED_FORWARD
    # Whether the policy observes PRIVILEGED parts, which a robot outside simulation
    # does not know well.
    privileged: bool = True
    # Measurements that the policy remembers besides the present one; None for none.
    history: int | None = None
    # Thresholds from which on a second network acts, see recovery.py; None for none.
    recovery: list[float] | None = None

    @property
    def layout(self) -> Layout:
        """The layout of the observations; raises ValueError if there can be none."""
        order = tuple(k - 1 for k in self.mirror_joints)
        if sorted(order) != list(range(len(self.mirror_signs))):
            raise ValueError("no mirroring of joints")
        return mirrored_layout(order, tuple(self.mirror_signs))


def config_for(robot: SimulatedRobot, **others: Any) -> ActorConfig:
    """Returns the configuration of a policy of ``robot``."""
    layout = layout_of(robot)
    return ActorConfig(
        robot=robot.name,
        observation_layout=list(layout.record),
        mirror_joints=(layout.mirror_joints + 1).tolist(),
        mirror_signs=layout.mirror_joint_signs.tolist(),
        **others,
    )


class Actor(nn.Module):
    """Network that normalizes an observation and returns the mean action.

    Averages the layers over the observation and its mirror image, so that mirrored
    observations give mirrored actions. With a recovery, a second network acts far from
    the plan (:mod:`.recovery`).
    """

    mean: Tensor
    variance: Tensor
    mask: Tensor
    memory_size = 0  # numbers that the policy remembers from one action to the next

    def __init__(self, config: ActorConfig) -> None:
        super().__init__()
        self.config = config
        self.layout = layout = config.layout
        self._mirrors = mirrors(layout)
        joints = len(config.mirror_joints)
        self.register_buffer("mean", torch.zeros(layout.size))
        self.register_buffer("variance", torch.ones(layout.size))
        self.register_buffer("mask", unprivileged_mask(layout), persistent=False)
        self.layers = make_layers(layout.size, config.hidden, joints)
        if config.recovery is not None:
            if len(config.recovery) != len(RECOVERY) or min(config.recovery) <= 0:
                raise ValueError("no thresholds of a recovery")
            self.recovery = make_layers(layout.size, config.hidden, joints)

    def forward(self, observation: Tensor) -> Tensor:
        """Returns actions (..., J) for observations (..., size of the layout)."""
        normal = self._normalized(observation)
        if not self.config.privileged:
            normal = normal * self.mask
        return self._act(observation, normal)

    def step(self, observation: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        """Returns actions, and memories (..., memory_size) for the next ones.

        At the start of an episode a memory is zeros.
        """
        return self(observation), memory

    def _normalized(self, observation: Tensor) -> Tensor:
        normal = (observation - self.mean) / torch.sqrt(self.variance + 1e-8)
        return normal.clamp(-OBSERVATION_CLIP, OBSERVATION_CLIP)

    def _act(self, observation: Tensor, normal: Tensor) -> Tensor:
        action = self._symmetric(self.layers, normal)
        if self.config.recovery is None:
            return action
        share = share_of_recovery(observation, self.config.recovery, self.layout.places)
        return torch.lerp(action, self._symmetric(self.recovery, normal), share)

    def _symmetric(self, layers: nn.Module, normal: Tensor) -> Tensor:
        """Returns actions that are mirrored with the observations."""
        mirror_observations, mirror_actions = self._mirrors
        image = layers(mirror_observations(normal))
        action: Tensor = (layers(normal) + mirror_actions(image)) / 2
        return action


def make_layers(width: int, hidden: list[int], outputs: int) -> nn.Sequential:
    """Returns linear layers with ELUs between them."""
    layers: list[nn.Module] = []
    for size in hidden:
        layers += [nn.Linear(width, size), nn.ELU()]
        width = size
    return nn.Sequential(*layers, nn.Linear(width, outputs))
