"""The command ``evaluate tokenizer``."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from loco_drake.cli.evaluation import Evaluation, print_report, trained_on
from loco_drake.cli.options import Figures, Tokenizer, option
from loco_drake.cli.output import print_failed, write_figure
from loco_drake.common.errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(kw_only=True)
class EvaluateTokenizer(Evaluation):
    """Encode and decode held-out recordings and measure the reconstruction.

    Measures joint and toe errors and codebook usage, as defined in
    docs/generation_method.md. The result is deterministic.
    """

    KEYS = ("labels", "all", "codebook_use")

    tokenizer: Tokenizer = None
    # Number of codebooks, the coarsest first: to decode from.
    books: Annotated[int | None, option(default="all")] = None
    # Folder for pictures: of codebook usage.
    figures: Figures = None

    def check(self) -> None:
        """Raises InputError if an option is wrong."""
        super().check()
        self._pictures: dict[str, Figure] = {}

    def of_robot(self, name: str) -> dict[str, Any]:
        """Returns the figures of one robot."""
        from loco_drake.evaluation import tokenizer as scores
        from loco_drake.evaluation.generation_pictures import code_use_figure
        from loco_drake.generation.tokenizer import load_tokenizer
        from loco_drake.generation.training_motions import read_training_record
        from loco_drake.models.robots import get_robot
        from loco_drake.models.shipped import network_path

        robot = get_robot(name)
        path = self.tokenizer or network_path(robot, "tokenizer")
        tokenizer = load_tokenizer(path)
        robots = tokenizer.config.robots
        tokenizer.check_books(self.books)
        if name not in robots:
            raise InputError(
                f"The tokenizer's weights are not for the robot {name!r}; they are "
                f"for {', '.join(robots)}."
            )
        record = read_training_record(path, "tokenizer") or {}
        grounded = bool(record.get("grounded", False))
        recorded = self.retarget(robot, grounded)
        seen = trained_on({"tokenizer": path}, recorded, name)
        figures, counts = scores.evaluate_tokenizer(tokenizer, recorded, self.books)
        if name in tokenizer.config.added:
            given = self.retarget(get_robot(scores.KNOWN), grounded)
            pairs = scores.pair_up(given.validation, recorded.validation)
            apart = scores.transfer_rmse(tokenizer, pairs) if pairs else None
            figures["transfer_joint_rmse_rad"] = apart
        if self.figures is not None:
            title = f"{name}: {figures['codebook_use']:.0%} of the codes are used"
            self._pictures[name] = code_use_figure(counts, title)
        return {**figures, "validation_trained_on": seen}

    def draw(self, name: str, figures: dict[str, Any]) -> None:
        """Writes the picture of a robot, if it is wanted."""
        if self.figures is not None and name in self._pictures:
            write_figure(self._pictures[name], self.figures / f"{name}-codes.png")

    def show(self, name: str, figures: dict[str, Any]) -> int:
        """Prints a table of all labels; returns 0."""
        from loco_drake.evaluation.report.figures import Figures
        from loco_drake.evaluation.report.sections import tokenizer_table

        if figures["labels"] is None:
            print_failed([(name, figures["reason"])])
        else:
            print_report(tokenizer_table(name, Figures(figures)))
        if (apart := figures.get("transfer_joint_rmse_rad")) is not None:
            print(
                f"The Go2's tokens, decoded for {name}: {apart:.4f} rad from what is "
                "retargeted to it, held out."
            )
        return 0
