"""What the environment costs beyond the plant: prints the ratio of their speeds.

The environments of one training worker, 16 robots, are stepped with zero actions on
generated references, resets included.
The bare plant (plant and scene graph, nothing else) is stepped as often at the same
rate, in the same episodes: it starts in the same states and is sent the same targets,
so that its legs swing and land as often; resets are not counted. They take turns in one
process, and medians of its processor time are compared, so that a busy machine does
little harm. Run it from the root of the repository:

    OMP_NUM_THREADS=1 python benchmarks/environment.py
"""

import statistics
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from loco_drake.cli.output import write_json
from loco_drake.control.action import set_points
from loco_drake.control.plan import PLAN_DT, Plan, plan_from_motion
from loco_drake.control.retiming import path_limits, smooth_plan
from loco_drake.generation.generate import generate_motions
from loco_drake.generation.motion_model import pretrained_motion_model
from loco_drake.models.plant import AddRobotPlant, ConfigureSimulator, PlantConfig
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import parse_label
from loco_drake.tracking.batch import TrackingBatch
from loco_drake.tracking.config import EnvironmentConfig
from loco_drake.tracking.randomization import STANDARD, RandomizationConfig

ROBOT = "go2"
ROBOTS = 16  # in a worker


def make_plans() -> list[Plan]:
    """Returns references such as training uses."""
    robot = get_robot(ROBOT)
    limits = path_limits(robot)
    model = pretrained_motion_model(ROBOT)
    return [
        smooth_plan(robot, plan_from_motion(robot, motion), limits)
        for gait in ("dog-pace", "dog-trot")
        for motion in generate_motions(model, parse_label(gait), 6.0, range(4))
    ]


@dataclass
class Episode:
    """What the environment did: ``steps`` from sample ``first`` of a plan."""

    plan: Plan
    first: int
    steps: int = 0


class Environment:
    """Steps the environments of one training worker and remembers their episodes."""

    def __init__(
        self, plans: list[Plan], config: PlantConfig, randomization: RandomizationConfig
    ) -> None:
        self._plans = plans
        environment = EnvironmentConfig(
            robot=ROBOT, plant=config, randomization=randomization
        )
        self._batch = TrackingBatch(plans, environment, ROBOTS)
        self._random = np.random.default_rng(0)

    def run(self, steps: int) -> tuple[float, list[Episode]]:
        """Does ``steps`` in all; returns the seconds they took and the episodes."""
        actions = np.zeros((ROBOTS, 12))
        start = time.process_time()
        current = [self._reset(i) for i in range(ROBOTS)]
        episodes = list(current)
        for _ in range(steps // ROBOTS):
            _, terminated, truncated = self._batch.step(actions)
            self._batch.observe()
            for episode in current:
                episode.steps += 1
            ended = np.flatnonzero(terminated | truncated)
            for i in ended:
                current[i] = self._reset(int(i))
                episodes.append(current[i])
            if len(ended):
                self._batch.observe(ended)
        return time.process_time() - start, episodes

    def _reset(self, i: int) -> Episode:
        self._batch.reset(i, self._random)
        return Episode(self._plans[self._batch.plan[i]], int(self._batch.start[i]))


class BarePlant:
    """Steps a diagram of plant and scene graph."""

    def __init__(self, config: PlantConfig) -> None:
        self._robot = get_robot(ROBOT)
        builder = DiagramBuilder()
        self._plant, _, instance = AddRobotPlant(builder, self._robot, config)
        self._simulator = Simulator(builder.Build())
        ConfigureSimulator(self._simulator, config)
        self._context = self._plant.GetMyMutableContextFromRoot(
            self._simulator.get_mutable_context()
        )
        self._targets = self._plant.get_desired_state_input_port(instance).FixValue(
            self._context, np.zeros(24)
        )

    def follow(self, episodes: list[Episode]) -> float:
        """Does what the environment did; returns the seconds spent stepping."""
        return sum(self._follow(episode) for episode in episodes)

    def _follow(self, episode: Episode) -> float:
        plan, first = episode.plan, episode.first
        self._simulator.get_mutable_context().SetTime(0.0)
        self._plant.SetPositionsAndVelocities(self._context, plan.state[first])
        self._simulator.Initialize()
        samples = np.minimum(first + 1 + np.arange(episode.steps), len(plan) - 1)
        targets = set_points(self._robot, plan)[samples]
        desired = np.hstack((targets, np.zeros_like(targets)))
        start = time.process_time()
        for step, value in enumerate(desired, start=1):
            self._targets.GetMutableData().get_mutable_value().set_value(value)
            self._simulator.AdvanceTo(step * PLAN_DT, interruptible=False)
        return time.process_time() - start


def main(
    steps: int = 320,
    turns: int = 15,
    contact: str = "similar",
    time_step: float = 0.01,
    randomize: bool = False,
    json: Path | None = None,
) -> None:
    """Measures and prints.

    Args:
        steps: in each turn.
        turns: medians are of.
        contact: solver.
        time_step: of the physics, s.
        randomize: draw worlds in the environment.
        json: where to write the figures.
    """
    config = PlantConfig(contact=contact, time_step=time_step)
    plans = make_plans()
    randomization = STANDARD if randomize else RandomizationConfig()
    environment = Environment(plans, config, randomization)
    bare = BarePlant(config)
    bare.follow(environment.run(100)[1])  # warm
    pairs = []
    for _ in range(turns):
        own, episodes = environment.run(steps)
        pairs.append((own, bare.follow(episodes)))
    own, plant = (
        statistics.median(spent) / steps for spent in zip(*pairs, strict=True)
    )
    ratio = statistics.median(theirs / ours for ours, theirs in pairs)
    print(f"environment {1e3 * own:.3f} ms a step, {1 / own:.0f} steps/s")
    print(f"bare plant  {1e3 * plant:.3f} ms a step, {1 / plant:.0f} steps/s")
    print(f"ratio of their speeds {ratio:.3f}")
    figures = {
        "environment_steps_per_second": 1 / own,
        "plant_steps_per_second": 1 / plant,
        "ratio_to_plant": ratio,
    }
    write_json(json, figures)


if __name__ == "__main__":
    tyro.cli(main)
