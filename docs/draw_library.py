"""Draws the picture of the library: how much motion there is, and how it differs.

From the root of the repository, after ``loco-drake retarget``:

    python docs/draw_library.py docs/images/library.png
"""

from pathlib import Path

import tyro

from loco_drake.common.files import atomic_path
from loco_drake.evaluation.dataset_picture import describe, library_figure
from loco_drake.motion.gaits import LABELS
from loco_drake.motion.motion_file import load_motion


def main(png: tyro.conf.Positional[Path], motions: Path = Path("motions/go2")) -> None:
    """Reads the Motion files of a folder one by one and draws."""
    points = []
    for path in sorted(motions.glob("*.npz")):
        motion = load_motion(path)
        if motion.label in LABELS:
            points.append(describe(motion))
    title = f"{len(points)} stretches of motion, {sum(p.seconds for p in points):.0f} s"
    with atomic_path(png) as temporary:
        library_figure(points, title).savefig(temporary, dpi=80)


if __name__ == "__main__":
    tyro.cli(main)
