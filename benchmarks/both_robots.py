"""Environments of both robots as one, whose observations tell which robot it is."""

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv
from torch import Tensor

from loco_drake.control.observation import OBSERVATION_SIZE
from loco_drake.control.symmetry import mirror_observations
from loco_drake.models.robots import ROBOTS
from loco_drake.tracking.environment import ACTION_SPACE

SIZE = OBSERVATION_SIZE + len(ROBOTS)
# The first layers of actor and critic, in a checkpoint.
FIRST_LAYERS = [
    f"policy/mlp_extractor.{net}_net.0.weight" for net in ("policy", "value")
]


def with_robot(observations: NDArray[np.float32], robot: str) -> NDArray[np.float32]:
    """Returns observations (..., OBSERVATION_SIZE) and the robot, (..., SIZE)."""
    one_hot = np.array([name == robot for name in ROBOTS], dtype=np.float32)
    columns = np.broadcast_to(one_hot, (*observations.shape[:-1], len(ROBOTS)))
    return np.concatenate((observations, columns), axis=-1)


def mirror(observations: Any) -> Any:
    """Returns what the mirror image observes, (..., SIZE): it is the same robot."""
    seen = mirror_observations(observations[..., :OBSERVATION_SIZE])
    robot = observations[..., OBSERVATION_SIZE:]
    if isinstance(observations, Tensor):
        return torch.cat((seen, robot), dim=-1)
    return np.concatenate((seen, robot), axis=-1)


def widen(tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """Returns a checkpoint's tensors for SIZE columns, the new ones without effect."""
    wide = dict(tensors)
    for name in FIRST_LAYERS:
        width = wide[name].shape[0]
        wide[name] = torch.cat((wide[name], torch.zeros(width, len(ROBOTS))), dim=1)
    # As if both robots had been seen as often.
    share = 1 / len(ROBOTS)
    for name, value in (("mean", share), ("variance", share * (1 - share))):
        old = wide[f"normalizer/{name}"]
        new = torch.full((len(ROBOTS),), value, dtype=old.dtype)
        wide[f"normalizer/{name}"] = torch.cat((old, new))
    return wide


class SideBySide(VecEnv):
    """Environments of several robots as one; observations say which robot it is.

    Args:
        parts: by robot.
    """

    render_mode: str | None = None  # VecEnv asks for it

    def __init__(self, parts: Mapping[str, VecEnv]) -> None:
        self._parts = parts
        counts = [part.num_envs for part in parts.values()]
        self._firsts = np.cumsum(counts)[:-1]
        space = gymnasium.spaces.Box(-np.inf, np.inf, (SIZE,), np.float32)
        super().__init__(sum(counts), space, ACTION_SPACE)

    def reset(self) -> NDArray[np.float32]:
        """Returns observations, (num_envs, SIZE)."""
        parts = self._parts.items()
        seen: list[Any] = [with_robot(np.asarray(e.reset()), name) for name, e in parts]
        return np.concatenate(seen)

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Tells all what to do; their processes work at the same time."""
        own = np.split(actions, self._firsts)
        for part, rows in zip(self._parts.values(), own, strict=True):
            part.step_async(rows)

    def step_wait(self) -> Any:
        """Returns observations, rewards, dones and infos."""
        observations, rewards, dones, infos = [], [], [], []
        for name, part in self._parts.items():
            seen, reward, done, info = part.step_wait()
            observations.append(with_robot(np.asarray(seen), name))
            rewards.append(reward)
            dones.append(done)
            for each in info:
                if "terminal_observation" in each:
                    last = each["terminal_observation"]
                    each["terminal_observation"] = with_robot(last, name)
                infos.append(each)
        joined = (np.concatenate(values) for values in (observations, rewards, dones))
        return (*joined, infos)

    def close(self) -> None:
        """Ends all."""
        for part in self._parts.values():
            part.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Returns an attribute of this object, once for each environment."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Not supported."""
        raise NotImplementedError

    def env_method(self, method_name: str, *args: Any, **kwargs: Any) -> list[Any]:
        """Not supported."""
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Returns False for each environment."""
        return [False for _ in self._get_indices(indices)]
