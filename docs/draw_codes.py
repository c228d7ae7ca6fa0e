"""Draws how often the shipped tokenizer's codes are used by recordings.

From the root of the repository, after ``loco-drake retarget``:

    python docs/draw_codes.py docs/images/codes.png
"""

from pathlib import Path

import tyro

from loco_drake.common.files import atomic_path
from loco_drake.evaluation.generation_pictures import code_use_figure
from loco_drake.evaluation.recorded import load_recorded
from loco_drake.evaluation.tokenizer import evaluate_tokenizer
from loco_drake.generation.tokenizer import load_tokenizer
from loco_drake.models.shipped import pretrained_path


def main(png: tyro.conf.Positional[Path], motions: Path = Path("motions/go2")) -> None:
    """Encodes the Motion files of a folder and their mirror images, and draws."""
    robot, recorded = load_recorded(motions)
    tokenizer = load_tokenizer(pretrained_path("tokenizer"))
    figures, counts = evaluate_tokenizer(tokenizer, recorded)
    title = f"{robot.name}: {figures['codebook_use']:.1%} of the codes are used"
    with atomic_path(png) as temporary:
        code_use_figure(counts, title).savefig(temporary, dpi=80)


if __name__ == "__main__":
    tyro.cli(main)
