"""How well the shipped policy tracks generated references: a table over seeds.

Run it from the root of the repository:

    OMP_NUM_THREADS=1 python benchmarks/tracking.py --seeds 10
    OMP_NUM_THREADS=1 python benchmarks/tracking.py --seeds 3 --contact cenic

The figures are those of loco_drake.evaluation.tracking, means over the seeds; the worst
return and the falls are counted over the same.
"""

import logging
from pathlib import Path

import numpy as np
import tyro

from loco_drake.evaluation.rollout import Recorder
from loco_drake.evaluation.tracking import tracking_metrics
from loco_drake.models.plant import PlantConfig
from loco_drake.systems.plan import PLAN_DT
from loco_drake.systems.scenario import Scenario, TrainedPolicy

COLUMNS = (
    ("normalized_return", "return", "{:.1f}"),
    ("joint_rmse_rad", "joints, rad", "{:.3f}"),
    ("base_position_rmse_m", "base, m", "{:.3f}"),
    ("base_orientation_rmse_rad", "base, rad", "{:.3f}"),
    ("stretch", "stretch", "{:.3f}"),
    ("speed_mps", "m/s", "{:.2f}"),
    ("real_time_factor", "x real time", "{:.1f}"),
)


def main(
    robot: str = "go2",
    gaits: tuple[str, ...] = ("dog-pace", "dog-trot"),
    seeds: int = 10,
    duration: float = 10.0,
    contact: str = "similar",
    time_step: float = 0.01,
    accuracy: float = 1e-4,
    friction: float = 0.8,
    policy: Path | None = None,
) -> None:
    """Prints the table as Markdown."""
    logging.getLogger("drake").setLevel(logging.ERROR)
    plant = PlantConfig(
        contact=contact, time_step=time_step, accuracy=accuracy, friction=friction
    )
    recorder = Recorder(
        Scenario(robot=robot, plant=plant, policy=TrainedPolicy(weights=policy))
    )
    titles = [title for _, title, _ in COLUMNS]
    print(f"{contact}, {1000 * time_step:g} ms, {seeds} seeds of {duration:g} s\n")
    print(f"| gait | {' | '.join(titles)} | worst return | falls |")
    print("|---|" + "---:|" * (len(COLUMNS) + 2))
    for gait in gaits:
        rows = []
        for seed in range(seeds):
            recorder.start(gait=gait, seed=seed)
            rollout, wall = recorder.run(duration)
            figures = tracking_metrics(rollout)
            figures["real_time_factor"] = (len(rollout.state) - 1) * PLAN_DT / wall
            figures["fell"] = rollout.fell
            rows.append(figures)
        means = [
            text.format(np.mean([row[name] for row in rows]))
            for name, _, text in COLUMNS
        ]
        worst = min(row["normalized_return"] for row in rows)
        falls = sum(row["fell"] for row in rows)
        print(f"| {gait} | {' | '.join(means)} | {worst:.1f} | {falls} |", flush=True)


if __name__ == "__main__":
    tyro.cli(main)
