"""The policy's network, and its weights on disk."""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from loco_drake.common.errors import InputError
from loco_drake.common.weights import (
    build_network,
    load_weights,
    read_config,
    save_weights,
)
from loco_drake.control.action import ACTION_SCALE
from loco_drake.control.observation import OBSERVATION_LAYOUT, OBSERVATION_SIZE
from loco_drake.control.symmetry import mirror_actions, mirror_observations
from loco_drake.models.robots import Robot
from loco_drake.motion.motion import FPS

KIND = "policy"
OBSERVATION_CLIP = 5.0  # standard deviations
# Parts of the observation that take the base's position in the world, or its velocity.
PRIVILEGED = ("v_WB_H", "height", "plan_p_H")


def unprivileged_mask() -> Tensor:
    """Returns 0 for privileged parts of the observation, else 1, (OBSERVATION_SIZE,).

    Normalized observations are multiplied by it: hidden parts are always at their mean.
    """
    return torch.cat(
        [
            torch.full((size,), float(name not in PRIVILEGED))
            for name, size in OBSERVATION_LAYOUT
        ]
    )


@dataclass(kw_only=True)
class ActorConfig:
    """What a policy was trained for; weights that differ are refused.

    Attributes:
        robot: name of the robot.
        labels: gait labels that it was trained on.
        hidden: widths of the hidden layers.
        observation_layout: names and sizes of the parts of the observation.
        action_scale: rad per unit of action.
        rate: actions per second.
        privileged: whether it sees what a robot outside simulation does not know well,
            :data:`PRIVILEGED`.
    """

    robot: str
    labels: list[str]
    hidden: list[int] = field(default_factory=lambda: [256, 128])
    observation_layout: list[list[Any]] = field(
        default_factory=lambda: [list(part) for part in OBSERVATION_LAYOUT]
    )
    action_scale: float = ACTION_SCALE
    rate: float = FPS
    privileged: bool = True


class Actor(nn.Module):
    """Normalises an observation and maps it to the mean action.

    The layers are applied to the observation and to its mirror image, and averaged: the
    action of a mirrored observation is the mirrored action (:mod:`.symmetry`).
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
        action: Tensor = (self.layers(normal) + mirror_actions(image)) / 2
        return action


def save_actor(actor: Actor, path: Path, *, half: bool = False) -> None:
    """Writes the policy's weights.

    In half precision the normaliser's statistics are stored in full: their range is
    larger than 16 bits hold.
    """
    tensors = dict(actor.state_dict())
    if half:
        tensors = {
            name: value if name in ("mean", "variance") else value.half()
            for name, value in tensors.items()
        }
    save_weights(path, KIND, tensors, asdict(actor.config))


def load_actor(path: Path, robot: Robot) -> Actor:
    """Reads a policy for ``robot``.

    Raises:
        InputError: if the file is damaged, or was trained for another robot or with
            another observation, action scale or rate.
    """
    tensors, header = load_weights(path, KIND)
    config = read_config(ActorConfig, header, path)
    expected = ActorConfig(
        robot=robot.name,
        labels=config.labels,
        hidden=config.hidden,
        privileged=config.privileged,
    )
    for name, value in asdict(expected).items():
        if getattr(config, name) != value:
            what = name.replace("_", " ")
            detail = (
                f": {getattr(config, name)}, not {value}" if name == "robot" else ""
            )
            raise InputError(f"The policy in {path} is for another {what}{detail}.")
    return build_network(path, Actor, config, tensors).eval()
