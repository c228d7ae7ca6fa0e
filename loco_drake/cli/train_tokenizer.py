"""The command ``train tokenizer``."""

import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar

from loco_drake.cli.output import print_table, write_json
from loco_drake.cli.training import print_stopped
from loco_drake.generation.loop_settings import LoopSettings


@dataclass(kw_only=True)
class TrainTokenizer(LoopSettings):
    """Train the VQ-VAE that encodes motion as tokens and decodes it.

    Ctrl-C saves a checkpoint and stops; --resume continues.
    """

    NAME: ClassVar[str] = "tokenizer"
    # Folders of Motion files written by `retarget`, one for each robot; motions of the
    # validation set are held out for testing.
    motions: tuple[Path, ...] = (Path("motions/go2"),)
    # Folder for tokenizer.safetensors, the checkpoint and logs.
    out: Path = Path("runs/tokenizer")
    # Total optimizer steps.
    steps: int = 9000
    # Peak learning rate.
    learning_rate: float = 2e-3
    # Write the figures to this JSON file.
    json: Path | None = None

    def run(self) -> int:
        """Trains; returns 1 if it was stopped before its last step, else 0.

        Raises:
            InputError: if an option is wrong.
        """
        self.check()
        from loco_drake.common.run_folder import check_folder
        from loco_drake.generation.tokenizer import TokenizerConfig
        from loco_drake.generation.tokenizer_score import codebook_use, score_tokenizer
        from loco_drake.generation.train_tokenizer import train_tokenizer
        from loco_drake.generation.training_motions import load_library

        check_folder(self.out, f"{self.NAME}.safetensors", self.resume)
        library = load_library(*self.motions)
        start = time.perf_counter()
        config = TokenizerConfig(robots=library.robots)
        tokenizer, result = train_tokenizer(library, config, self)
        if result.stopped:
            return print_stopped(result.steps, self.steps)
        figures: dict[str, Any] = {
            "steps": result.steps,
            "wall_clock_s": time.perf_counter() - start,
            "codebook_use": codebook_use(tokenizer, library.train + library.held_out),
        }
        rows = []
        for name, clips in (("train", library.train), ("held_out", library.held_out)):
            if clips:
                score = score_tokenizer(tokenizer, clips)
                figures[name] = asdict(score)
                toes = f"{score.toe_error_rmse_m * 1000:.1f}"
                joints = f"{score.joint_rmse_rad:.4f}"
                rows.append([name.replace("_", " "), joints, toes])
        write_json(self.json, figures)
        print_table(
            f"{self.out / 'tokenizer.safetensors'}: {figures['codebook_use']:.0%} of "
            f"the codes are used",
            ["clips", "joint RMSE rad", "toe error mm"],
            rows,
        )
        return 0
