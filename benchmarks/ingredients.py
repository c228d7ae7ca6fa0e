"""What each ingredient of a tough policy brings, in short trainings from nothing.

Trains one policy of one network for each ingredient and seed, on generated motion of
six gaits, and evaluates it as ``loco-drake evaluate tracking`` does: undisturbed, with
``--pushes`` and with ``--randomize``. Run it from the root of the repository; what is
in the JSON file is not done again:

    OMP_NUM_THREADS=1 python benchmarks/ingredients.py --json ingredients.json

``--table ingredients*.json`` prints the means of such files, and the least and largest
of the seeds.
"""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import tyro

from loco_drake.common.files import read_json, write_json
from loco_drake.engine.choice import make_executor
from loco_drake.evaluation.tracking_table import (
    generated_trials,
    run_trials,
    summarize,
)
from loco_drake.models.robots import get_robot
from loco_drake.systems.scenario import GeneratedReference, Scenario, TrainedPolicy
from loco_drake.tracking.config import EnvironmentConfig, PpoConfig, TrainingConfig
from loco_drake.tracking.randomization import PUSHES, STANDARD, RandomizationConfig
from loco_drake.tracking.references import generate_references
from loco_drake.tracking.train import POLICY, train_tracker

LABELS = ["dog-pace", "dog-trot", "horse-walk", "horse-trot", "mpc-trot", "solo8-walk"]
MOTIONS, FIRST_SEED = 12, 1000  # of each label, to train on
SECONDS = 10.0
PUSHED = RandomizationConfig(push=(0.3, 1.1), push_interval=(2.0, 4.0))
OTHERS = replace(STANDARD, push=None)
ALL = replace(OTHERS, push=PUSHED.push, push_interval=PUSHED.push_interval)
# What an environment has, by the name of the ingredient.
INGREDIENTS: dict[str, dict[str, Any]] = {
    "none": {},
    "pushes": {"randomization": PUSHED},
    "random worlds": {"randomization": OTHERS},
    "both": {"randomization": ALL},
    "both in half of the worlds": {"randomization": replace(ALL, nominal_share=0.5)},
    "both, starts at failures": {"randomization": ALL, "failure_weight": 0.5},
}
WORLDS = {
    "undisturbed": RandomizationConfig(),
    "pushed": PUSHES,
    "randomized": STANDARD,
}


def main(
    robot: str = "go2",
    steps: int = 200_000,
    seeds: tuple[int, ...] = (0, 1, 2),
    episodes: int = 3,
    only: tuple[str, ...] = tuple(INGREDIENTS),
    json: Path = Path("ingredients.json"),
    table: tuple[Path, ...] = (),
) -> None:
    """Trains and evaluates, and writes the figures after each training.

    Args:
        robot: the robot.
        steps: of each training.
        seeds: of the trainings.
        episodes: of each gait in each world.
        only: names of ingredients.
        json: file of the figures.
        table: files to print instead of training.
    """
    if table:
        show({k: v for path in table for k, v in read_json(path).items()})
        return
    model = get_robot(robot)
    figures: dict[str, Any] = read_json(json) if json.is_file() else {}
    plans = generate_references(
        model, LABELS, count=MOTIONS, seconds=SECONDS, seed=FIRST_SEED
    )
    for seed in seeds:
        for name in only:
            key, parts = f"{name}, seed {seed}", INGREDIENTS[name]
            if key in figures:
                continue
            config = TrainingConfig(
                steps=steps,
                workers=1,
                per_worker=32,
                seed=seed,
                environment=EnvironmentConfig(
                    robot=robot,
                    position_penalty=0.3,
                    fall_cost=15,
                    action_penalty=0.1,
                    **parts,
                ),
                ppo=PpoConfig(batch=1024, minibatch=128, target_kl=0.04, log_std=-1.0),
            )
            with TemporaryDirectory() as folder:
                train_tracker(plans, config, Path(folder))
                figures[key] = evaluate(robot, Path(folder) / POLICY, episodes)
            write_json(json, figures)
            print(key, figures[key], flush=True)
    show(figures)


def evaluate(robot: str, policy: Path, episodes: int) -> dict[str, Any]:
    """Returns return and share of falls in each world."""
    scenario = Scenario(
        robot=robot,
        policy=TrainedPolicy(weights=policy),
        reference=GeneratedReference(gait=LABELS[0], duration=SECONDS),
    )
    trials = generated_trials(LABELS, range(episodes), SECONDS)
    executor = make_executor("local", 1, None)
    found = {}
    for world, randomization in WORLDS.items():
        done = list(run_trials(scenario, trials, executor, randomization))
        own = summarize(done)["all"]
        found[world] = {k: own[k] for k in ("normalized_return", "fall_rate")}
    return found


def show(figures: dict[str, Any]) -> None:
    """Prints a table: mean over seeds, with the least and the largest, and falls."""
    print(f"| trained with | {' | '.join(WORLDS)} |")
    for name in INGREDIENTS:
        own = [v for k, v in figures.items() if k.rsplit(", seed", 1)[0] == name]
        if not own:
            continue
        cells = []
        for world in WORLDS:
            returns = [one[world]["normalized_return"] for one in own]
            falls = 100 * np.mean([one[world]["fall_rate"] for one in own])
            cells.append(
                f"{np.mean(returns):.1f} ({min(returns):.1f} to {max(returns):.1f}), "
                f"{falls:.0f} %"
            )
        print(f"| {name} | {' | '.join(cells)} |")


if __name__ == "__main__":
    tyro.cli(main)
