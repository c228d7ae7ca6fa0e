"""The command ``train generator``."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from loco_drake.cli.options import MotionFolders, OutFolder, option
from loco_drake.cli.training import SCORED, Learned, NetworkTraining, Scores
from loco_drake.common.errors import check_at_least

if TYPE_CHECKING:
    from loco_drake.generation.generator import GeneratorConfig
    from loco_drake.generation.tokenizer import Tokenizer
    from loco_drake.generation.training_motions import Library


@dataclass(kw_only=True)
class TrainGenerator(NetworkTraining):
    """Train the GPT that generates tokens for a gait and a duration.

    With --teach, teaches a generator to be told the velocity of each token; without
    being told it remains the same.

    Ctrl-C saves a checkpoint and stops; --resume continues.
    """

    NAME: ClassVar[str] = "generator"
    # Folder of Motion files: those that the tokenizer was trained on.
    motions: MotionFolders = (Path("motions/go2"),)
    # Weights from `train tokenizer`.
    tokenizer: Annotated[Path, option(metavar="FILE")] = Path(
        "runs/tokenizer/tokenizer.safetensors"
    )
    # Folder to write to: generator.safetensors, the checkpoint and logs.
    out: OutFolder = Path("runs/generator")
    # Number of codebooks, the coarsest first: to generate. Finer codebooks encode
    # detail that is too irregular to predict.
    books: int = 8
    # Weights of the generator to teach velocities, instead of training one.
    tell: Annotated[Path | None, option(name="teach", metavar="FILE")] = None
    # Number of training steps: the optimizer's, including those before --resume.
    steps: int = 6000
    # Number of 20 s motions per gait to assemble from the training clips.
    stitched: int = 50
    # Learning rate: its peak.
    learning_rate: float = 1e-3
    # Weight decay of AdamW.
    weight_decay: float = 0.1

    def check(self) -> None:
        """Raises InputError unless every setting can be used."""
        check_at_least("stitched", self.stitched, 1)
        super().check()

    def learn(self) -> Learned:
        """Trains a generator for the labels of the motions, or teaches one."""
        from loco_drake.generation.clips import evenly
        from loco_drake.generation.tokenizer import load_tokenizer
        from loco_drake.generation.train_generator import (
            score_generator,
            train_generator,
        )
        from loco_drake.generation.train_telling import train_telling
        from loco_drake.generation.training_motions import load_library

        library = load_library(*self.motions, scratch=self.scratch)
        tokenizer = load_tokenizer(self.tokenizer)
        if self.tell is not None:
            generator, result = train_telling(
                library, tokenizer, self.tell, self, self.stitched
            )
        else:
            config = self._config(library, tokenizer)
            generator, result = train_generator(
                library, tokenizer, config, self, self.stitched
            )

        def score() -> Scores:
            figures = {"steps": result.steps, "wall_clock_s": result.seconds}
            for name in ("train", "held_out"):
                if clips := evenly(getattr(library, name), SCORED):
                    nats = score_generator(generator, tokenizer, clips)
                    figures[f"{name}_nats_per_code"] = nats
                    if self.tell is not None:
                        nats = score_generator(generator, tokenizer, clips, told=True)
                        figures[f"{name}_nats_per_code_told"] = nats
            rows = [(k.replace("_", " "), f"{v:.4g}") for k, v in figures.items()]
            return Scores(figures, ("figure", "value"), rows)

        return result, score

    def _config(self, library: "Library", tokenizer: "Tokenizer") -> "GeneratorConfig":
        """Returns the sizes of a generator to train."""
        from loco_drake.generation.generator import GeneratorConfig

        tokenizer.check_books(self.books)
        return GeneratorConfig(
            tokenizer=tokenizer.fingerprint,
            codebooks=self.books,
            codebook_size=tokenizer.config.codebook_size,
            frames_per_token=tokenizer.config.frames_per_token,
            labels=tuple(str(label) for label in library.labels),
            grounded=library.grounded,
        )
