"""Actor and critic that treat left and right alike; see :mod:`..systems.symmetry`."""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.distributions import Distribution
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.running_mean_std import RunningMeanStd
from torch import Tensor

from loco_drake.control.actor import unprivileged_mask
from loco_drake.control.symmetry import mirror_actions, mirror_observations

# What the mirror image of the robot observes, of arrays and of tensors.
Mirror = Callable[[Any], Any]


class SymmetricPolicy(ActorCriticPolicy):
    """stable-baselines3's policy, averaged over the robot and its mirror image.

    The mean action mirrors with the observation, and the value does not change with
    it, exactly. Observations must be normalized by :class:`SymmetricStatistics`.

    Args:
        *args: as of ActorCriticPolicy.
        privileged: whether the actor sees all of the observation; the critic, which is
            needed in training only, always does (Pinto et al. 2018, "Asymmetric actor
            critic").
        mirror: of the observations.
        **kwargs: as of ActorCriticPolicy.
    """

    _mask: Tensor

    def __init__(
        self,
        *args: Any,
        privileged: bool = True,
        mirror: Mirror = mirror_observations,
        **kwargs: Any,
    ) -> None:
        super().__init__(*args, **kwargs)
        self._mirror = mirror
        self._privileged = privileged
        self.register_buffer("_mask", unprivileged_mask(), persistent=False)

    def forward(
        self, obs: Any, deterministic: bool = False
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Returns actions (B, 12), values (B, 1) and log probabilities (B,)."""
        distribution, values = self._evaluate(obs)
        actions = distribution.get_actions(deterministic=deterministic)
        return actions, values, distribution.log_prob(actions)

    def evaluate_actions(
        self, obs: Any, actions: Tensor
    ) -> tuple[Tensor, Tensor, Tensor | None]:
        """Returns values (B, 1), log probabilities (B,) and entropies (B,)."""
        distribution, values = self._evaluate(obs)
        return values, distribution.log_prob(actions), distribution.entropy()

    def get_distribution(self, obs: Any) -> Distribution:
        """Returns the distribution of actions."""
        return self._evaluate(obs)[0]

    def predict_values(self, obs: Any) -> Tensor:
        """Returns values, shape (B, 1)."""
        return self._evaluate(obs)[1]

    def _evaluate(self, obs: Any) -> tuple[Distribution, Tensor]:
        seen = torch.cat((obs, self._mirror(obs)))
        latent_vf = self.mlp_extractor.forward_critic(seen)
        if not self._privileged:
            seen = seen * self._mask
        latent_pi = self.mlp_extractor.forward_actor(seen)
        mean, image = self.action_net(latent_pi).chunk(2)
        value, image_value = self.value_net(latent_vf).chunk(2)
        mean = (mean + mirror_actions(image)) / 2
        distribution = self.action_dist.proba_distribution(mean, self.log_std)
        return distribution, (value + image_value) / 2


class SymmetricStatistics(RunningMeanStd):
    """Mean and variance of observations and their mirror images.

    Args:
        shape: of an observation.
        mirror: of the observations.
    """

    def __init__(
        self, shape: tuple[int, ...], mirror: Mirror = mirror_observations
    ) -> None:
        super().__init__(shape=shape)
        self._mirror = mirror

    def update(self, arr: NDArray[Any]) -> None:
        """Takes observations (N, size) into account."""
        super().update(np.concatenate((arr, self._mirror(arr))))
