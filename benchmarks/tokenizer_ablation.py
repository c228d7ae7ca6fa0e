"""What each choice of the tokenizer is worth: one short training for each variant.

All variants are trained alike, on the same library with the same seed, and scored on
recordings that were held out. Each leaves a JSON file in ``--out``; what is there
already is not done again, so that the script can be stopped and run anew.
Prints the table of docs/generation.md. From the root of the repository, after
``loco-drake retarget`` for both robots:

    OMP_NUM_THREADS=1 python benchmarks/tokenizer_ablation.py
"""

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro
from scipy.stats import gmean
from torch import Tensor
from torch.nn import functional
from vector_quantize_pytorch import GroupedResidualVQ

from loco_drake.common.files import atomic_path
from loco_drake.evaluation.motion_scores import joint_jerk
from loco_drake.evaluation.recorded import Recorded, load_recorded
from loco_drake.evaluation.tokenizer import evaluate_tokenizer
from loco_drake.evaluation.transfer import pair_up, transfer_rmse
from loco_drake.generation.features import CONTACTS, JOINTS
from loco_drake.generation.layers import CausalConv, ConvBlock
from loco_drake.generation.toes import Toes
from loco_drake.generation.tokenizer import Tokenizer, TokenizerConfig
from loco_drake.generation.tokenizer_score import clip_tensor
from loco_drake.generation.train_tokenizer import (
    WEIGHTS,
    LearningTokenizer,
    residual_tokenizer,
    train_tokenizer,
)
from loco_drake.generation.training import CHECKPOINT, LoopSettings
from loco_drake.generation.training_motions import load_library, motion_clip
from loco_drake.models.robots import get_robot
from loco_drake.motion.motion import FPS, Motion


class ProductTokenizer(LearningTokenizer):
    """Books that share the channels out among themselves instead of refining others.

    A book's vectors are zero in the channels of the others, so that the sum of all
    decodes the tokens as it does those of residual books.
    """

    def __init__(self, tokenizer: Tokenizer) -> None:
        super().__init__(tokenizer)
        config = tokenizer.config
        self.quantizer = GroupedResidualVQ(
            dim=config.code_size,
            groups=config.books,
            num_quantizers=1,
            codebook_size=config.book_size,
            kmeans_init=True,
            kmeans_iters=20,
            decay=0.98,
            threshold_ema_dead_code=1,
        )

    def finish(self) -> Tokenizer:
        """Returns the tokenizer with the codebooks as they are now."""
        parts = self.quantizer.codebooks[:, 0]  # (books, book_size, own channels)
        channels = parts.shape[-1]
        self.tokenizer.codebooks.zero_()
        for book, part in enumerate(parts):
            own = slice(book * channels, (book + 1) * channels)
            self.tokenizer.codebooks[book, :, own] = part
        return self.tokenizer.eval()


class CentredConv(CausalConv):
    """The same convolution, over as many later times as earlier ones."""

    def forward(self, x: Tensor) -> Tensor:
        """Maps (B, T, inputs) to (B, T, outputs)."""
        half = self.reach // 2
        ahead = functional.pad(x, (0, 0, 0, half))
        return super().forward(ahead)[:, half:]


def product_tokenizer(config: TokenizerConfig) -> LearningTokenizer:
    """Returns networks with product books."""
    return ProductTokenizer(Tokenizer(config))


def centred_tokenizer(config: TokenizerConfig) -> LearningTokenizer:
    """Returns networks whose encoder and decoder look ahead, too."""
    tokenizer = Tokenizer(config)
    for block in tokenizer.modules():
        if isinstance(block, ConvBlock):
            old = block.conv
            taps = old.reach // old.dilation + 1
            width = old.linear.out_features
            block.conv = CentredConv(width, width, taps, old.dilation)
    return LearningTokenizer(tokenizer)


@dataclass(frozen=True)
class Variant:
    """How a row of the table differs from the first.

    Attributes:
        config: fields of TokenizerConfig.
        off: losses that are left out.
        build: makes the networks.
        seed: added to that of the command line.
    """

    config: dict[str, Any] = field(default_factory=dict)
    off: tuple[str, ...] = ()
    build: Callable[[TokenizerConfig], LearningTokenizer] = residual_tokenizer
    seed: int = 0


VARIANTS = {
    "as shipped": Variant(),
    "... another seed": Variant(seed=1),
    "4 books": Variant({"books": 4}),
    "8 books": Variant({"books": 8}),
    "product books": Variant(build=product_tokenizer),
    "64 codes": Variant({"book_size": 64}),
    "256 codes": Variant({"book_size": 256}),
    "2 frames per token": Variant({"frames_per_token": 2}),
    "8 frames per token": Variant({"frames_per_token": 8}),
    "no velocity losses": Variant(off=("changes", "jitter", "energy", "toe_speeds")),
    "no contact loss": Variant(off=("contacts",)),
    "looks ahead": Variant(build=centred_tokenizer),
    "no loss of energy": Variant(off=("energy",)),
    "no loss of toe speeds": Variant(off=("toe_speeds",)),
}
# Column: key, factor, digits.
COLUMNS = {
    "bit/s": ("bits_per_second", 1, 0),
    "joint RMSE, rad": ("joint_rmse_rad", 1, 4),
    "toe error, mm": ("toe_error_rmse_m", 1000, 1),
    "to the A1, rad": ("transfer_joint_rmse_rad", 1, 4),
    "jerk ratio": ("jerk_ratio", 1, 2),
    "slip, mm/s": ("stance_toe_speed_mps", 1000, 0),
    "contacts right": ("contacts_right", 1, 3),
    "codes used": ("codebook_use", 1, 2),
}


def bits_per_second(config: TokenizerConfig) -> float:
    """Returns how much tokens tell at most."""
    bits = config.books * np.log2(config.book_size)
    return float(bits * FPS / config.frames_per_token)


def decoded_figures(
    tokenizer: Tokenizer, motions: Sequence[Motion]
) -> dict[str, float]:
    """Returns what the decoder makes of motions of one robot, no feet put right.

    Returns:
        ``jerk_ratio``, as :mod:`loco_drake.evaluation.motion_scores` has it;
        ``stance_toe_speed_mps``, median horizontal speed of toes that stand in two
        consecutive frames of the recording; ``contacts_right``, the share of feet
        and frames whose contact is told right.
    """
    robot = torch.tensor([tokenizer.config.robots.index(motions[0].robot)])
    toes = Toes([get_robot(name) for name in tokenizer.config.robots])
    by_label: dict[str, list[tuple[Motion, Motion]]] = {}
    speeds, right = [], []
    for motion in motions:
        target = clip_tensor(tokenizer, motion_clip(motion))
        with torch.inference_mode():
            output = tokenizer.decode(tokenizer.encode(target, robot), robot)
            v = toes.velocities(output, toes.positions(output, robot), robot)
        stands = target[..., CONTACTS] > 0.5
        still = stands[:, 1:] & stands[:, :-1]
        speeds.append(v[..., :2].norm(dim=-1)[still])
        right.append(((output[..., CONTACTS] > 0.5) == stands).flatten())
        whole = motion.slice(0, target.shape[1])
        joints = output[0, :, JOINTS].double().numpy()
        pair = (replace(whole, joint_positions=joints), whole)
        by_label.setdefault(str(motion.label), []).append(pair)
    ratios = []
    for pairs in by_label.values():
        made, given = (joint_jerk(side) for side in zip(*pairs, strict=True))
        assert made is not None
        assert given is not None
        ratios.append(made / given)
    return {
        "jerk_ratio": float(gmean(ratios)),
        "stance_toe_speed_mps": float(torch.cat(speeds).median()),
        "contacts_right": float(torch.cat(right).float().mean()),
    }


def figures_of(tokenizer: Tokenizer, go2: Recorded, a1: Recorded) -> dict[str, float]:
    """Returns the row of a trained tokenizer; errors are of the Go2, labels alike."""
    scores, _ = evaluate_tokenizer(tokenizer, go2)
    pairs = pair_up(go2.validation, a1.validation)
    return {
        **scores["all"],
        "codebook_use": scores["codebook_use"],
        "transfer_joint_rmse_rad": transfer_rmse(tokenizer, pairs),
        "bits_per_second": bits_per_second(tokenizer.config),
        **decoded_figures(tokenizer, go2.validation),
    }


def main(
    motions: Path = Path("motions"),
    out: Path = Path("runs/tokenizer_ablation"),
    steps: int = 800,
    seed: int = 0,
) -> None:
    """Trains the variants that are not there yet and prints the table.

    Args:
        motions: holds the folders go2 and a1.
        out: for the JSON files.
        steps: of each training.
        seed: of each training.
    """
    folders = (motions / "go2", motions / "a1")
    library = load_library(*folders)
    (_, go2), (_, a1) = (load_recorded(folder) for folder in folders)
    print(f"| {steps} steps | {' | '.join(COLUMNS)} |")
    print("|---" + "|---:" * len(COLUMNS) + "|", flush=True)
    for name, variant in VARIANTS.items():
        file = out / f"{name.strip('. ').replace(' ', '_')}-{steps}-{seed}.json"
        if not file.exists():
            start = time.perf_counter()
            folder = out / file.stem
            settings = LoopSettings(
                folder,
                steps,
                2e-3,
                seed=seed + variant.seed,
                resume=(folder / CHECKPOINT).exists(),
                checkpoint_every=100,
            )
            tokenizer, result = train_tokenizer(
                library,
                TokenizerConfig(robots=library.robots, **variant.config),
                settings,
                weights={k: w * (k not in variant.off) for k, w in WEIGHTS.items()},
                build=variant.build,
            )
            if result.stopped:
                return
            figures = figures_of(tokenizer, go2, a1)
            figures["wall_clock_s"] = time.perf_counter() - start
            with atomic_path(file) as temporary:
                temporary.write_text(json.dumps(figures, indent=2) + "\n")
        row = json.loads(file.read_text())
        cells = [f"{row[key] * factor:.{n}f}" for key, factor, n in COLUMNS.values()]
        print(f"| {name} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    tyro.cli(main)
