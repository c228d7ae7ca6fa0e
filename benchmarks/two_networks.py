"""How much each of a shipped policy's two networks does, alone and with the other.

Episodes of all fifteen gaits are simulated as by ``loco-drake evaluate tracking``,
undisturbed and with ``--pushes``: with the network near the plan alone, with the one
far from it alone, and with both. Run it from the root of the repository:

    OMP_NUM_THREADS=1 python benchmarks/two_networks.py --robot go2 --seeds 3
"""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import tyro

from loco_drake.cli.output import write_json
from loco_drake.control.actor_file import load_actor, save_actor
from loco_drake.engine.choice import make_executor
from loco_drake.evaluation.tracking_table import (
    generated_trials,
    run_trials,
    summarize,
)
from loco_drake.models.robots import get_robot
from loco_drake.models.shipped import policy_path
from loco_drake.systems.scenario import GeneratedReference, Scenario, TrainedPolicy
from loco_drake.tracking.joining import near_of, recovery_of
from loco_drake.tracking.randomization import PUSHES, RandomizationConfig

SECONDS = 10.0
WORLDS = {
    "undisturbed": RandomizationConfig(),
    "pushed": PUSHES,
}


def main(
    robot: str = "go2",
    policy: Path | None = None,
    seeds: int = 3,
    workers: int = 1,
    json: Path | None = None,
) -> None:
    """Prints return and falls of each network and of both.

    Args:
        robot: the robot.
        policy: a policy of two networks; by default the shipped one.
        seeds: number of episodes of each gait, in each world.
        workers: processes that simulate.
        json: where to write the figures.
    """
    model = get_robot(robot)
    both = load_actor(policy_path(model, policy), model)
    far = recovery_of(both)
    assert far is not None, "a policy of one network"
    actors = {"near": near_of(both), "far": far, "both": both}
    trials = generated_trials(both.config.labels, range(seeds), SECONDS)
    figures: dict[str, Any] = {}
    with TemporaryDirectory() as folder:
        for name, actor in actors.items():
            path = Path(folder) / f"{name}.safetensors"
            save_actor(actor, path)
            scenario = Scenario(
                robot=model.definition,
                policy=TrainedPolicy(weights=path),
                reference=GeneratedReference(
                    gait=both.config.labels[0], duration=SECONDS
                ),
            )
            executor = make_executor("local", workers, None)
            for world, randomization in WORLDS.items():
                episodes = run_trials(scenario, trials, executor, randomization)
                own = summarize(list(episodes))["all"]
                figures.setdefault(name, {})[world] = own
                print(
                    f"{robot} {name:5} {world:12}"
                    f" return {own['normalized_return']:.1f},"
                    f" falls {100 * own['fall_rate']:.0f} %,"
                    f" base {100 * own['base_position_rmse_m']:.1f} cm",
                    flush=True,
                )
    if json is not None:
        write_json(json, figures)


if __name__ == "__main__":
    tyro.cli(main)
