"""A vectorized environment with many environments in each of several processes."""

from collections import deque
from functools import partial
from itertools import chain
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from loco_drake.control.observation import layout_of
from loco_drake.control.plan import Plan
from loco_drake.engine.executor import TRIES, Executor, WorkerDiedError
from loco_drake.engine.local import LOCAL
from loco_drake.models.robots import get_simulated
from loco_drake.tracking.config import EnvironmentConfig
from loco_drake.tracking.environment import spaces_of
from loco_drake.tracking.sampler import PlanSampler
from loco_drake.tracking.simulation import (
    Beginning,
    Past,
    Reply,
    Reset,
    Restore,
    Simulation,
    Step,
)


class WorkerVecEnv(VecEnv):
    """``workers * per_worker`` environments for stable-baselines3.

    Many environments per worker process amortise pipes and inference. The sampler draws
    the start of each episode and is told how it went; ``seed`` is of all else. If
    ``exact``, observations (size,) are followed by those of the true state,
    without the sensors' errors.

    A worker that dies is replaced by one that repeats the episodes which were going on:
    the results are the same as if none had died.

    Raises:
        ChildProcessError: if workers died TRIES times at the same step.
    """

    render_mode: str | None = None  # VecEnv asks for it

    def __init__(
        self,
        plans: list[Plan],
        config: EnvironmentConfig,
        sampler: PlanSampler,
        *,
        workers: int,
        per_worker: int,
        seed: int,
        reward_scale: float = 1.0,
        exact: bool = False,
        executor: Executor = LOCAL,
    ) -> None:
        layout = layout_of(get_simulated(config.robot))
        space, action_space = spaces_of(layout)
        if exact:
            size = (2 * layout.size,)
            space = gymnasium.spaces.Box(-np.inf, np.inf, size, np.float32)
        super().__init__(workers * per_worker, space, action_space)
        self._joints = len(layout.mirror_joints)
        self._sampler = sampler
        self._episode_steps = config.episode_steps
        self._per_worker = per_worker
        self._reward_scale = reward_scale
        # What each environment goes on with when its episode is over.
        self._starts = [sampler.draw_start() for _ in range(self.num_envs)]
        # Episodes that are another try: too hard to be counted.
        self._retrying = np.zeros(self.num_envs, dtype=bool)
        self._returns = np.zeros(self.num_envs)
        self._lengths = np.zeros(self.num_envs, dtype=int)
        # What repeats the episodes that are going on.
        self._beginnings: dict[int, Beginning] = {}
        self._actions: deque[NDArray[np.float32]] = deque(maxlen=config.episode_steps)
        seeds = np.random.SeedSequence(seed).generate_state(self.num_envs).tolist()
        self._own = [
            slice(w * per_worker, (w + 1) * per_worker) for w in range(workers)
        ]
        self._crew = executor.crew(
            partial(Simulation, plans, config, exact), [seeds[own] for own in self._own]
        )
        self._sent: list[Reset | Step] = []

    def reset(self) -> NDArray[np.float32]:
        """Starts a new episode everywhere; returns observations (num_envs, size)."""
        self._send([Reset(self._starts[own]) for own in self._own])
        self._starts = [self._sampler.draw_start() for _ in self._starts]
        replies = self._receive()
        self._actions.clear()
        self._retrying[:] = False
        self._returns[:] = 0
        self._lengths[:] = 0
        return np.concatenate([reply.observations for reply in replies])

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Sends actions to every worker."""
        self._send([Step(actions[own], self._starts[own]) for own in self._own])
        # What asked may use the memory of its actions again.
        self._last = np.array(actions)

    def step_wait(
        self,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[Any]]:
        """Returns observations, rewards, dones and infos."""
        replies = self._receive()
        self._actions.append(self._last)
        observations, returns, penalties, dones = (
            np.concatenate([getattr(reply, name) for reply in replies])
            for name in ("observations", "returns", "penalties", "dones")
        )
        infos = list(chain.from_iterable(reply.infos for reply in replies))
        self._returns += returns
        self._lengths += 1
        for i in np.flatnonzero(dones):
            info, total, length = infos[i], self._returns[i], int(self._lengths[i])
            # Steps lost to a fall count as 0; those cut off by the plan's end do not.
            steps = length if info["TimeLimit.truncated"] else self._episode_steps
            failed = not info["TimeLimit.truncated"]
            self._sampler.record_end(info["plan"], *info["samples"], failed=failed)
            if not self._retrying[i]:
                share = length / self._episode_steps
                self._sampler.record(info["plan"], total / steps, share)
            info["episode"] = {"r": 100 * total / steps, "l": length, "t": 0.0}
            self._retrying[i] = info["retried"]
            if not info["retried"]:
                self._starts[i] = self._sampler.draw_start()
        self._returns[dones] = self._lengths[dones] = 0
        rewards = (returns - penalties).astype(np.float32) * self._reward_scale
        return observations, rewards, dones, infos

    def close(self) -> None:
        """Ends the workers."""
        self._crew.close()

    def _send(self, messages: list[Any]) -> None:
        self._sent = messages
        for w, message in enumerate(messages):
            self._crew.send(w, message)

    def _receive(self) -> list[Reply]:
        replies = [self._answer(w) for w in range(len(self._own))]
        for own, reply in zip(self._own, replies, strict=True):
            for i, beginning in reply.beginnings.items():
                self._beginnings[own.start + i] = beginning
        return replies

    def _answer(self, w: int) -> Reply:
        """Returns a worker's reply, or if it has died, that of a new one."""
        for tries in range(TRIES):
            try:
                if tries:
                    self._crew.replace(w)
                    self._restore(w)
                    self._crew.send(w, self._sent[w])
                reply: Reply = self._crew.receive(w)
                return reply
            except WorkerDiedError:
                continue
        raise WorkerDiedError(
            f"A worker process died {TRIES} times at the same step; training goes on "
            "from its checkpoint with --resume."
        )

    def _restore(self, w: int) -> None:
        """Gives a new worker the state of the one before it."""
        if not self._beginnings:
            return
        own, before = self._own[w], list(self._actions)
        pasts = []
        for i in range(own.start, own.stop):
            steps = before[len(before) - self._lengths[i] :]
            actions = np.array([step[i] for step in steps], np.float32)
            actions = actions.reshape(-1, self._joints)
            pasts.append(Past(self._beginnings[i], actions))
        self._crew.send(w, Restore(pasts))
        self._crew.receive(w)

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Returns an attribute of this object, once for each environment."""
        return [getattr(self, attr_name)] * self.num_envs

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Returns False for each environment: none is wrapped."""
        return [False] * self.num_envs

    def _elsewhere(self, *args: Any, **kwargs: Any) -> Any:
        raise NotImplementedError("environments live in worker processes")

    set_attr = env_method = _elsewhere
