"""The command ``train tokenizer``."""

from dataclasses import asdict, dataclass
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, ClassVar

from loco_drake.cli.options import MotionFolders, OutFolder, option
from loco_drake.cli.training import SCORED, Learned, NetworkTraining, Scores
from loco_drake.common.errors import InputError


@dataclass(kw_only=True)
class TrainTokenizer(NetworkTraining):
    """Train the VQ-VAE that encodes motion as tokens and decodes it.

    With --add-to, teaches a tokenizer robots that it does not know yet: its codes, and
    the robots that it knows, stay as they are, and so does its generator. With
    --fine-tune, its decoder learns on; its codes and its generator stay.

    Ctrl-C saves a checkpoint and stops; --resume continues.
    """

    NAME: ClassVar[str] = "tokenizer"
    # Folder of Motion files: written by `retarget`, one for each robot; motions of the
    # validation set are held out for testing.
    motions: MotionFolders = (Path("motions/go2"),)
    # Tokenizer to add to: it learns the robots of the motions that it does not know,
    # and nothing else; shipped, or a file of weights.
    add_to: Annotated[Path | None, option(metavar="NAME|FILE")] = None
    # Tokenizer whose decoder to fine-tune: its codes are held; shipped, or a file of
    # weights.
    fine_tune: Annotated[Path | None, option(metavar="NAME|FILE")] = None
    # Number of codebooks, the coarsest first: as many as the generator writes. Half
    # of the batches of --fine-tune are decoded from those alone.
    books: Annotated[int | None, option(default="all")] = None
    # Folder to write to: tokenizer.safetensors, the checkpoint and logs.
    out: OutFolder = Path("runs/tokenizer")
    # Number of training steps: the optimizer's, including those before --resume.
    steps: int = 9000
    # Learning rate: its peak.
    learning_rate: float = 2e-3

    def learn(self) -> Learned:
        """Trains a tokenizer for the robots of the motions."""
        from loco_drake.generation.clips import evenly
        from loco_drake.generation.tokenizer import TokenizerConfig
        from loco_drake.generation.tokenizer_score import codebook_use, score_tokenizer
        from loco_drake.generation.train_bodies import train_bodies
        from loco_drake.generation.train_decoder import train_decoder
        from loco_drake.generation.train_tokenizer import train_tokenizer
        from loco_drake.generation.training_motions import load_library

        if self.add_to is not None and self.fine_tune is not None:
            raise InputError("Give either --add-to or --fine-tune.")
        if self.books is not None and self.fine_tune is None:
            raise InputError("--books is for --fine-tune alone.")
        library = load_library(*self.motions, scratch=self.scratch)
        if self.add_to is not None:
            tokenizer, result = train_bodies(library, _named(self.add_to), self)
        elif self.fine_tune is not None:
            tokenizer, result = train_decoder(
                library, _named(self.fine_tune), self, self.books
            )
        else:
            config = TokenizerConfig(robots=library.robots)
            tokenizer, result = train_tokenizer(library, config, self)

        def score() -> Scores:
            sides = {
                "train": evenly(library.train, SCORED),
                "held_out": evenly(library.held_out, SCORED),
            }
            used = codebook_use(tokenizer, chain(*sides.values()))
            figures: dict[str, Any] = {"codebook_use": used}
            rows = []
            for name, clips in sides.items():
                if clips:
                    found = score_tokenizer(tokenizer, clips)
                    figures[name] = asdict(found)
                    toes = f"{found.toe_error_rmse_m * 1000:.1f}"
                    joints = f"{found.joint_rmse_rad:.4f}"
                    rows.append((name.replace("_", " "), joints, toes))
            columns = ("clips", "joint RMSE rad", "toe error mm")
            return Scores(figures, columns, rows, f": {used:.0%} of the codes are used")

        return result, score


def _named(base: Path) -> Path:
    """Returns the file of a tokenizer: ``shipped``, or a file of weights."""
    from loco_drake.models.shipped import pretrained_path

    return pretrained_path("tokenizer") if str(base) == "shipped" else base
