"""What feedback laws tell a policy: the laws of some time, and samples of them."""

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from loco_drake.common.arrays import Array, Integers
from loco_drake.common.run_folder import sound
from loco_drake.common.weights import load_weights, save_weights
from loco_drake.control.observation import LOOK_AHEAD, Preview, observe
from loco_drake.control.plan import Plan
from loco_drake.control.state import split
from loco_drake.control.state_change import changed
from loco_drake.models.simulated import SimulatedRobot
from loco_drake.tracking.guidance import Found
from loco_drake.tracking.ilqr import FeedbackLaw

KIND = "law"
# Standard deviations of the states that laws tell actions for, beside their
# trajectories: base rotation, position along x and y, and z, joints, angular velocity,
# velocity, and joint velocities; and of the action before. Each is drawn with a share
# of them that is uniform between 0 and 1.
_SPREAD = (0.045, 0.03, 0.009, 0.045, 0.6, 0.18, 0.9)
_ACTION_SPREAD = 0.15
_LARGEST_CHANGE = 1.0  # of an action beside a trajectory
# Of the loss: the share that weighs what actions cost; the rest weighs all alike.
_COST_SHARE = 0.7
_ARRAYS = ("states", "actions", "previous", "gains", "curvatures")


def save_found(path: Path, found: Found) -> None:
    """Writes a law, in 32 bits, to a file that :func:`load_found` reads."""
    law = found.law
    tensors = {
        name: torch.from_numpy(getattr(law, name).astype(np.float32))
        for name in _ARRAYS
    }
    whole = {name: getattr(found, name) for name in ("plan", "sample", "periods")}
    others = {"cost": law.cost, "reward": law.reward, "before": found.before}
    save_weights(path, KIND, tensors, {**whole, **others})


def load_found(path: Path) -> Found:
    """Reads a law.

    Raises:
        InputError: if the file is missing, damaged, or of something else.
    """
    tensors, header = load_weights(path, KIND)
    with sound(path):
        arrays = {name: tensors[name].double().numpy() for name in _ARRAYS}
        cost, reward, before = (
            float(header[name]) for name in ("cost", "reward", "before")
        )
        plan, sample, periods = (
            int(header[name]) for name in ("plan", "sample", "periods")
        )
        law = FeedbackLaw(**arrays, cost=cost, reward=reward)
        return Found(plan, sample, law, before, periods)


@dataclass(frozen=True, eq=False)
class _Told:
    """Samples of laws: arrays of N rows."""

    rows: Integers  # index of the plan's sample among those of all plans
    last: Integers  # that of the plan's last sample
    states: Array
    actions: Array
    before: Array
    gains: Array
    weights: Array


class Laws:
    """The last laws, about ``capacity`` samples, and what they tell."""

    def __init__(self, robot: SimulatedRobot, plans: list[Plan], capacity: int) -> None:
        self._robot, self._capacity = robot, capacity
        lengths = np.array([len(plan) for plan in plans])
        self._first = np.cumsum(lengths) - lengths
        self._lengths = lengths
        self._wanted = np.concatenate([plan.state for plan in plans])
        self._contacts = np.concatenate([plan.contacts for plan in plans])
        self._labels = np.concatenate([plan.labels for plan in plans])
        joints = len(robot.joint_names)
        self._spread = np.repeat(_SPREAD, (3, 2, 1, joints, 3, 3, joints))
        self._parts: list[_Told] = []
        self._all: _Told | None = None

    def __len__(self) -> int:
        return sum(len(part.rows) for part in self._parts)

    def add(self, found: Found) -> None:
        """Adds a law, and drops the oldest that are beyond the capacity."""
        law, first = found.law, int(self._first[found.plan])
        rows = first + found.sample + np.arange(len(law))
        mean = np.trace(law.curvatures, axis1=1, axis2=2).mean() / law.actions.shape[1]
        eye = np.eye(law.actions.shape[1])
        weights = _COST_SHARE * law.curvatures / mean + (1 - _COST_SHARE) * eye
        last = np.full(len(law), first + self._lengths[found.plan] - 1)
        self._parts.append(
            _Told(
                rows,
                last,
                law.states[:-1],
                law.actions,
                law.before(),
                law.gains.astype(np.float32),
                weights.astype(np.float32),
            )
        )
        while len(self._parts) > 1 and len(self) - len(self._parts[0].rows) >= (
            self._capacity
        ):
            del self._parts[0]
        self._all = None

    def draw(
        self, random: np.random.Generator, count: int
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Returns observations (N, size), actions (N, J) and weights (N, J, J)."""
        if self._all is None:
            names = [field.name for field in fields(_Told)]
            self._all = _Told(
                *(np.concatenate([getattr(p, n) for p in self._parts]) for n in names)
            )
        told = self._all
        i = random.integers(len(told.rows), size=count)
        share = random.random((count, 1))
        change = random.standard_normal((count, len(self._spread)))
        change *= share * self._spread
        other = share * _ACTION_SPREAD * random.standard_normal(told.actions[i].shape)
        off = np.concatenate((change, other), axis=-1)
        answer = np.einsum("nij,nj->ni", told.gains[i], off)
        action = told.actions[i] + np.clip(answer, -_LARGEST_CHANGE, _LARGEST_CHANGE)
        rows = np.minimum(told.rows[i][:, None] + LOOK_AHEAD, told.last[i][:, None])
        q, v = split(self._wanted[rows])
        shown = Preview(q, v, self._contacts[rows], self._labels[told.rows[i]])
        seen = observe(
            self._robot, shown, changed(told.states[i], change), told.before[i] + other
        )
        return (
            torch.from_numpy(seen.astype(np.float32)),
            torch.from_numpy(action.astype(np.float32)),
            torch.from_numpy(told.weights[i]),
        )


def law_loss(actions: Tensor, told: Tensor, weights: Tensor) -> Tensor:
    """Returns how far actions (N, J) are from those that laws tell: a number.

    With s = e' W e / J of each sample it is the mean of 2 (sqrt(1 + s) - 1): quadratic
    in small errors e, linear in large ones.
    """
    wrong = actions - told
    square = torch.einsum("ni,nij,nj->n", wrong, weights, wrong) / wrong.shape[-1]
    return (2 * ((1 + square).sqrt() - 1)).mean()
