"""How well a plan can be tracked, beside how well the shipped policies track it.

A shipped policy tracks a generated plan of each gait for some seconds. Then iterative
LQR, which knows the physics and the whole plan, improves its actions. What it reaches
motors and physics allow, and perhaps more. Run it from the root of the repository:

    OMP_NUM_THREADS=1 python benchmarks/ceiling.py --robot go2 --json ceiling.json
"""

from pathlib import Path
from typing import Any

import numpy as np
import tyro

from loco_drake.common.arrays import Array
from loco_drake.common.files import write_json
from loco_drake.control.actor_file import load_actor
from loco_drake.control.plan import Plan
from loco_drake.control.state import JOINTS, POSITION, split
from loco_drake.models.robots import get_robot
from loco_drake.models.shipped import policy_path
from loco_drake.motion.gaits import LABELS
from loco_drake.tracking.batch import TrackingBatch
from loco_drake.tracking.config import EnvironmentConfig, ResetNoise
from loco_drake.tracking.guidance import track
from loco_drake.tracking.guided_config import IlqrConfig
from loco_drake.tracking.ilqr import Ilqr
from loco_drake.tracking.problem import TrackingProblem
from loco_drake.tracking.references import generate_references

# Figures in the table, and their digits.
DIGITS = {
    "normalized_return": 1,
    "joint_rmse_rad": 3,
    "base_position_rmse_m": 3,
    "action_rms": 2,
}


def main(
    robot: str = "go2",
    labels: tuple[str, ...] = tuple(map(str, LABELS)),
    seed: int = 0,
    steps: int = 200,
    iterations: int = 10,
    change: float = 0.05,
    json: Path | None = None,
) -> None:
    """Prints both returns for each label.

    Args:
        robot: the robot.
        labels: gaits.
        seed: of the plans.
        steps: control periods that are tracked and improved, from the plan's start.
        iterations: of LQR at most.
        change: cost of the mean square change of the actions.
        json: file to write the figures to.
    """
    model = get_robot(robot)
    actor = load_actor(policy_path(model, None), model)
    still = ResetNoise(joints=0.0, velocities=0.0, position=0.0, heading=0.0)
    config = EnvironmentConfig(robot=robot, reset_noise=still, episode_steps=steps + 1)
    config.termination.position = config.termination.rotation = 3.0
    figures: dict[str, Any] = {}
    print("| gait | return | joints, rad | base, m | actions |")
    for label in labels:
        (plan,) = generate_references(model, [label], count=1, seconds=10.0, seed=seed)
        batch = TrackingBatch([plan], config, 1)
        batch.reset(0, np.random.default_rng(0), 0, 0)
        visited, taken = track(batch, actor, steps)
        problem = TrackingProblem(plan, config)
        law = Ilqr(problem, IlqrConfig(iterations=iterations, change=change)).improve(
            0, visited, taken, np.zeros(taken.shape[1])
        )
        own = {"policy": figures_of(problem, plan, visited, taken)}
        if law is not None:
            own["improved"] = figures_of(problem, plan, law.states, law.actions)
        figures[label] = own
        before, after = own["policy"], own.get("improved", own["policy"])
        cells = (f"{before[k]:.{n}f} to {after[k]:.{n}f}" for k, n in DIGITS.items())
        print(f"| {label} | {' | '.join(cells)} |", flush=True)
        if json is not None:
            write_json(json, figures)


def figures_of(
    problem: TrackingProblem, plan: Plan, states: Array, actions: Array
) -> dict[str, float]:
    """Returns the figures of a trajectory from the plan's start on."""
    q, _ = split(states[1:] - plan.state[1 : len(states)])
    return {
        "normalized_return": float(100 * problem.rewards(1, states[1:]).mean()),
        "joint_rmse_rad": float(np.sqrt(np.square(q[JOINTS]).mean())),
        "base_position_rmse_m": float(
            np.sqrt(np.square(q[POSITION]).sum(axis=-1).mean())
        ),
        "action_rms": float(np.sqrt(np.square(actions).mean())),
    }


if __name__ == "__main__":
    tyro.cli(main)
