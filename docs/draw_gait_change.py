"""Draws a motion that changes its gait twice: its feet and its speed.

From the root of the repository:

    python docs/draw_gait_change.py docs/images/gait_change.png
"""

from pathlib import Path

import tyro

from loco_drake.common.files import atomic_path
from loco_drake.evaluation.gait_change import change_figure
from loco_drake.generation.generate import generate_motions
from loco_drake.generation.motion_model import pretrained_motion_model
from loco_drake.motion.gait_schedule import parse_schedule


def main(
    png: tyro.conf.Positional[Path],
    gait: str = "dog-pace,dog-trot@3,dog-gallop@6",
    duration: float = 9.0,
    seed: int = 0,
    robot: str = "go2",
) -> None:
    """Generates the motion with the shipped weights and draws it."""
    model, schedule = pretrained_motion_model(robot), parse_schedule(gait)
    (motion,) = generate_motions(model, schedule, duration, [seed])
    with atomic_path(png) as temporary:
        figure = change_figure(model.robot, motion, schedule)
        figure.savefig(temporary, dpi=80)


if __name__ == "__main__":
    tyro.cli(main)
