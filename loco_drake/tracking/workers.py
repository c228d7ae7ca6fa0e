"""A vectorized environment with many environments in each of several processes."""

import contextlib
import gc
import multiprocessing
import signal
from itertools import chain
from multiprocessing.connection import Connection
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from loco_drake.common.determinism import use_one_thread
from loco_drake.control.observation import OBSERVATION_SIZE
from loco_drake.control.plan import Plan
from loco_drake.tracking.batch import TrackingBatch
from loco_drake.tracking.config import EnvironmentConfig
from loco_drake.tracking.environment import ACTION_SPACE, OBSERVATION_SPACE
from loco_drake.tracking.sampler import PlanSampler, Start

TWO_OBSERVATIONS_SPACE = gymnasium.spaces.Box(
    -np.inf, np.inf, (2 * OBSERVATION_SIZE,), np.float32
)
# Share of the terminated episodes that are retried from a number of samples before the
# failure, so that difficult moments are practised most.
_RETRIED = 0.5
_LEAD = (25, 125)  # least and most

_DIED = "A worker process died; training goes on from its checkpoint with --resume."


def _work(
    pipe: Connection,
    plans: list[Plan],
    config: EnvironmentConfig,
    seeds: list[int],
    exact: bool,
) -> None:
    """Serves messages with actions and the starts of the next episodes."""
    # Ctrl-C reaches the whole process group; only the trainer handles it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    use_one_thread()
    batch = TrackingBatch(plans, config, len(seeds))
    random = [np.random.default_rng(seed) for seed in seeds]
    # Exclude permanent objects from garbage collection.
    gc.freeze()
    try:
        while (message := pipe.recv()) is not None:
            actions, starts = message
            if actions is None:
                for i in range(len(seeds)):
                    batch.reset(i, random[i], *starts[i])
                pipe.send(_observe(batch, exact))
            else:
                pipe.send(_step(batch, actions, starts, random, exact))
    except (EOFError, ConnectionError):
        pass  # The trainer is gone.


def _observe(
    batch: TrackingBatch,
    exact: bool,
    robots: NDArray[np.int64] | slice = slice(None),
) -> NDArray[np.float32]:
    """Returns observations as measured and, if wanted, behind them exact ones."""
    seen = batch.observe(robots)
    return np.hstack((seen, batch.observe(robots, exact=True))) if exact else seen


def _step(
    batch: TrackingBatch,
    actions: NDArray[np.float32],
    starts: list[Start],
    random: list[np.random.Generator],
    exact: bool,
) -> tuple[Any, ...]:
    """Steps all robots and resets those whose episodes ended, as VecEnv requires.

    Returns observations, rewards without penalties, penalties, dones and infos.
    """
    terms, terminated, truncated = batch.step(actions)
    observations = _observe(batch, exact)
    done = terminated | truncated
    infos: list[dict[str, Any]] = [{} for _ in starts]
    ended = np.flatnonzero(done)
    for i in ended:
        infos[i] = {
            "plan": int(batch.plan[i]),
            "samples": (int(batch.start[i]), int(batch.sample[i])),
            "retried": bool(terminated[i]) and random[i].random() < _RETRIED,
            "TimeLimit.truncated": bool(truncated[i]),
            "terminal_observation": observations[i].copy(),
        }
        plan, sample = starts[i]
        if infos[i]["retried"]:
            lead = int(random[i].integers(*_LEAD))
            plan, sample = int(batch.plan[i]), max(0, int(batch.sample[i]) - lead)
        batch.reset(int(i), random[i], plan, sample)
    if len(ended):
        observations[ended] = _observe(batch, exact, ended)
    return observations, terms.sum(axis=-1), batch.penalty, done, infos


class WorkerVecEnv(VecEnv):
    """``workers * per_worker`` environments for stable-baselines3.

    Many environments per worker process amortise pipes and inference. The sampler draws
    the start of each episode and is told how it went; ``seed`` is of all else. If
    ``exact``, observations (OBSERVATION_SIZE,) are followed by those of the true state,
    without the sensors' errors.

    Raises:
        ChildProcessError: from stepping, if a worker process was killed.
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
    ) -> None:
        space = TWO_OBSERVATIONS_SPACE if exact else OBSERVATION_SPACE
        super().__init__(workers * per_worker, space, ACTION_SPACE)
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
        # Fork would copy the threads' locks of torch and Drake.
        context = multiprocessing.get_context("spawn")
        self._pipes: list[Connection] = []
        self._processes = []
        seeds = np.random.SeedSequence(seed).generate_state(self.num_envs).tolist()
        for w in range(workers):
            ours, theirs = context.Pipe()
            own = seeds[w * per_worker : (w + 1) * per_worker]
            process = context.Process(
                target=_work, args=(theirs, plans, config, own, exact), daemon=True
            )
            process.start()
            theirs.close()
            self._pipes.append(ours)
            self._processes.append(process)

    def reset(self) -> NDArray[np.float32]:
        """Starts a new episode everywhere; returns observations (num_envs, size)."""
        self._send(None)
        self._starts = [self._sampler.draw_start() for _ in self._starts]
        self._retrying[:] = False
        self._returns[:] = 0
        self._lengths[:] = 0
        return np.concatenate(self._receive())

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Sends actions to every worker."""
        self._send(actions)

    def step_wait(
        self,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[Any]]:
        """Returns observations, rewards, dones and infos."""
        *arrays, of_workers = zip(*self._receive(), strict=True)
        observations, returns, penalties, dones = map(np.concatenate, arrays)
        infos = list(chain.from_iterable(of_workers))
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
        for pipe in self._pipes:
            with contextlib.suppress(OSError):  # a broken pipe
                pipe.send(None)
            pipe.close()
        for process in self._processes:
            process.join(timeout=5)
            if process.is_alive():
                process.kill()
        self._pipes, self._processes = [], []

    def _send(self, actions: NDArray[np.float32] | None) -> None:
        for w, pipe in enumerate(self._pipes):
            own = slice(w * self._per_worker, (w + 1) * self._per_worker)
            theirs = None if actions is None else actions[own]
            try:
                pipe.send((theirs, self._starts[own]))
            except OSError:  # a broken pipe
                raise ChildProcessError(_DIED) from None

    def _receive(self) -> list[Any]:
        try:
            return [pipe.recv() for pipe in self._pipes]
        except (EOFError, ConnectionResetError):
            raise ChildProcessError(_DIED) from None

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Returns an attribute of this object, once for each environment."""
        return [getattr(self, attr_name)] * self.num_envs

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Returns False for each environment: none is wrapped."""
        return [False] * self.num_envs

    def _elsewhere(self, *args: Any, **kwargs: Any) -> Any:
        raise NotImplementedError("environments live in worker processes")

    set_attr = env_method = _elsewhere
