"""What the environment costs beyond the plant: prints the ratio of their speeds.

The environments of one training worker, 16 robots, are stepped with zero actions on
generated references, resets included.
The bare plant (plant and scene graph, nothing else) is stepped as often at the same
rate, in the same episodes: it starts in the same states and is sent the same targets,
so that its legs swing and land as often; resets are not counted. For comparison it also
stands still, which is easier for the contact solver. All take turns in one process, and
medians of its processor time are compared, so that a busy machine does little harm.
Run it from the root of the repository:

    OMP_NUM_THREADS=1 python benchmarks/environment.py
"""

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from loco_drake.cli.output import write_json
from loco_drake.control.action import set_points
from loco_drake.control.observation import LOOK_AHEAD, Preview, observe
from loco_drake.control.plan import PLAN_DT, Plan, plan_from_motion
from loco_drake.control.retiming import path_limits, smooth_plan
from loco_drake.control.reward import reward_terms
from loco_drake.control.state import has_fallen
from loco_drake.generation.generate import generate_motions
from loco_drake.generation.motion_model import pretrained_motion_model
from loco_drake.models.plant import AddRobotPlant, ConfigureSimulator, PlantConfig
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import parse_label
from loco_drake.tracking.batch import TrackingBatch
from loco_drake.tracking.config import EnvironmentConfig, TerminationConfig
from loco_drake.tracking.randomization import STANDARD, RandomizationConfig

ROBOT = "go2"
ROBOTS = 16  # in a worker
# What is measured, and its name in the JSON file.
ROWS = {
    "environment": "environment",
    "bare plant, same episodes": "plant",
    "bare plant, standing": "standing_plant",
}


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
        self.resets = 0
        self.reset_seconds = 0.0

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
        start = time.process_time()
        self._batch.reset(i, self._random)
        self.reset_seconds += time.process_time() - start
        self.resets += 1
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
        self._restart(plan.state[first])
        samples = np.minimum(first + 1 + np.arange(episode.steps), len(plan) - 1)
        return self._advance(set_points(self._robot, plan)[samples])

    def stand(self, steps: int) -> float:
        """Stands still for ``steps``; returns the seconds they took."""
        robot = self._robot
        height = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, robot.stand_height]
        self._restart(np.concatenate((height, robot.stand_joints, np.zeros(18))))
        return self._advance(np.tile(robot.stand_joints, (steps, 1)))

    def _restart(self, state: NDArray[np.float64]) -> None:
        self._simulator.get_mutable_context().SetTime(0.0)
        self._plant.SetPositionsAndVelocities(self._context, state)
        self._simulator.Initialize()

    def _advance(self, targets: NDArray[np.float64]) -> float:
        desired = np.hstack((targets, np.zeros_like(targets)))
        start = time.process_time()
        for step, value in enumerate(desired, start=1):
            self._targets.GetMutableData().get_mutable_value().set_value(value)
            self._simulator.AdvanceTo(step * PLAN_DT, interruptible=False)
        return time.process_time() - start


def parts(plan: Plan, calls: int = 100) -> dict[str, float]:
    """Returns the seconds a robot that the environment's own computations take."""
    robot, termination = get_robot(ROBOT), TerminationConfig()
    rows = slice(40, 40 + ROBOTS)
    wanted, toes = plan.state[rows], plan.p_BoF_H[rows]
    state = wanted + 0.01
    ahead = np.arange(40, 40 + ROBOTS)[:, None] + LOOK_AHEAD
    shown = Preview(
        plan.q[ahead], plan.v[ahead], plan.contacts[ahead], plan.labels[rows]
    )
    action = np.zeros((ROBOTS, 12))
    functions: dict[str, Callable[[], object]] = {
        "observe": lambda: observe(robot, shown, state, action),
        "reward_terms": lambda: reward_terms(robot, wanted, toes, state),
        "has_fallen": lambda: has_fallen(robot, state[:, :19]),
        "exceeded": lambda: termination.exceeded(state, wanted),
    }
    seconds = {}
    for name, function in functions.items():
        start = time.process_time()
        for _ in range(calls):
            function()
        seconds[name] = (time.process_time() - start) / calls / ROBOTS
    return seconds


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
    environment.resets, environment.reset_seconds = 0, 0.0

    seconds: dict[str, list[float]] = {name: [] for name in ROWS}
    for _ in range(turns):
        own, episodes = environment.run(steps)
        for name, spent in zip(
            ROWS, (own, bare.follow(episodes), bare.stand(steps)), strict=True
        ):
            seconds[name].append(spent)

    figures = {}
    print(f"{'':26} steps/s  ms a step  ratio")
    for name, key in ROWS.items():
        each = statistics.median(seconds[name]) / steps
        pairs = zip(seconds[name], seconds["environment"], strict=True)
        ratio = statistics.median(theirs / own for theirs, own in pairs)
        print(f"{name:26} {1 / each:7.0f} {1e3 * each:10.3f} {ratio:6.3f}")
        figures[f"{key}_steps_per_second"] = 1 / each
        figures[f"ratio_to_{key}"] = ratio
    print("\nof the environment's step (the functions alone, in a loop):")
    resets = f"resets ({environment.resets})"
    costs = {resets: environment.reset_seconds / steps / turns, **parts(plans[0])}
    for name, each in costs.items():
        print(f"{name:26} {1e3 * each:18.3f}")
    write_json(json, figures)


if __name__ == "__main__":
    tyro.cli(main)
