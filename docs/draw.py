"""Draws pictures of the documentation, with the shipped weights.

From the root of the repository; `library` after ``loco-drake retarget``:

    python docs/draw.py gait-change docs/images/gait_change.png
    python docs/draw.py library docs/images/library.png

``loco-drake evaluate ... --figures`` draws the others.
"""

from pathlib import Path

import tyro
from matplotlib.figure import Figure

from loco_drake.common.files import atomic_path
from loco_drake.evaluation.dataset_picture import describe, library_figure
from loco_drake.evaluation.gait_change import change_figure
from loco_drake.generation.generate import generate_motions
from loco_drake.generation.motion_model import pretrained_motion_model
from loco_drake.motion.gait_schedule import parse_schedule
from loco_drake.motion.gaits import LABELS
from loco_drake.motion.motion_file import load_motion


def gait_change(
    png: tyro.conf.Positional[Path],
    gait: str = "dog-pace,dog-trot@3,dog-gallop@6",
    duration: float = 9.0,
    seed: int = 0,
    robot: str = "go2",
) -> None:
    """A motion that changes its gait twice: its feet and its speed."""
    model, schedule = pretrained_motion_model(robot), parse_schedule(gait)
    (motion,) = generate_motions(model, schedule, duration, [seed])
    write(change_figure(model.robot, motion, schedule), png)


def library(
    png: tyro.conf.Positional[Path], motions: Path = Path("motions/go2")
) -> None:
    """How much motion there is in a folder of Motion files, and how it differs."""
    loaded = map(load_motion, sorted(motions.glob("*.npz")))
    points = [describe(motion) for motion in loaded if motion.label in LABELS]
    title = f"{len(points)} stretches of motion, {sum(p.seconds for p in points):.0f} s"
    write(library_figure(points, title), png)


def write(figure: Figure, png: Path) -> None:
    """Writes the picture, wholly or not at all."""
    with atomic_path(png) as temporary:
        figure.savefig(temporary, dpi=80)


if __name__ == "__main__":
    tyro.extras.subcommand_cli_from_dict(
        {"gait-change": gait_change, "library": library}
    )
