r"""What each ingredient of the policy's training is worth: short trainings without it.

All variants are trained alike from nothing, on the same plans and with the same seeds,
and scored on plans that were held out, without noise. Each training leaves a JSON file
in ``--out``; what is there already is not done again, so that the script can be stopped
and run anew. Prints the table of docs/tracking.md. From the root of the repository:

    for gait in dog-pace dog-trot horse-walk; do
        loco-drake generate --gait $gait --count 30 --duration 10 --seed 1000 \
            --out motions/tracked
    done
    OMP_NUM_THREADS=1 python benchmarks/tracker_ablation.py
"""

import json
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import cache, partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import torch
import tyro
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.distributions import Distribution
from stable_baselines3.common.running_mean_std import RunningMeanStd
from torch import Tensor

from loco_drake.common.errors import InputError
from loco_drake.common.files import atomic_path
from loco_drake.control.actor import OBSERVATION_CLIP, Actor, ActorConfig, load_actor
from loco_drake.control.observation import LOOK_AHEAD, OBSERVATION_LAYOUT
from loco_drake.control.plan import Plan
from loco_drake.models.robots import Robot, get_robot
from loco_drake.motion.gaits import LABELS
from loco_drake.motion.motion import load_motion
from loco_drake.tracking import workers
from loco_drake.tracking.batch import TrackingBatch
from loco_drake.tracking.checkpoint import load_checkpoint
from loco_drake.tracking.environment_config import EnvironmentConfig, ResetNoise
from loco_drake.tracking.ppo import AdaptivePPO, PpoConfig
from loco_drake.tracking.references import smooth_motions
from loco_drake.tracking.symmetric_policy import SymmetricPolicy
from loco_drake.tracking.terminations import TerminationConfig
from loco_drake.tracking.train import CHECKPOINT, POLICY, TrainingConfig, train_tracker

ROBOT = "go2"
ONLY_FALLS = TerminationConfig(position=np.inf, rotation=np.inf)
_HELD_OUT = 5  # of so many plans of a label one is held out


def near_mask() -> Tensor:
    """Returns 0 for what is seen of the plan beyond the next sample, else 1."""
    seen = []
    for name, size in OBSERVATION_LAYOUT:
        mask = torch.ones(size)
        if name.startswith("plan_") and name != "plan_joint_velocities":
            mask[size // len(LOOK_AHEAD) :] = 0.0
        seen.append(mask)
    return torch.cat(seen)


class NearPolicy(SymmetricPolicy):
    """Sees the plan's next sample only; what comes later is always at its mean."""

    def _evaluate(self, obs: Any) -> tuple[Distribution, Tensor]:
        return super()._evaluate(obs * near_mask())


class NearActor(Actor):
    """The network of :class:`NearPolicy`."""

    def forward(self, observation: Tensor) -> Tensor:
        """Returns actions (..., 12) for observations (..., OBSERVATION_SIZE)."""
        return super().forward(torch.where(near_mask() > 0, observation, self.mean))


class PlainPolicy(SymmetricPolicy):
    """The same networks, not averaged over left and right."""

    def _evaluate(self, obs: Any) -> tuple[Distribution, Tensor]:
        latent_pi, latent_vf = self.mlp_extractor(obs)
        mean = self.action_net(latent_pi)
        distribution = self.action_dist.proba_distribution(mean, self.log_std)
        return distribution, self.value_net(latent_vf)


class PlainActor(Actor):
    """The network of :class:`PlainPolicy`."""

    def forward(self, observation: Tensor) -> Tensor:
        """Returns actions (..., 12) for observations (..., OBSERVATION_SIZE)."""
        normal = (observation - self.mean) / torch.sqrt(self.variance + 1e-8)
        action: Tensor = self.layers(normal.clamp(-OBSERVATION_CLIP, OBSERVATION_CLIP))
        return action


class SteadyPPO(AdaptivePPO):
    """PPO whose actor learns at the rate that it begins with."""

    def train(self) -> None:
        """Does one update."""
        PPO.train(self)


class FromBeginning(TrackingBatch):
    """Starts episodes at the beginning of their plan if not told otherwise."""

    def reset(
        self,
        i: int,
        random: np.random.Generator,
        plan: int | None = None,
        sample: int | None = 0,
    ) -> None:
        """See TrackingBatch."""
        super().reset(i, random, plan, sample)


_work = workers._work


def work_from_beginning(
    pipe: Connection, plans: list[Plan], config: EnvironmentConfig, seeds: list[int]
) -> None:
    """What a worker process does, on :class:`FromBeginning`."""
    with mock.patch.object(workers, "TrackingBatch", FromBeginning):
        _work(pipe, plans, config, seeds)


def without_feed_forward(robot: Robot, plan: Plan) -> Plan:
    """Returns the plan with set-points of its positions and velocities alone."""
    return replace(plan, set_points=plan.q[:, 7:] + robot.kd * plan.v[:, 6:] / robot.kp)


@dataclass(frozen=True)
class Variant:
    """How a row of the table differs from the first.

    Attributes:
        feed_forward: whether plans have feed-forward torques.
        environment: fields of EnvironmentConfig in training.
        patches: what stands for what in training, by dotted name in
            loco_drake.tracking.
        actor: the network that training leaves.
        trained: whether there is a policy at all, or only what is fed forward.
    """

    feed_forward: bool = True
    environment: dict[str, Any] = field(default_factory=dict)
    patches: dict[str, Any] = field(default_factory=dict)
    actor: type[Actor] = Actor
    trained: bool = True


VARIANTS = {
    "no policy": Variant(trained=False),
    "neither policy nor feed-forward": Variant(trained=False, feed_forward=False),
    "as shipped": Variant(),
    "no feed-forward torques": Variant(feed_forward=False),
    "no symmetry": Variant(
        patches={
            "ppo.SymmetricPolicy": PlainPolicy,
            "ppo.SymmetricStatistics": RunningMeanStd,
        },
        actor=PlainActor,
    ),
    "sees the next sample only": Variant(
        patches={"ppo.SymmetricPolicy": NearPolicy}, actor=NearActor
    ),
    "starts where plans begin": Variant(patches={"workers._work": work_from_beginning}),
    "ends by falls only": Variant(environment={"termination": ONLY_FALLS}),
    "learning rate fixed": Variant(patches={"ppo.AdaptivePPO": SteadyPPO}),
}


@dataclass(frozen=True)
class Library:
    """Plans to train on, and plans that are held out for the score."""

    training: list[Plan]
    held_out: list[Plan]

    def changed(self, change: Callable[[Plan], Plan]) -> "Library":
        """Returns the plans as ``change`` makes them."""
        return Library([*map(change, self.training)], [*map(change, self.held_out)])


def load_library(robot: Robot, folder: Path, labels: Sequence[str]) -> Library:
    """Returns the plans of Motion files LABEL-*.npz; the last of each are held out."""
    library = Library([], [])
    for label in labels:
        files = sorted(folder.glob(f"{label}-*.npz"))
        held_out = len(files) // _HELD_OUT
        if not held_out:
            raise InputError(
                f"{str(folder)!r} has {len(files)} motions {label}-*.npz, of which "
                f"{_HELD_OUT} are needed."
            )
        plans = smooth_motions(robot, map(load_motion, files))
        library.training.extend(plans[:-held_out])
        library.held_out.extend(plans[-held_out:])
    return library


def score(actor: Actor, plans: list[Plan], steps: int) -> dict[str, Any]:
    """Returns how well a policy follows the beginning and the end of each plan.

    An episode lasts ``steps``; it begins in the plan's state, actions are the policy's
    mean. Steps after a fall count 0.

    Returns:
        ``return``, mean normalized return, 0 to 100; the same of ``beginning`` and
        ``end``, and by label; ``falls``, the share of episodes that end in one.
    """
    steps = min(steps, *(len(plan) - 1 for plan in plans))
    config = EnvironmentConfig(
        robot=ROBOT,
        termination=ONLY_FALLS,
        episode_steps=steps,
        reset_noise=ResetNoise(joints=0, velocities=0, position=0, heading=0),
    )
    count = len(plans)
    batch = TrackingBatch(plans, config, 2 * count)
    for i, plan in enumerate(plans):
        batch.reset(i, np.random.default_rng(), i, 0)
        batch.reset(count + i, np.random.default_rng(), i, len(plan) - 1 - steps)
    stands = np.ones(2 * count, dtype=bool)
    returns: NDArray[np.float64] = np.zeros(2 * count)
    for _ in range(steps):
        with torch.inference_mode():
            actions = actor(torch.from_numpy(batch.observe())).numpy()
        terms, fallen, _ = batch.step(actions)
        stands &= ~fallen
        returns += 100 / steps * terms.sum(axis=-1) * stands
    parts = returns.reshape(2, count)
    labels = np.array([str(LABELS[plan.labels[0]]) for plan in plans])
    return {
        "return": float(parts.mean()),
        "beginning": float(parts[0].mean()),
        "end": float(parts[1].mean()),
        "falls": float(1 - stands.mean()),
        **{
            str(label): float(parts[:, labels == label].mean())
            for label in np.unique(labels)
        },
    }


def no_policy() -> Actor:
    """Returns a network whose actions are zero."""
    actor = Actor(ActorConfig(robot=ROBOT, labels=[]))
    for parameter in actor.parameters():
        torch.nn.init.zeros_(parameter)
    return actor


def run(
    variant: Variant, library: Library, config: TrainingConfig, folder: Path
) -> dict[str, Any] | None:
    """Trains and scores; returns nothing if it was interrupted."""
    robot = get_robot(ROBOT)
    if not variant.feed_forward:
        library = library.changed(partial(without_feed_forward, robot))
    environment = replace(config.environment, **variant.environment)
    steps = environment.episode_steps
    if not variant.trained:
        return score(no_policy(), library.held_out, steps)
    with ExitStack() as patched:
        for name, value in variant.patches.items():
            patched.enter_context(mock.patch(f"loco_drake.tracking.{name}", value))
        figures = train_tracker(
            library.training,
            replace(config, environment=environment),
            folder,
            resume=(folder / CHECKPOINT).exists(),
        )
    if figures["interrupted"]:
        return None
    shipped = load_actor(folder / POLICY, robot)
    actor = variant.actor(shipped.config)
    actor.load_state_dict(shipped.state_dict())
    _, header = load_checkpoint(folder / CHECKPOINT)
    return {
        **score(actor.eval(), library.held_out, steps),
        "steps": figures["steps"],
        "learning_rate": header["state"]["learning_rate"],
        "seconds": figures["wall_clock_s"],
    }


def row_of(name: str, runs: Sequence[dict[str, Any]], labels: Sequence[str]) -> str:
    """Returns a row of the table: mean, least and most of the seeds, means of parts."""
    returns = [run["return"] for run in runs]
    parts = [*labels, "beginning", "end"]
    values = [
        np.mean(returns),
        min(returns),
        max(returns),
        *(np.mean([run[part] for run in runs]) for part in parts),
        100 * np.mean([run["falls"] for run in runs]),
    ]
    return f"| {name} | " + " | ".join(f"{value:.1f}" for value in values) + " |"


def main(
    references: Path = Path("motions/tracked"),
    labels: tuple[str, ...] = ("dog-pace", "dog-trot", "horse-walk"),
    out: Path = Path("runs/tracker_ablation"),
    steps: int = 24 * PpoConfig.batch,
    seeds: tuple[int, ...] = (0, 1, 2),
    variants: tuple[str, ...] = tuple(VARIANTS),
    per_worker: int = 32,
    batch: int = PpoConfig.batch,
) -> None:
    """Trains the variants that are not there yet and prints the table.

    Args:
        references: holds Motion files LABEL-*.npz.
        labels: which of them.
        out: for the JSON files.
        steps: of each training.
        seeds: of each variant.
        variants: rows of the table.
        per_worker: robots that are simulated at once.
        batch: steps between updates.
    """
    library = cache(lambda: load_library(get_robot(ROBOT), references, labels))
    config = TrainingConfig(
        steps=steps,
        workers=1,
        per_worker=per_worker,
        environment=EnvironmentConfig(robot=ROBOT),
        ppo=PpoConfig(batch=batch, minibatch=min(batch, PpoConfig.minibatch)),
    )
    columns = ["return", "least", "most", *labels, "beginning", "end", "falls, %"]
    print(f"| {steps} steps | {' | '.join(columns)} |")
    print("|---" + "|---:" * len(columns) + "|", flush=True)
    for name in variants:
        runs = []
        for seed in seeds if VARIANTS[name].trained else (0,):
            file = out / f"{name.replace(' ', '_')}-{steps}-{seed}.json"
            if not file.exists():
                figures = run(
                    VARIANTS[name],
                    library(),
                    replace(config, seed=seed),
                    out / file.stem,
                )
                if figures is None:
                    return
                with atomic_path(file) as temporary:
                    temporary.write_text(json.dumps(figures, indent=2) + "\n")
            runs.append(json.loads(file.read_text()))
        print(row_of(name, runs, labels), flush=True)


if __name__ == "__main__":
    torch.set_num_threads(1)
    tyro.cli(main)
