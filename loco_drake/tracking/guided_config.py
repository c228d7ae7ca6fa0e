"""Configuration of guided policy search; also the command's options."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
import tyro

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError, check_at_least, check_bounds
from loco_drake.control.plan import PLAN_DT
from loco_drake.control.state import TerminationConfig
from loco_drake.models.plant import PlantConfig
from loco_drake.tracking.config import EnvironmentConfig, ResetNoise
from loco_drake.tracking.randomization import RandomizationConfig

FEWEST = 25  # samples of a law


@dataclass(kw_only=True)
class IlqrConfig:
    """How actions are improved."""

    # Linearizations of the physics at most.
    iterations: int = 5
    # Steps with each of them at most.
    steps: int = 3
    # Cost of the mean square of the actions.
    effort: float = 0.02
    # Cost of the mean square of their changes. Without it the actions alternate from
    # period to period, which no policy learns.
    change: float = 0.15
    # Cost of actions that keeps the gains low.
    gain_cost: float = 0.3


@dataclass(kw_only=True)
class StretchConfig:
    """The stretches of plans on which laws are found."""

    # Control periods that are optimized together.
    length: int = 110
    # Of these, those at the end whose law is dropped: it knows nothing of what follows.
    tail: int = 15
    # Control periods that the policy tracks before, at most.
    lead: int = 30
    # Share of the stretches that have a lead; the others start beside the plan.
    lead_share: float = 0.25
    # Speed of a push at the beginning, in any direction, m/s: least and largest.
    push: Annotated[tuple[float, float], tyro.conf.arg(metavar="LOW HIGH")] = (0.0, 0.0)
    # How often a stretch that the policy loses is improved before the policy goes on.
    rescues: int = 3
    # Iterative LQR: one linearization, since the policy comes back with another motion.
    ilqr: IlqrConfig = field(default_factory=lambda: IlqrConfig(iterations=1))

    def draw(self, random: np.random.Generator, length: int) -> tuple[int, int]:
        """Returns where in a plan of ``length`` samples a stretch begins, and its lead.

        The lead, in control periods, comes after that sample.
        """
        lead = int(random.integers(self.lead + 1) * (random.random() < self.lead_share))
        return int(random.integers(max(1, length - self.length - lead - 2))), lead

    def draw_push(self, random: np.random.Generator) -> Array:
        """Returns the change of the base's velocity v_WB by a push, m/s."""
        if not max(self.push):
            return np.zeros(3)
        speed, angle = random.uniform(*self.push), random.uniform(-np.pi, np.pi)
        return speed * np.array([np.cos(angle), np.sin(angle), 0.0])

    def check(self) -> None:
        """Raises InputError unless laws can be found."""
        check_at_least("stretch.length", self.length, FEWEST + self.tail)
        check_at_least("stretch.tail", self.tail, 0)
        check_at_least("stretch.lead", self.lead, 0)
        check_at_least("stretch.rescues", self.rescues, 0)
        check_bounds("--stretch.push", self.push[0], 0)
        check_bounds("--stretch.push", self.push[1], self.push[0], 5)
        check_bounds("--stretch.lead-share", self.lead_share, 0, 1)
        for name in ("iterations", "steps"):
            check_at_least(f"stretch.ilqr.{name}", getattr(self.ilqr, name), 1)
        for name in ("effort", "change", "gain_cost"):
            option = f"--stretch.ilqr.{name.replace('_', '-')}"
            check_bounds(option, getattr(self.ilqr, name), 0, above=True)


@dataclass(kw_only=True)
class GuidedConfig:
    """Configuration of guided policy search."""

    # Number of training steps: rounds, in each of which laws are found along what the
    # policy does, and it learns them.
    steps: int = 6
    # Stretches of a round.
    stretches: int = 300
    # Number of worker processes.
    workers: int = 2
    # Seed: of all random numbers.
    seed: int = 0
    # Number of updates: in a round.
    updates: int = 5000
    # Samples in a minibatch.
    minibatch: int = 512
    # Learning rate: the initial one of a round, which decays to 0 as a half cosine.
    learning_rate: float = 7e-4
    # Network that learns: of two, the one that acts near the plan or far from it.
    learns: Annotated[Literal["near", "far"], tyro.conf.arg(metavar="near|far")] = (
        "near"
    )
    # Weight of staying as it is where it gets to, by itself; 0 lets it forget.
    keep: float = 0.0
    # Stretches on which it is seen where that is.
    kept_stretches: int = 1500
    # Samples that are kept to learn from.
    capacity: int = 120_000
    # Where laws are found.
    stretch: StretchConfig = field(default_factory=StretchConfig)
    # Robot: go2, a1, or a YAML file, see docs/own_robot.md; or g1, see
    # docs/humanoid.md.
    robot: Annotated[str, tyro.conf.arg(metavar="ROBOT|FILE")] = "go2"
    # Contact solver, time step and friction.
    plant: PlantConfig = field(default_factory=PlantConfig)
    # Distance from the plan at which the policy has lost it.
    termination: TerminationConfig = field(
        default_factory=lambda: TerminationConfig(position=1.5, rotation=1.2)
    )
    # Standard deviations of the initial state about the plan.
    reset_noise: ResetNoise = field(default_factory=ResetNoise)
    # Domain randomization: worlds in which laws are found; a range is two numbers.
    randomization: RandomizationConfig = field(default_factory=RandomizationConfig)

    @property
    def environment(self) -> EnvironmentConfig:
        """The world in which laws are found."""
        return EnvironmentConfig(
            robot=self.robot,
            plant=self.plant,
            termination=self.termination,
            reset_noise=self.reset_noise,
            randomization=self.randomization,
        )

    def check(self) -> None:
        """Raises InputError unless a training can begin."""
        for name in ("stretches", "workers", "updates", "minibatch", "capacity"):
            check_at_least(name, getattr(self, name), 1)
        check_at_least("seed", self.seed, 0)
        check_bounds("--keep", self.keep, 0)
        check_at_least("kept_stretches", self.kept_stretches, 1)
        check_bounds("--learning-rate", self.learning_rate, 0, 1, above=True)
        self.stretch.check()
        self.environment.check()
        for name in ("push", "noise", "slope", "roughness"):
            if getattr(self.randomization, name) is not None:
                raise InputError(
                    f"Laws are found in worlds without {name}: leave out "
                    f"--randomization.{name}."
                )
        if (self.randomization.latency or (0.0,))[-1] > PLAN_DT:
            raise InputError(
                f"Laws are found for a latency of at most {PLAN_DT:g} s: lower "
                "--randomization.latency."
            )
