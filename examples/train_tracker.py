"""Train a tracker for a minute, on motion that the shipped generator writes.

Prints the mean return of recent episodes, by gait, after each batch: 100 is a perfect
match. A minute is enough to see it rise; a good policy takes an hour or more. What was
learned is written to a folder, and can be watched:

    python examples/train_tracker.py
    loco-drake simulate --policy runs/example/policy.safetensors
"""

from pathlib import Path

import tyro

from loco_drake.models.robots import get_robot
from loco_drake.tracking.config import PpoConfig, TrainingConfig
from loco_drake.tracking.references import generate_references
from loco_drake.tracking.train import train_tracker


def train(
    steps: int = 40_000,
    batch: int = 4096,
    references: int = 8,
    seconds: float = 4.0,
    workers: int = 2,
    out: Path = Path("runs/example"),
) -> None:
    """Trains a tracker.

    Args:
        steps: environment steps of 20 ms, in all.
        batch: environment steps between updates.
        references: motions for each gait.
        seconds: length of a motion.
        workers: processes that simulate, with 8 environments each.
        out: folder for the policy, the checkpoint and the logs.
    """
    robot = get_robot("go2")
    gaits = ("dog-pace", "dog-trot")
    plans = generate_references(robot, gaits, count=references, seconds=seconds, seed=0)
    print(f"{len(plans)} references of {seconds:g} s")

    config = TrainingConfig(
        steps=steps,
        workers=workers,
        ppo=PpoConfig(batch=batch, minibatch=batch // 4),
    )

    def show(done: int, scores: dict[str, float]) -> None:
        returns = ", ".join(f"{label} {r:.1f}" for label, r in scores.items())
        print(f"{done} of {steps} steps: {returns}", flush=True)

    figures = train_tracker(plans, config, out, report=show)
    show(figures["steps"], figures["scores"])
    seconds = figures["wall_clock_s"]
    print(f"{seconds:.0f} s; the policy is {out / 'policy.safetensors'}")


if __name__ == "__main__":  # workers import this file again
    tyro.cli(train)
