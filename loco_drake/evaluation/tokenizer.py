"""Reconstruction by the tokenizer: the figures of ``evaluate tokenizer``.

The figures of a label are those of :mod:`loco_drake.generation.tokenizer_score` over
all frames of its recordings. Over all labels they are the root of the mean square over
labels. Codebook usage is the share of all codes that occur in the recordings of both
sets and their mirror images.

``transfer_joint_rmse_rad`` measures whether tokens mean the same for two robots: the
Go2's motion of a recording is encoded as the Go2's, decoded for the other robot, and
compared with that robot's own retargeted motion, RMS over all frames and joints.
"""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import torch

from loco_drake.common.arrays import Integers
from loco_drake.common.determinism import single_thread
from loco_drake.evaluation.recorded import Recorded
from loco_drake.evaluation.samples import subject_of
from loco_drake.generation.clips import Clip
from loco_drake.generation.features import JOINTS, motion_features
from loco_drake.generation.tokenizer import Tokenizer
from loco_drake.generation.tokenizer_score import code_counts, score_tokenizer
from loco_drake.generation.training_motions import motion_clip
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import LABELS
from loco_drake.motion.motion import Motion

FIGURES = ("joint_rmse_rad", "toe_error_rmse_m")
KNOWN = "go2"  # whose tokens are decoded for robots that were added
NO_RECORDINGS = "No recording of this label is held out."


def evaluate_tokenizer(
    tokenizer: Tokenizer, recorded: Recorded, codebooks: int | None = None
) -> tuple[dict[str, Any], Integers]:
    """Returns the figures, and how often each code of each codebook is used.

    The figures are "labels" and "all" of recordings held out, the same under "train",
    "codebook_use" and "books", the share that is used of each. The counts have the
    shape (codebooks, codebook_size). ``codebooks`` is the number to decode from, the
    coarsest first; None: all.
    """
    sides = recorded.train, recorded.validation
    train, held_out = ([motion_clip(motion) for motion in side] for side in sides)
    mirrors = [motion_clip(motion.mirrored()) for side in sides for motion in side]
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


def transfer_rmse(
    tokenizer: Tokenizer, pairs: Sequence[tuple[Motion, Motion]]
) -> float:
    """Returns the RMS joint error of transferred motion over all pairs, rad.

    A pair is the motion to encode and what it is to become on the other robot, both of
    the same stretch of a recording. Frames beyond the last whole token are left out.
    """
    squares = []
    for given, wanted in pairs:
        features = motion_features(get_robot(given.robot), given)
        size = tokenizer.config.frames_per_token
        frames = min(len(given), len(wanted)) // size * size
        source, target = (
            torch.tensor([tokenizer.config.robots.index(motion.robot)])
            for motion in (given, wanted)
        )
        with torch.inference_mode(), single_thread():
            batch = torch.tensor(features[None, :frames], dtype=torch.float32)
            decoded = tokenizer.decode(tokenizer.encode(batch, source), target)
        angles = decoded[0, :, JOINTS].numpy()
        joints = get_robot(wanted.robot).joints_of_backward(angles)
        squares.append((joints - wanted.joint_positions[:frames]).ravel() ** 2)
    return float(np.sqrt(np.concatenate(squares).mean()))


def pair_up(
    given: Sequence[Motion], wanted: Sequence[Motion]
) -> list[tuple[Motion, Motion]]:
    """Returns pairs of motions of two robots from the same stretches."""

    def stretch(motion: Motion) -> tuple[str, str | None, str | None]:
        file, frames = (motion.provenance.get(key) for key in ("file", "frames"))
        return str(motion.label), file, frames

    partners = {stretch(motion): motion for motion in wanted if subject_of(motion)}
    return [
        (motion, partners[stretch(motion)])
        for motion in given
        if stretch(motion) in partners
    ]
