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
        from loco_drake.generation.tokenizer import load_tokenizer
        from loco_drake.models.shipped import pretrained_path

        super().check()
        self._pictures: dict[str, Figure] = {}
        self._path = self.tokenizer or pretrained_path("tokenizer")
        self._tokenizer = load_tokenizer(self._path)
        books = self._tokenizer.config.codebooks
        if self.books is not None and not 1 <= self.books <= books:
            raise InputError(
                f"--books must be from 1 to {books}, as many as the tokenizer has, "
                f"not {self.books}."
            )

    def of_robot(self, name: str) -> dict[str, Any]:
        """Returns the figures of one robot."""
        from loco_drake.evaluation.generation_pictures import code_use_figure
        from loco_drake.evaluation.tokenizer import evaluate_tokenizer
        from loco_drake.generation.training_motions import read_training_record
        from loco_drake.models.robots import get_robot

        robots = self._tokenizer.config.robots
        if name not in robots:
            raise InputError(
                f"The tokenizer's weights are not for the robot {name!r}; they are "
                f"for {', '.join(robots)}."
            )
        record = read_training_record(self._path, "tokenizer") or {}
        grounded = bool(record.get("grounded", False))
        recorded = self.retarget(get_robot(name), grounded)
        seen = trained_on({"tokenizer": self._path}, recorded, name)
        figures, counts = evaluate_tokenizer(self._tokenizer, recorded, self.books)
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
        return 0
