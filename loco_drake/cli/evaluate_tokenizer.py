"""The command ``evaluate tokenizer``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from loco_drake.cli.evaluation import (
    of_robots,
    robot_names,
    write_figure,
)
from loco_drake.cli.output import print_failed, print_table, write_json
from loco_drake.cli.trained_on import trained_on
from loco_drake.common.errors import InputError, check_at_least, check_choice
from loco_drake.datasets.registry import data_dir
from loco_drake.evaluation.generation_pictures import code_use_figure
from loco_drake.evaluation.recorded import retarget_recordings
from loco_drake.evaluation.tokenizer import evaluate_tokenizer
from loco_drake.generation.tokenizer import Tokenizer, load_tokenizer
from loco_drake.models.robots import ROBOTS, get_robot
from loco_drake.models.shipped import pretrained_path
from loco_drake.motion.gaits import parse_label


@dataclass(kw_only=True)
class EvaluateTokenizer:
    """Turns recordings into tokens and back, and says how well that went.

    Errors of joints and toes on recordings that were held out from training, and how
    much of the codebooks is used. docs/generation.md defines each figure.
    """

    robot: str = "go2"
    """The robot: go2, a1 or all."""
    labels: tuple[str, ...] = ()
    """Such as dog-trot dog-pace. Default: the fifteen, as far as there are recordings
    of them."""
    data_dir: Path | None = None
    """Folder of the recordings. Default: $LOCO_DRAKE_DATA, else the user's cache."""
    tokenizer: Path | None = None
    """Weights from `train tokenizer`. Default: those that come with the package."""
    books: int | None = None
    """Codebooks to decode from, the coarsest first. Default: all."""
    workers: int = 1
    """Processes that retarget the recordings."""
    figures: Path | None = None
    """Writes a picture of the codes' use to this folder."""
    seeds: int = 1
    """As in every evaluation; a tokenizer is not random, so one seed says it all."""
    seed: int = 0
    """As in every command; nothing here is random."""
    json: Path | None = None
    """Writes the figures to this file."""

    def run(self) -> int:
        """Prints a table for each robot and writes the figures; returns 0.

        Raises:
            InputError: if an option is wrong.
        """
        check_choice("robot", self.robot, (*ROBOTS, "all"))
        check_at_least("seeds", self.seeds, 1)
        check_at_least("workers", self.workers, 1)
        for label in self.labels:
            parse_label(label)
        tokenizer = load_tokenizer(self.tokenizer or pretrained_path("tokenizer"))
        books = tokenizer.config.books
        if self.books is not None and not 1 <= self.books <= books:
            raise InputError(
                f"--books must be from 1 to {books}, as many as the tokenizer has, "
                f"not {self.books}."
            )
        folder = data_dir(self.data_dir)
        result = of_robots(
            self.robot,
            lambda name: self._robot(folder, tokenizer, name),
            ("labels", "all", "codebook_use"),
        )
        write_json(self.json, result)
        for name, figures in robot_names(result):
            _print(name, figures)
        return 0

    def _robot(self, folder: Path, tokenizer: Tokenizer, name: str) -> dict[str, Any]:
        if name not in tokenizer.config.robots:
            raise InputError(
                f"The tokenizer's weights are not for the robot {name!r}; they are "
                f"for {', '.join(tokenizer.config.robots)}."
            )
        recorded = retarget_recordings(
            folder, get_robot(name), self.labels, self.workers
        )
        print_failed(recorded.failed.items())
        path = self.tokenizer or pretrained_path("tokenizer")
        seen = trained_on({"tokenizer": path}, recorded, name)
        figures, counts = evaluate_tokenizer(tokenizer, recorded, self.books)
        if self.figures is not None:
            title = f"{name}: {figures['codebook_use']:.0%} of the codes are used"
            path = self.figures / f"{name}-codes.png"
            write_figure(code_use_figure(counts, title), path)
        return {**figures, "validation_trained_on": seen}


def _print(name: str, result: dict[str, Any]) -> None:
    if result["labels"] is None:
        print_failed([(name, result["reason"])])
        return
    held_out, train = (
        {**part["labels"], "all": part["all"]} for part in (result, result["train"])
    )
    print_table(
        f"{name}: {result['codebook_use']:.0%} of the codes are used",
        [
            "recordings",
            "held out: joint RMSE rad",
            "toe error mm",
            "train: joint RMSE rad",
            "toe error mm",
        ],
        [[label, *_cells(held_out[label]), *_cells(train[label])] for label in train],
    )


def _cells(figures: dict[str, float | None]) -> list[str]:
    joints, toes = figures["joint_rmse_rad"], figures["toe_error_rmse_m"]
    if joints is None or toes is None:
        return ["-", "-"]
    return [f"{joints:.4f}", f"{1000 * toes:.1f}"]
