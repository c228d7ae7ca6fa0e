"""The policy network, left-right symmetric, and its weights file.

The robots are mirror-symmetric: the mirror image of a good action is good for the
mirrored observation. The network averages over both (Abdolhosseini et al. 2019, "On
learning symmetric locomotion"), so whatever it learns about one side holds for the
other. A network with a history also has a memory (:mod:`.history`).
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
from loco_drake.common.determinism import single_thread
from loco_drake.common.errors import InputError
from loco_drake.common.weights import (
    build_network,
    load_weights,
    read_config,
    save_weights,
)
from loco_drake.control.action import ACTION_SCALE
from loco_drake.control.feed_forward import FEED_FORWARD
from loco_drake.control.history import (
    FRAME,
    FRAME_PLACES,
    FRAME_SIZE,
    MIRROR_FRAME,
    MIRROR_FRAME_SIGNS,
    completed,
    memory_size,
    planned,
    recall,
    remember,
)
from loco_drake.control.leg_odometry import LegOdometry
from loco_drake.control.observation import (
    MIRROR_OBSERVATION,
    MIRROR_OBSERVATION_SIGNS,
    OBSERVATION_LAYOUT,
    OBSERVATION_SIZE,
    PLACES,
)
from loco_drake.models.legs import MIRROR_JOINT_SIGNS, MIRROR_JOINTS
from loco_drake.models.robots import Robot, get_robot
from loco_drake.motion.motion import FPS

KIND = "policy"
# The feed-forward of policies whose files do not name it: equal shares of the weight.
_FIRST_FEED_FORWARD = "weight"
_LEARNER = "learner/"  # prefix of tensors that only a training needs
OBSERVATION_CLIP = 5.0  # standard deviations
# Parts of the observation that need the base's position in the world or its velocity.
PRIVILEGED = ("v_WB_H", "height", "plan_p_H")
_FREE = ("labels", "hidden", "privileged", "history")  # may be another policy's

Values = TypeVar("Values", Array, NDArray[np.float32], Tensor)


class _Mirror:
    """Mirrors arrays and tensors by permuting the last axis and changing signs."""

    def __init__(self, order: Integers, signs: Array) -> None:
        self._order, self._signs = order, signs
        self._signs_torch = torch.tensor(signs, dtype=torch.float32)

    def __call__(self, values: Values) -> Values:
        """Returns the mirror image of ``values``, of the same shape (..., N)."""
        if isinstance(values, Tensor):
            return values[..., self._order] * self._signs_torch.to(values.device)
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
    # The feed-forward that the actions add to.
    feed_forward: str = FEED_FORWARD
    # Whether the policy observes PRIVILEGED parts, which a robot outside simulation
    # does not know well.
    privileged: bool = True
    # Measurements that the policy remembers besides the present one; None for none.
    history: int | None = None


class Actor(nn.Module):
    """Network that normalizes an observation and returns the mean action.

    Averages the layers over the observation and its mirror image, so that mirrored
    observations give mirrored actions.
    """

    mean: Tensor
    variance: Tensor
    mask: Tensor
    memory_size = 0  # numbers that the policy remembers from one action to the next

    def __init__(self, config: ActorConfig) -> None:
        super().__init__()
        self.config = config
        self.register_buffer("mean", torch.zeros(OBSERVATION_SIZE))
        self.register_buffer("variance", torch.ones(OBSERVATION_SIZE))
        self.register_buffer("mask", unprivileged_mask(), persistent=False)
        self.layers = _layers(OBSERVATION_SIZE, config.hidden, 12)

    def forward(self, observation: Tensor) -> Tensor:
        """Returns actions (..., 12) for observations (..., OBSERVATION_SIZE)."""
        normal = self._normalized(observation)
        if not self.config.privileged:
            normal = normal * self.mask
        return self._act(normal)

    def step(self, observation: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        """Returns actions, and memories (..., memory_size) for the next ones.

        At the start of an episode a memory is zeros.
        """
        return self(observation), memory

    def _normalized(self, observation: Tensor) -> Tensor:
        normal = (observation - self.mean) / torch.sqrt(self.variance + 1e-8)
        return normal.clamp(-OBSERVATION_CLIP, OBSERVATION_CLIP)

    def _act(self, normal: Tensor) -> Tensor:
        image = self.layers(mirror_observations(normal))
        return (self.layers(normal) + mirror_actions(image)) / 2


class HistoryActor(Actor):
    """Actor that estimates from its last measurements what it cannot measure.

    A second network estimates by how much velocity and height of the base differ from
    the plan's, from the observation without its privileged parts and from the
    measurements before, and what the legs say at each of these times
    (:mod:`.leg_odometry`). Odometry adds up the velocity to where the robot is relative
    to its plan. The actor's layers, those of a privileged actor, act on the observation
    that is completed with all three. No estimate and no action depends on the position
    that the observation was computed with.
    """

    def __init__(self, config: ActorConfig) -> None:
        super().__init__(config)
        if config.history is None or config.privileged:
            raise ValueError("a history is for a policy that is not privileged")
        self.memory_size = memory_size(config.history)
        self.legs = LegOdometry(get_robot(config.robot))
        frames = config.history * FRAME_SIZE + (config.history + 1) * _LEG_FEATURES
        self.estimator = _layers(OBSERVATION_SIZE + frames, config.hidden, 4)

    def forward(self, observation: Tensor) -> Tensor:
        """Returns actions at the start of an episode; see :class:`Actor`."""
        shape = (*observation.shape[:-1], self.memory_size)
        return self.step(observation, observation.new_zeros(shape))[0]

    def step(self, observation: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        """Returns actions and memories; see :class:`Actor`."""
        velocity, height = self.estimate(observation, memory)
        action = self.act_on(observation, memory, velocity, height)
        return action, remember(observation, memory, velocity)

    def estimate(self, observation: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        """Returns v_WB_H (..., 3), m/s, and height (..., 1), m, of the base."""
        frames = recall(observation, memory)[1]
        frames = torch.cat((observation[..., None, FRAME], frames), dim=-2)
        values = self._estimate(observation, frames)
        mirrored = mirror_observations(observation), _mirror_frames(frames)
        change = (values + self._estimate(*mirrored) * _MIRROR_ESTIMATE) / 2
        estimate = planned(observation) + change * self._deviation[_ESTIMATES]
        return estimate[..., :3], estimate[..., 3:]

    def act_on(
        self, observation: Tensor, memory: Tensor, velocity: Tensor, height: Tensor
    ) -> Tensor:
        """Returns actions, given what :meth:`estimate` returned."""
        offset, _ = recall(observation, memory)
        seen = completed(observation, velocity, height, offset)
        return self._act(self._normalized(seen))

    @property
    def _deviation(self) -> Tensor:
        return torch.sqrt(self.variance + 1e-8)

    def _estimate(self, observation: Tensor, frames: Tensor) -> Tensor:
        """Returns estimates from observations and frames, the present one first."""
        before = (frames[..., 1:, :] - self.mean[FRAME]) / self._deviation[FRAME]
        inputs = (
            self._normalized(observation) * self.mask,
            before.clamp(-OBSERVATION_CLIP, OBSERVATION_CLIP).flatten(-2),
            self._leg_features(frames).flatten(-2),
        )
        values: Tensor = self.estimator(torch.cat(inputs, dim=-1))
        return values

    def _leg_features(self, frames: Tensor) -> Tensor:
        """Returns what legs say of the base, relative to the plan, by frame."""
        part = {name: frames[..., place] for name, place in FRAME_PLACES.items()}
        velocity, height = self.legs(
            part["gravity_B"],
            part["w_WB_B"],
            part["joint_positions"],
            10 * part["joint_velocities"],
        )
        off = (velocity - part["plan_v_H"][..., None, :]).clamp(-3, 3)
        planned_stance = off * part["plan_contacts"][..., None]
        height = 10 * (height - self.mean[PLACES["height"]]).clamp(-0.3, 0.3)
        features = (off.flatten(-2), planned_stance.flatten(-2), height)
        return torch.cat(features, dim=-1)


_LEG_FEATURES = 4 * (3 + 3 + 1)  # by leg: velocity, the same in planned stance, height
# What is estimated, v_WB_H and height: neighbours in the observation.
_ESTIMATES = slice(PLACES["v_WB_H"].start, PLACES["height"].stop)
_MIRROR_ESTIMATE = torch.tensor(
    MIRROR_OBSERVATION_SIGNS[_ESTIMATES], dtype=torch.float32
)
_mirror_frames = _Mirror(MIRROR_FRAME, MIRROR_FRAME_SIGNS)


def _layers(width: int, hidden: list[int], outputs: int) -> nn.Sequential:
    """Returns linear layers with ELUs between them."""
    layers: list[nn.Module] = []
    for size in hidden:
        layers += [nn.Linear(width, size), nn.ELU()]
        width = size
    return nn.Sequential(*layers, nn.Linear(width, outputs))


def make_actor(config: ActorConfig) -> Actor:
    """Returns a network with initial weights, with a memory if it has a history."""
    return Actor(config) if config.history is None else HistoryActor(config)


def act(actor: Actor, observation: Array, memory: Array) -> tuple[Array, Array]:
    """Returns action and next memory, as :meth:`Actor.step`, of arrays."""
    inputs = (torch.tensor(x, dtype=torch.float32) for x in (observation, memory))
    # For user processes: a second torch thread would wait for a busy core.
    with torch.inference_mode(), single_thread():
        action, memory_after = actor.step(*inputs)
        return action.double().numpy(), memory_after.double().numpy()


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


def read_actor_config(header: Any, path: Path) -> ActorConfig:
    """Returns the configuration in the header of a policy file.

    Raises:
        InputError: if the header is damaged.
    """
    if isinstance(header, dict):
        header = {"feed_forward": _FIRST_FEED_FORWARD, **header}
    return read_config(ActorConfig, header, path)


def load_actor(path: Path, robot: Robot) -> Actor:
    """Reads a policy for ``robot``.

    Raises:
        InputError: if the file is damaged, or was trained for another robot or with
            another observation, action scale, rate or feed-forward.
    """
    tensors, header = load_weights(path, KIND)
    config = read_actor_config(header, path)
    free = {name: getattr(config, name) for name in _FREE}
    expected = ActorConfig(robot=robot.name, **free)
    for name, value in asdict(expected).items():
        if (trained := getattr(config, name)) != value:
            what = name.replace("_", " ")
            detail = f": {trained}, not {value}" if name == "robot" else ""
            raise InputError(f"The policy in {path} is for another {what}{detail}.")
    return build_network(path, make_actor, config, split_learner(tensors)[0]).eval()
