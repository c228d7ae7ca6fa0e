"""The command ``train generator``."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from loco_drake.cli.output import print_table, write_json
from loco_drake.cli.training import print_stopped
from loco_drake.common.errors import InputError, check_at_least
from loco_drake.generation.loop_settings import LoopSettings


@dataclass(kw_only=True)
class TrainGenerator(LoopSettings):
    """Train the GPT that generates tokens for a gait and a duration.

    Ctrl-C saves a checkpoint and stops; --resume continues.
    """

    NAME: ClassVar[str] = "generator"
    # Folders of the Motion files that the tokenizer was trained on.
    motions: tuple[Path, ...] = (Path("motions/go2"),)
    # Weights from `train tokenizer`.
    tokenizer: Path = Path("runs/tokenizer/tokenizer.safetensors")
    # Folder for generator.safetensors, the checkpoint and logs.
    out: Path = Path("runs/generator")
    # Number of codebooks to generate, the coarsest first. Finer codebooks encode detail
    # that is too irregular to predict.
    books: int = 8
    # Total optimizer steps.
    steps: int = 6000
    # Number of 20 s motions per gait to assemble from the training clips.
    stitched: int = 50
    # Peak learning rate.
    learning_rate: float = 1e-3
    # Weight decay of AdamW.
    weight_decay: float = 0.1
    # Write the figures to this JSON file.
    json: Path | None = None

    def run(self) -> int:
        """Trains; returns 1 if it was stopped before its last step, else 0.

        Raises:
            InputError: if an option is wrong.
        """
        check_at_least("stitched", self.stitched, 1)
        self.check()
        from loco_drake.common.run_folder import check_folder
        from loco_drake.generation.generator import GeneratorConfig
        from loco_drake.generation.tokenizer import load_tokenizer
        from loco_drake.generation.train_generator import (
            score_generator,
            train_generator,
        )
        from loco_drake.generation.training_motions import load_library

        check_folder(self.out, f"{self.NAME}.safetensors", self.resume)
        library = load_library(*self.motions)
        tokenizer = load_tokenizer(self.tokenizer)
        most = tokenizer.config.codebooks
        if not 1 <= self.books <= most:
            raise InputError(
                f"--books must be from 1 to {most}, as many as the tokenizer has, not "
                f"{self.books}."
            )
        config = GeneratorConfig(
            tokenizer=tokenizer.fingerprint,
            codebooks=self.books,
            codebook_size=tokenizer.config.codebook_size,
            frames_per_token=tokenizer.config.frames_per_token,
            labels=tuple(str(label) for label in library.labels),
        )
        start = time.perf_counter()
        generator, result = train_generator(
            library, tokenizer, config, self, self.stitched
        )
        if result.stopped:
            return print_stopped(result.steps, self.steps)
        figures = {"steps": result.steps, "wall_clock_s": time.perf_counter() - start}
        for name, clips in (("train", library.train), ("held_out", library.held_out)):
            if clips:
                score = score_generator(generator, tokenizer, clips)
                figures[f"{name}_nats_per_code"] = score
        write_json(self.json, figures)
        rows = [
            [key.replace("_", " "), f"{value:.4g}"] for key, value in figures.items()
        ]
        print_table(f"{self.out / 'generator.safetensors'}", ["figure", "value"], rows)
        return 0
