"""PPO from stable-baselines3 with exact symmetry and a KL-adaptive learning rate."""

from typing import Any, cast

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.distributions import Distribution
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import VecEnv, VecNormalize
from torch import Tensor

from loco_drake.control.actor import (
    OBSERVATION_CLIP,
    Actor,
    ActorConfig,
    mirrors,
    unprivileged_mask,
)
from loco_drake.control.observation import LAYOUT, Layout
from loco_drake.tracking.config import PpoConfig


class SymmetricPolicy(ActorCriticPolicy):
    """Actor and critic averaged over the observation and its mirror image.

    The mean action mirrors with the observation and the value is invariant, exactly.
    Observations must be normalized by :class:`SymmetricStatistics`. An actor that is
    not ``privileged`` sees part of the observation; the critic, which is needed in
    training only, sees all of it (Pinto et al. 2018, "Asymmetric actor critic").
    """

    _mask: Tensor

    def __init__(
        self,
        *args: Any,
        privileged: bool = True,
        layout: Layout = LAYOUT,
        **kwargs: Any,
    ) -> None:
        super().__init__(*args, **kwargs)
        self._privileged = privileged
        self._mirrors = mirrors(layout)
        self.register_buffer("_mask", unprivileged_mask(layout), persistent=False)

    def forward(
        self, obs: Any, deterministic: bool = False
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Returns actions (B, J), values (B, 1) and log probabilities (B,)."""
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
        mirror_observations, mirror_actions = self._mirrors
        seen = torch.cat((obs, mirror_observations(obs)))
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
    """Mean and variance of observations and their mirror images."""

    def __init__(self, *args: Any, layout: Layout = LAYOUT, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._mirror, _ = mirrors(layout)

    def update(self, arr: NDArray[Any]) -> None:
        """Updates the statistics with observations (N, size)."""
        super().update(np.concatenate((arr, self._mirror(arr))))


class AdaptivePPO(PPO):
    """PPO that adapts the learning rate of the actor to a target KL divergence."""

    target: float
    rate: float
    critic_first: int  # environment steps in which only the critic learns
    update_device: torch.device  # actions are chosen on the CPU

    def split_optimizer(self, critic_rate: float) -> None:
        """Creates separate parameter groups for actor and critic."""
        named = list(self.policy.named_parameters())
        groups: list[dict[str, Any]] = [
            {"params": [p for name, p in named if "value" not in name]},
            {"params": [p for name, p in named if "value" in name], "lr": critic_rate},
        ]
        self.policy.optimizer = torch.optim.Adam(groups, lr=self.rate, eps=1e-5)

    def train(self) -> None:
        """Performs one update and adapts the learning rate."""
        self._move(self.update_device)
        super().train()
        self._move(torch.device("cpu"))
        if self._holds_actor:
            return
        kl = float(self.logger.name_to_value["train/approx_kl"])
        if kl > 2 * self.target:
            self.rate = max(self.rate / 1.5, 1e-5)
        elif kl < self.target / 2:
            self.rate = min(self.rate * 1.5, 3e-3)

    def _move(self, device: torch.device) -> None:
        """Moves all that an update computes with to a device."""
        if self.device == device:
            return
        self.policy.to(device)
        self.rollout_buffer.device = self.device = device
        for moments in self.policy.optimizer.state.values():
            for name in ("exp_avg", "exp_avg_sq"):
                moments[name] = moments[name].to(device)

    @property
    def statistics(self) -> RunningMeanStd:
        """Mean and variance of the observations."""
        normalizer = self.get_vec_normalize_env()
        assert normalizer is not None
        return cast(RunningMeanStd, normalizer.obs_rms)

    def _update_learning_rate(self, optimizers: Any) -> None:
        rate = 0.0 if self._holds_actor else self.rate
        self.logger.record("train/learning_rate", rate)
        optimizers.param_groups[0]["lr"] = rate

    @property
    def _holds_actor(self) -> bool:
        return self.num_timesteps <= self.critic_first


def make_ppo(
    environment: VecEnv,
    config: PpoConfig,
    seed: int,
    device: torch.device | None = None,
    layout: Layout = LAYOUT,
) -> AdaptivePPO:
    """Returns a learner on ``environment`` with normalized observations.

    Its updates are computed on the device, by default the CPU. The layout of the
    observations is by default that of robots with three joints a leg.
    """
    normalized = VecNormalize(
        environment,
        norm_reward=False,
        clip_obs=OBSERVATION_CLIP,
        gamma=config.gamma,
    )
    shape = environment.observation_space.shape
    assert shape is not None
    statistics = SymmetricStatistics(shape=shape, layout=layout)
    normalized.obs_rms = cast(Any, statistics)
    learner = AdaptivePPO(
        SymmetricPolicy,
        normalized,
        learning_rate=config.actor_rate,
        n_steps=config.batch // environment.num_envs,
        batch_size=min(config.minibatch, config.batch),
        n_epochs=config.epochs,
        gamma=config.gamma,
        gae_lambda=config.gae_lambda,
        clip_range=config.clip,
        ent_coef=config.entropy,
        max_grad_norm=1.0,
        policy_kwargs={
            "net_arch": {"pi": config.hidden, "vf": config.hidden},
            "activation_fn": torch.nn.ELU,
            "log_std_init": config.log_std,
            "privileged": config.privileged,
            "layout": layout,
        },
        seed=seed,
        device="cpu",
    )
    learner.update_device = device or torch.device("cpu")
    learner.target = config.target_kl
    learner.rate = config.actor_rate
    learner.critic_first = config.critic_first
    learner.split_optimizer(config.critic_rate)
    learner.policy.log_std.requires_grad_(config.learn_std)
    return learner


def actor_layers(hidden: int) -> dict[str, str]:
    """Returns the names of the layers in Actor and, to each, in SymmetricPolicy.

    ``hidden`` is the number of hidden layers; activations lie between them.
    """
    layers = {
        f"layers.{2 * i}": f"mlp_extractor.policy_net.{2 * i}" for i in range(hidden)
    }
    return {**layers, f"layers.{2 * hidden}": "action_net"}


def export_actor(learner: AdaptivePPO, config: ActorConfig) -> Actor:
    """Returns the learner's policy as the network that the diagram uses."""
    actor = Actor(config)
    with torch.no_grad():
        for ours, theirs in actor_layers(len(config.hidden)).items():
            trained = learner.policy.get_submodule(theirs)
            actor.get_submodule(ours).load_state_dict(trained.state_dict())
        actor.mean.copy_(torch.from_numpy(learner.statistics.mean))
        actor.variance.copy_(torch.from_numpy(learner.statistics.var))
    return actor.eval()
