"""A policy network with a memory, for what it cannot measure."""

import torch
from torch import Tensor

from loco_drake.control.actor import (
    OBSERVATION_CLIP,
    Actor,
    ActorConfig,
    Mirror,
    make_layers,
    mirror_observations,
)
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
    MIRROR_OBSERVATION_SIGNS,
    OBSERVATION_SIZE,
    PLACES,
)
from loco_drake.models.robots import get_robot


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
        if self.layout.size != OBSERVATION_SIZE:
            raise ValueError("a history is of robots with three joints a leg")
        self.memory_size = memory_size(config.history)
        self.legs = LegOdometry(get_robot(config.robot))
        frames = config.history * FRAME_SIZE + (config.history + 1) * _LEG_FEATURES
        self.estimator = make_layers(OBSERVATION_SIZE + frames, config.hidden, 4)

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
        return self._act(seen, self._normalized(seen))

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
_mirror_frames = Mirror(MIRROR_FRAME, MIRROR_FRAME_SIGNS)
