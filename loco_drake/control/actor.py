"""The policy network, left-right symmetric, and its weights file.

The robots are mirror-symmetric: the mirror image of a good action is good for the
mirrored observation. The network averages over both (Abdolhosseini et al. 2019, "On
learning symmetric locomotion"), so whatever it learns about one side holds for the
other.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from loco_drake.common.arrays import Array, Integers
from loco_drake.common.errors import InputError
from loco_drake.common.weights import (
    build_network,
    load_weights,
    read_config,
    save_weights,
)
from loco_drake.control.action import ACTION_SCALE
from loco_drake.control.observation import (
    MIRROR_OBSERVATION,
    MIRROR_OBSERVATION_SIGNS,
    OBSERVATION_LAYOUT,
    OBSERVATION_SIZE,
)
from loco_drake.models.legs import MIRROR_JOINT_SIGNS, MIRROR_JOINTS
from loco_drake.models.robots import Robot
from loco_drake.motion.motion import FPS

KIND = "policy"
_LEARNER = "learner/"  # prefix of tensors that only a training needs
OBSERVATION_CLIP = 5.0  # standard deviations
# Parts of the observation that need the base's position in the world or its velocity.
PRIVILEGED = ("v_WB_H", "height", "plan_p_H")

Values = TypeVar("Values", Array, NDArray[np.float32], Tensor)


class _Mirror:
    """Mirrors arrays and tensors by permuting the last axis and changing signs."""

    def __init__(self, order: Integers, signs: Array) -> None:
        self._order, self._signs = order, signs
        self._signs_torch = torch.tensor(signs, dtype=torch.float32)

    def __call__(self, values: Values) -> Values:
        """Returns the mirror image of ``values``, of the same shape (..., N)."""
        if isinstance(values, Tensor):
            return values[..., self._order] * self._signs_torch
        return (values[..., self._order] * self._signs).astype(values.dtype)


# Of shape (..., OBSERVATION_SIZE) and (..., 12).
mirror_observations = _Mirror(MIRROR_OBSERVATION, MIRROR_OBSERVATION_SIGNS)
mirror_actions = _Mirror(MIRROR_JOINTS, MIRROR_JOINT_SIGNS)


def unprivileged_mask() -> Tensor:
    """Returns a mask of the observation, 0 where it is privileged, (OBSERVATION_SIZE,).

    Multiplying normalized observations by it sets privileged parts to their mean.
    """
    masks = ([name not in PRIVILEGED] * size for name, size in OBSERVATION_LAYOUT)
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
        default_factory=lambda: [list(part) for part in OBSERVATION_LAYOUT]
    )
    action_scale: float = ACTION_SCALE  # rad per unit of action
    rate: float = FPS  # actions per second
    # Whether the policy observes PRIVILEGED parts, which a robot outside simulation
    # does not know well.
    privileged: bool = True


class Actor(nn.Module):
    """Network that normalizes an observation and returns the mean action.

    Averages the layers over the observation and its mirror image, so that mirrored
    observations give mirrored actions.
    """

    mean: Tensor
    variance: Tensor
    mask: Tensor

    def __init__(self, config: ActorConfig) -> None:
        super().__init__()
        self.config = config
        self.register_buffer("mean", torch.zeros(OBSERVATION_SIZE))
        self.register_buffer("variance", torch.ones(OBSERVATION_SIZE))
        self.register_buffer("mask", unprivileged_mask(), persistent=False)
        layers: list[nn.Module] = []
        width = OBSERVATION_SIZE
        for hidden in config.hidden:
            layers += [nn.Linear(width, hidden), nn.ELU()]
            width = hidden
        self.layers = nn.Sequential(*layers, nn.Linear(width, 12))

    def forward(self, observation: Tensor) -> Tensor:
        """Returns actions (..., 12) for observations (..., OBSERVATION_SIZE)."""
        normal = (observation - self.mean) / torch.sqrt(self.variance + 1e-8)
        normal = normal.clamp(-OBSERVATION_CLIP, OBSERVATION_CLIP)
        if not self.config.privileged:
            normal = normal * self.mask
        image = self.layers(mirror_observations(normal))
        return (self.layers(normal) + mirror_actions(image)) / 2


def save_actor(
    actor: Actor, path: Path, learner: Mapping[str, Tensor] | None = None
) -> None:
    """Writes the policy's weights, and what a training needs to start from them."""
    tensors = dict(actor.state_dict())
    tensors |= {f"{_LEARNER}{name}": value for name, value in (learner or {}).items()}
    save_weights(path, KIND, tensors, asdict(actor.config))


def halve_policy(source: Path, target: Path) -> None:
    """Copies a policy file with its networks in 16 bits, half the size.

    Raises:
        InputError: if ``source`` is missing, damaged, or no policy.
    """
    tensors, config = load_weights(source, KIND)
    for name, value in tensors.items():
        # The normalizer's statistics exceed the range of 16 bits.
        if value.dtype == torch.float32 and name not in ("mean", "variance"):
            tensors[name] = value.half()
    save_weights(target, KIND, tensors, config)


def split_learner(
    tensors: Mapping[str, Tensor],
) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
    """Returns the actor's tensors of a policy file, and the learner's."""
    actor, learner = {}, {}
    for name, value in tensors.items():
        if name.startswith(_LEARNER):
            learner[name.removeprefix(_LEARNER)] = value
        else:
            actor[name] = value
    return actor, learner


def load_actor(path: Path, robot: Robot) -> Actor:
    """Reads a policy for ``robot``.

    Raises:
        InputError: if the file is damaged, or was trained for another robot or with
            another observation, action scale or rate.
    """
    tensors, header = load_weights(path, KIND)
    config = read_config(ActorConfig, header, path)
    free = {name: getattr(config, name) for name in ("labels", "hidden", "privileged")}
    expected = ActorConfig(robot=robot.name, **free)
    for name, value in asdict(expected).items():
        if (trained := getattr(config, name)) != value:
            what = name.replace("_", " ")
            detail = f": {trained}, not {value}" if name == "robot" else ""
            raise InputError(f"The policy in {path} is for another {what}{detail}.")
    return build_network(path, Actor, config, split_learner(tensors)[0]).eval()
