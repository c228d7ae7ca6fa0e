"""How well recordings survive the way to tokens and back: ``evaluate tokenizer``.

The figures of a label are those of :mod:`loco_drake.generation.tokenizer_score`, over
all frames of its recordings. Those of all labels are roots of the mean of the labels'
squares: every label weighs the same. The codebook's use is the share of all codes that
occur in the recordings of both sides of the split and their mirror images.
"""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from loco_drake.evaluation.recorded import Recorded
from loco_drake.generation.tokenizer import Tokenizer
from loco_drake.generation.tokenizer_score import code_counts, score_tokenizer
from loco_drake.generation.training_motions import Clip, motion_clip
from loco_drake.motion.gaits import LABELS

FIGURES = ("joint_rmse_rad", "toe_error_rmse_m")
NO_RECORDINGS = "No recording of this label is held out."


def evaluate_tokenizer(
    tokenizer: Tokenizer, recorded: Recorded, codebooks: int | None = None
) -> tuple[dict[str, Any], NDArray[np.int64]]:
    """Returns the figures, and how often each code of each codebook is used.

    Args:
        tokenizer: knows the recordings' robot.
        recorded: whole stretches.
        codebooks: decodes from the coarsest so many; None: all.

    Returns:
        "labels" and "all" of recordings held out, the same under "train",
        "codebook_use" and "books", the share that is used of each; the counts have
        shape (codebooks, codebook_size).
    """
    train, held_out = (
        [motion_clip(motion) for motion in side]
        for side in (recorded.train, recorded.validation)
    )
    mirrors = [
        motion_clip(motion.mirrored())
        for motion in (*recorded.train, *recorded.validation)
    ]
    counts = code_counts(tokenizer, [*train, *held_out, *mirrors]).numpy()
    used = (counts > 0).mean(axis=1)
    figures = {
        **_scores(tokenizer, held_out, codebooks),
        "codebook_use": float(used.mean()),
        "books": used.tolist(),
        "train": _scores(tokenizer, train, codebooks),
    }
    for label in figures["train"]["labels"]:
        missing = {**dict.fromkeys(FIGURES), "reason": NO_RECORDINGS}
        figures["labels"].setdefault(label, missing)
    return figures, counts


def _scores(
    tokenizer: Tokenizer, clips: Sequence[Clip], codebooks: int | None
) -> dict[str, Any]:
    labels = {
        str(label): asdict(score_tokenizer(tokenizer, own, codebooks))
        for label in LABELS
        if (own := [clip for clip in clips if clip.label == label])
    }
    means: dict[str, Any] = {
        name: float(np.sqrt(np.mean([score[name] ** 2 for score in labels.values()])))
        if labels
        else None
        for name in FIGURES
    }
    if not labels:
        means["reason"] = "No recording is held out."
    return {"labels": labels, "all": means}
