"""Reconstruction errors and codebook usage of a tokenizer."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from loco_drake.common.determinism import single_thread
from loco_drake.generation.features import JOINTS
from loco_drake.generation.toes import Toes
from loco_drake.generation.tokenizer import Tokenizer
from loco_drake.generation.training_motions import Clip
from loco_drake.models.robots import get_robot


@dataclass(frozen=True)
class TokenizerScore:
    """Reconstruction errors of a tokenizer.

    Attributes:
        joint_rmse_rad: over frames and joints.
        toe_error_rmse_m: Euclidean distance of the toe spheres' centres, relative to
            the ground under the trunk, over frames and toes.
    """

    joint_rmse_rad: float
    toe_error_rmse_m: float


def score_tokenizer(
    tokenizer: Tokenizer, clips: Sequence[Clip], codebooks: int | None = None
) -> TokenizerScore:
    """Returns the reconstruction errors over whole clips.

    Args:
        tokenizer: knows the clips' robots.
        clips: frames beyond the last whole token are left out.
        codebooks: decodes these many codebooks only, the coarsest; None: all.
    """
    toes = Toes([get_robot(name) for name in tokenizer.config.robots])
    joints, distances = [], []
    for clip in clips:
        target = clip_tensor(tokenizer, clip)
        robot = torch.tensor([tokenizer.config.robots.index(clip.robot)])
        with torch.inference_mode(), single_thread():
            codes = tokenizer.encode(target, robot)[..., :codebooks]
            output = tokenizer.decode(codes, robot)
            apart = toes.positions(output, robot) - toes.positions(target, robot)
        joints.append((output - target)[..., JOINTS].square().flatten())
        distances.append(apart.square().sum(dim=-1).flatten())
    return TokenizerScore(
        joint_rmse_rad=float(torch.cat(joints).mean().sqrt()),
        toe_error_rmse_m=float(torch.cat(distances).mean().sqrt()),
    )


def code_counts(tokenizer: Tokenizer, clips: Sequence[Clip]) -> Tensor:
    """Returns how often each code is used, shape (codebooks, codebook_size)."""
    config = tokenizer.config
    counts = torch.zeros(config.codebooks, config.codebook_size, dtype=torch.long)
    for clip in clips:
        robot = torch.tensor([config.robots.index(clip.robot)])
        with torch.inference_mode(), single_thread():
            codes = tokenizer.encode(clip_tensor(tokenizer, clip), robot)[0]
        for codebook, used in enumerate(codes.T):
            counts[codebook] += torch.bincount(used, minlength=config.codebook_size)
    return counts


def codebook_use(tokenizer: Tokenizer, clips: Sequence[Clip]) -> float:
    """Returns the share of all codebooks' codes that the clips need, in [0, 1]."""
    return float((code_counts(tokenizer, clips) > 0).float().mean())


def clip_tensor(tokenizer: Tokenizer, clip: Clip, start: int = 0) -> Tensor:
    """Returns a clip's features from ``start`` on, in whole tokens, (1, T, SIZE)."""
    tokens = (len(clip) - start) // tokenizer.config.frames_per_token
    end = start + tokens * tokenizer.config.frames_per_token
    return torch.tensor(clip.features[None, start:end], dtype=torch.float32)
