"""What a student has seen, and what the teacher would have done."""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from loco_drake.control.history import FRAME, make_memory
from loco_drake.control.observation import OBSERVATION_SIZE

# Size of what is kept of each sample. Offsets are those of the student's memory, ages
# the samples since the episode began, truths v_WB_H and height of the base.
_KEPT = {"observation": OBSERVATION_SIZE, "offset": 2, "action": 12, "truth": 4}


class Replay:
    """The last samples of several robots, about ``capacity`` in all.

    Memories are put together from the observations of before, which are stored once.
    """

    def __init__(self, robots: int, history: int, capacity: int) -> None:
        self._rows = max(capacity // robots, 2 * history)
        self._history, self._robots = history, robots
        self._of = {
            name: np.zeros((self._rows, robots, size), dtype=np.float32)
            for name, size in _KEPT.items()
        }
        self._ages = np.zeros((self._rows, robots), dtype=np.int64)
        self._count = 0  # rows added so far

    def add(self, ages: NDArray[np.int64], **values: Tensor) -> None:
        """Adds the present sample of every robot: ages (E,), others (E, size)."""
        row = self._count % self._rows
        self._ages[row] = ages
        for name, of in self._of.items():
            of[row] = values[name].numpy()
        self._count += 1

    def draw(self, random: np.random.Generator, count: int) -> dict[str, Tensor]:
        """Returns ``count`` random samples by name, and their memories."""
        # The oldest ones lack those before them.
        first = max(0, self._count - self._rows)
        first += self._history if first else 0
        row = random.integers(first, self._count, count)
        robot = random.integers(self._robots, size=count)
        at = row % self._rows, robot
        drawn = {name: torch.from_numpy(of[at]) for name, of in self._of.items()}
        back = 1 + np.arange(self._history)
        back = np.minimum(back, self._ages[at][:, None])
        before = (row[:, None] - back) % self._rows
        frames = self._of["observation"][before, robot[:, None]][..., FRAME]
        memory = make_memory(drawn["offset"], torch.from_numpy(frames))
        return {**drawn, "memory": memory}
