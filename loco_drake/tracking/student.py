"""A policy without privileged observations, taught by one with them (DAgger).

Ross et al. 2011, "A reduction of imitation learning and structured prediction to
no-regret online learning"; for legged robots Lee et al. 2020, "Learning quadrupedal
locomotion over challenging terrain". The teacher sees the true state, except for where
the robot is: there it is told what the student believes by its odometry. Otherwise it
would ask for corrections whose reason no student can know.
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from loco_drake.control.actor import Actor, ActorConfig, mirror_observations
from loco_drake.control.history import completed, recall
from loco_drake.control.history_actor import HistoryActor
from loco_drake.control.observation import PLACES
from loco_drake.tracking.config import StudentConfig
from loco_drake.tracking.replay import Replay
from loco_drake.tracking.workers import WorkerVecEnv

_TRUTH = slice(PLACES["v_WB_H"].start, PLACES["height"].stop)


def make_student(teacher: Actor, history: int, labels: list[str]) -> HistoryActor:
    """Returns a student whose layers are the teacher's.

    It takes velocity and height to be the plan's, until it learns better.
    """
    changes = {"privileged": False, "history": history, "labels": labels}
    student = HistoryActor(ActorConfig(**{**asdict(teacher.config), **changes}))
    student.layers.load_state_dict(teacher.layers.state_dict())
    if teacher.config.recovery is not None:
        student.recovery.load_state_dict(teacher.recovery.state_dict())
    last = student.estimator[-1]
    assert isinstance(last, nn.Linear)
    nn.init.zeros_(last.weight)
    nn.init.zeros_(last.bias)
    # Exactly symmetric, so that the student is.
    for name in ("mean", "variance"):
        value = getattr(teacher, name)
        image = mirror_observations(value)
        if name == "variance":
            image = image.abs()
        getattr(student, name).copy_((value + image) / 2)
    return student


@dataclass(frozen=True)
class Errors:
    """Mean errors of a student in minibatches."""

    action: float  # mean square, of the action's unit
    velocity: float  # root mean square of the length, m/s
    height: float  # root mean square, m


class Dagger:
    """A student that acts, is told what the teacher would do, and learns from it."""

    def __init__(
        self, student: HistoryActor, teacher: Actor, config: StudentConfig
    ) -> None:
        self.student, self._teacher, self._config = student, teacher, config
        assert student.config.history is not None
        self._robots = config.workers * config.per_worker
        self.optimizer = torch.optim.Adam(student.parameters(), lr=config.learning_rate)
        history = student.config.history
        self._replay = Replay(self._robots, history, config.capacity)
        self.random = np.random.default_rng(config.seed)
        self._memory = torch.zeros(self._robots, student.memory_size)
        self._ages = np.zeros(self._robots, dtype=np.int64)
        self._seen: NDArray[np.float32] = np.zeros((0, 0), dtype=np.float32)

    def begin(self, environment: WorkerVecEnv) -> None:
        """Starts new episodes."""
        self._seen = environment.reset()
        self._memory.zero_()
        self._ages[:] = 0

    def collect(self, environment: WorkerVecEnv, share: float) -> list[dict[str, Any]]:
        """Adds a batch of samples; returns the episodes that ended.

        ``share`` is the teacher's of the actions.
        """
        episodes = []
        for _ in range(self._config.batch // self._robots):
            observations = torch.from_numpy(self._seen)
            seen, exact = observations.chunk(2, dim=-1)
            with torch.inference_mode():
                asked, offset = self._ask(seen, exact)
                actions, after = self.student.step(seen, self._memory)
            self._replay.add(
                self._ages,
                observation=seen,
                offset=offset,
                action=asked,
                truth=exact[:, _TRUTH],
            )
            teachers = torch.from_numpy(self.random.random((self._robots, 1)) < share)
            taken = torch.where(teachers, asked, actions).numpy()
            environment.step_async(taken)
            self._seen, _, dones, infos = environment.step_wait()
            self._memory = after * torch.from_numpy(~dones)[:, None]
            self._ages = np.where(dones, 0, self._ages + 1)
            episodes += [infos[i]["episode"] for i in np.flatnonzero(dones)]
        return episodes

    def _ask(self, seen: Tensor, exact: Tensor) -> tuple[Tensor, Tensor]:
        """Returns the teacher's actions, and the offsets that the student believes."""
        offset, _ = recall(seen, self._memory)
        truth = exact[:, _TRUTH]
        told = completed(exact, truth[:, :3], truth[:, 3:], offset)
        asked = self._teacher(told)
        return asked, offset

    def learn(self, rate: float) -> Errors:
        """Makes the updates of a batch at a learning rate; returns mean errors."""
        for group in self.optimizer.param_groups:
            group["lr"] = rate
        errors = []
        for _ in range(self._config.updates):
            drawn = self._replay.draw(self.random, self._config.minibatch)
            self.optimizer.zero_grad()
            loss, error = self._loss(drawn)
            loss.backward()  # type: ignore[no-untyped-call]
            self.optimizer.step()
            errors.append(error)
        action, velocity, height = np.mean(errors, axis=0).tolist()
        return Errors(action, velocity**0.5, height**0.5)

    def _loss(self, drawn: dict[str, Tensor]) -> tuple[Tensor, NDArray[np.float64]]:
        """Returns the loss, and mean square errors of action, velocity and height.

        The estimator learns from the truth only, and the layers to act on what it
        estimates.
        """
        student, seen, memory = self.student, drawn["observation"], drawn["memory"]
        velocity, height = student.estimate(seen, memory)
        action = student.act_on(seen, memory, velocity.detach(), height.detach())
        wrong = (action - drawn["action"]).square().mean()
        error = torch.cat((velocity, height), dim=-1) - drawn["truth"]
        scaled = (error.square() / student.variance[_TRUTH]).mean()
        errors = error.detach().square().mean(dim=0)
        figures = (wrong.item(), errors[:3].sum().item(), errors[3].item())
        return wrong + scaled, np.array(figures)
