"""Proximal policy optimization: stable-baselines3's, with a rate set by the KL."""

from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper, VecNormalize

from loco_drake.common.errors import InputError, check_at_least
from loco_drake.control.actor import OBSERVATION_CLIP, Actor, ActorConfig
from loco_drake.control.symmetry import mirror_observations
from loco_drake.tracking.symmetric_policy import (
    Mirror,
    SymmetricPolicy,
    SymmetricStatistics,
)


@dataclass(kw_only=True)
class PpoConfig:
    """How to learn."""

    batch: int = 4096
    """Environment steps between updates; what is saved lags no more behind."""
    minibatch: int = 1024
    """Environment steps in a gradient step, of those of a batch."""
    epochs: int = 5
    """Passes over a batch."""
    gamma: float = 0.97
    """Discount a step."""
    gae_lambda: float = 0.95
    """Of generalized advantage estimation."""
    clip: float = 0.2
    """Range of the probability ratio."""
    actor_rate: float = 5e-4
    """Learning rate of the actor to start with."""
    target_kl: float = 0.02
    """Divergence that an update should have; the actor's learning rate follows it
    (Schulman et al. 2017; Rudin et al. 2022)."""
    critic_rate: float = 1e-3
    """Learning rate of the critic, which has nothing to diverge from."""
    log_std: float = -0.7
    """Initial log standard deviation of the actions."""
    hidden: list[int] = field(default_factory=lambda: [256, 128])
    """Widths of the hidden layers of actor and critic each."""
    privileged: bool = True
    """Whether the policy sees where in the world the base is and how fast it moves,
    which a robot outside simulation does not know well; the critic always does."""

    def check(self, environments: int) -> None:
        """Raises InputError unless it fits so many environments."""
        if self.batch < 2 * environments:
            raise InputError(
                f"--batch must be at least {2 * environments}, two steps of each of "
                f"{environments} environments, not {self.batch}."
            )
        for name in ("minibatch", "epochs"):
            check_at_least(name, getattr(self, name), 1)
        if not self.hidden or min(self.hidden) < 1:
            raise InputError(f"--hidden must be widths above 0, not {self.hidden}.")
        for name, most in (
            ("gamma", 1.0),
            ("gae_lambda", 1.0),
            ("clip", 1.0),
            ("actor_rate", 1.0),
            ("target_kl", np.inf),
            ("critic_rate", 1.0),
        ):
            value = getattr(self, name)
            if not 0 < value <= most or np.isinf(value):
                limit = f" and at most {most:g}" if np.isfinite(most) else ""
                option = "--" + name.replace("_", "-")
                raise InputError(f"{option} must be above 0{limit}, not {value}.")
        if not np.isfinite(self.log_std):
            raise InputError(f"--log-std must be a number, not {self.log_std}.")


class ScaleReward(VecEnvWrapper):
    """Multiplies rewards by 1 - gamma, so that returns are between 0 and 1."""

    def __init__(self, venv: VecEnv, gamma: float) -> None:
        super().__init__(venv)
        self._scale = 1 - gamma

    def reset(self) -> Any:
        """See VecEnv."""
        return self.venv.reset()

    def step_wait(self) -> Any:
        """See VecEnv."""
        observations, rewards, dones, infos = self.venv.step_wait()
        return observations, rewards * self._scale, dones, infos


class AdaptivePPO(PPO):
    """PPO whose actor learns at the rate that gives updates the target divergence."""

    target: float
    rate: float

    def split_optimizer(self, critic_rate: float) -> None:
        """Gives actor and critic parameter groups of their own."""
        actor: list[torch.nn.Parameter] = []
        critic: list[torch.nn.Parameter] = []
        for name, parameter in self.policy.named_parameters():
            (critic if "value" in name else actor).append(parameter)
        groups: list[dict[str, Any]] = [
            {"params": actor},
            {"params": critic, "lr": critic_rate},
        ]
        self.policy.optimizer = torch.optim.Adam(groups, lr=self.rate, eps=1e-5)

    def train(self) -> None:
        """Does one update, then sets the learning rate of the next."""
        super().train()
        kl = float(self.logger.name_to_value["train/approx_kl"])
        if kl > 2 * self.target:
            self.rate = max(self.rate / 1.5, 1e-5)
        elif kl < self.target / 2:
            self.rate = min(self.rate * 1.5, 3e-3)

    @property
    def statistics(self) -> RunningMeanStd:
        """Mean and variance of the observations."""
        normalizer = self.get_vec_normalize_env()
        assert normalizer is not None
        return cast(RunningMeanStd, normalizer.obs_rms)

    def _update_learning_rate(self, optimizers: Any) -> None:
        self.logger.record("train/learning_rate", self.rate)
        optimizers.param_groups[0]["lr"] = self.rate


def make_ppo(
    environment: VecEnv,
    config: PpoConfig,
    seed: int,
    mirror: Mirror = mirror_observations,
) -> AdaptivePPO:
    """Returns a learner on ``environment``, its observations normalized.

    Args:
        environment: what to learn in.
        config: how to learn.
        seed: of everything random.
        mirror: of the environment's observations.
    """
    normalized = VecNormalize(
        ScaleReward(environment, config.gamma),
        norm_reward=False,
        clip_obs=OBSERVATION_CLIP,
        gamma=config.gamma,
    )
    shape = environment.observation_space.shape
    assert shape is not None
    normalized.obs_rms = cast(Any, SymmetricStatistics(shape, mirror))
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
        ent_coef=0.0,
        max_grad_norm=1.0,
        policy_kwargs={
            "net_arch": {"pi": config.hidden, "vf": config.hidden},
            "activation_fn": torch.nn.ELU,
            "log_std_init": config.log_std,
            "privileged": config.privileged,
            "mirror": mirror,
        },
        seed=seed,
        device="cpu",
    )
    learner.target = config.target_kl
    learner.rate = config.actor_rate
    learner.split_optimizer(config.critic_rate)
    return learner


def export_actor(learner: AdaptivePPO, config: ActorConfig) -> Actor:
    """Returns the learner's policy as the network that the diagram uses."""
    actor = Actor(config)
    trained = [
        *learner.policy.mlp_extractor.policy_net,
        learner.policy.action_net,
    ]
    with torch.no_grad():
        for ours, theirs in zip(actor.layers, trained, strict=True):
            ours.load_state_dict(theirs.state_dict())
        actor.mean.copy_(torch.from_numpy(learner.statistics.mean))
        actor.variance.copy_(torch.from_numpy(learner.statistics.var))
    return actor.eval()
