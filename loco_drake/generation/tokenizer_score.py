"""Reconstruction errors and codebook usage of a tokenizer."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from loco_drake.common.determinism import single_thread
from loco_drake.generation import features as ft
from loco_drake.generation.clips import Clip
from loco_drake.generation.tokenizer import Tokenizer
from loco_drake.models.robots import get_robot
from loco_drake.motion.motion import FPS


class Toes:
    """Differentiable kinematics of several robots, named in order, in one batch."""

    def __init__(
        self, names: Sequence[str], device: torch.device | str = "cpu"
    ) -> None:
        robots = [get_robot(name) for name in names]

        def table(name: str) -> Tensor:
            values = np.array([getattr(robot, name) for robot in robots])
            return torch.tensor(values, dtype=torch.float32, device=device)

        self.hips = table("p_BHip")
        self.offset = table("abduction_offset")
        self.thigh = table("thigh_length")
        self.calf = table("calf_length")
        self.stand_height = table("stand_height")

    def positions(self, features: Tensor, robot: Tensor) -> Tensor:
        """Returns the centres of the toe spheres in m, shape (B, T, 4, 3).

        They are relative to the point on the ground under the trunk, in the heading
        frame H. Features (B, T, SIZE) are of the robots with the indices (B,).
        """
        joints = features[..., ft.JOINTS]  # then leg by leg, (B, T, 4, 3)
        hip, thigh, calf = joints.reshape(*joints.shape[:-1], 4, 3).unbind(-1)
        l1, l2 = self.thigh[robot, None, None], self.calf[robot, None, None]
        side = self.offset[robot][:, None]  # (B, 1, 4)
        forward = -l1 * thigh.sin() - l2 * (thigh + calf).sin()
        down = -l1 * thigh.cos() - l2 * (thigh + calf).cos()
        left = hip.cos() * side - hip.sin() * down
        up = hip.sin() * side + hip.cos() * down
        p_B = torch.stack((forward, left, up), dim=-1) + self.hips[robot][:, None]
        x, y, z = p_B.unbind(-1)
        roll, pitch = features[..., None, ft.ROLL_PITCH].unbind(-1)  # (B, T, 1)
        y, z = roll.cos() * y - roll.sin() * z, roll.sin() * y + roll.cos() * z
        x, z = pitch.cos() * x + pitch.sin() * z, pitch.cos() * z - pitch.sin() * x
        height = features[..., ft.HEIGHT] * self.stand_height[robot, None, None]
        return torch.stack((x, y, z + height), dim=-1)

    def velocities(self, features: Tensor, p_HF: Tensor, robot: Tensor) -> Tensor:
        """Returns velocities of the toes over the ground in m/s, (B, T - 1, 4, 3).

        See :func:`over_ground`; the velocity of a stance foot is zero.
        """
        return over_ground(features, p_HF, self.stand_height[robot])


def over_ground(features: Tensor, p_H: Tensor, stand_height: Tensor) -> Tensor:
    """Returns velocities of N points over the ground in m/s, (B, T - 1, N, 3).

    Uses backward differences in the heading frame of the points (B, T, N, 3), which are
    relative to the point on the ground under the trunk. ``stand_height`` has the shape
    (B,).
    """
    speed = features[:, 1:, ft.VELOCITY] * stand_height[:, None, None]
    rate = features[:, 1:, ft.YAW_RATE]  # (B, T - 1, 1)
    middle = (p_H[:, 1:] + p_H[:, :-1]) / 2
    x, y, _ = middle.unbind(-1)  # (B, T - 1, N)
    turning = torch.stack((-rate * y, rate * x, torch.zeros_like(x)), dim=-1)
    moving = torch.cat((speed, torch.zeros_like(speed[..., :1])), dim=-1)
    return (p_H[:, 1:] - p_H[:, :-1]) * FPS + turning + moving[:, :, None]


@dataclass(frozen=True)
class TokenizerScore:
    """Reconstruction errors of a tokenizer."""

    joint_rmse_rad: float  # over frames and joints
    # Distance of the toe spheres' centres, see Toes.positions, over frames and toes.
    toe_error_rmse_m: float


def score_tokenizer(
    tokenizer: Tokenizer, clips: Sequence[Clip], codebooks: int | None = None
) -> TokenizerScore:
    """Returns the reconstruction errors over the whole tokens of clips.

    Decodes all codebooks, or only so many of the coarsest.
    """
    toes = Toes(tokenizer.config.robots)
    joints, distances = [], []
    for clip in clips:
        target = clip_tensor(tokenizer, clip)
        robot = torch.tensor([tokenizer.config.robots.index(clip.robot)])
        codes = encode_clip(tokenizer, clip)[None, :, :codebooks]
        with torch.inference_mode(), single_thread():
            output = tokenizer.decode(codes, robot)
            apart = toes.positions(output, robot) - toes.positions(target, robot)
        joints.append((output - target)[..., ft.JOINTS].square().flatten())
        distances.append(apart.square().sum(dim=-1).flatten())
    return TokenizerScore(
        joint_rmse_rad=float(torch.cat(joints).mean().sqrt()),
        toe_error_rmse_m=float(torch.cat(distances).mean().sqrt()),
    )


def code_counts(tokenizer: Tokenizer, clips: Iterable[Clip]) -> Tensor:
    """Returns how often each code is used, shape (codebooks, codebook_size)."""
    config = tokenizer.config
    counts = torch.zeros(config.codebooks, config.codebook_size, dtype=torch.long)
    for clip in clips:
        for codebook, used in enumerate(encode_clip(tokenizer, clip).T):
            counts[codebook] += torch.bincount(used, minlength=config.codebook_size)
    return counts


def codebook_use(tokenizer: Tokenizer, clips: Iterable[Clip]) -> float:
    """Returns the share of all codebooks' codes that the clips need, in [0, 1]."""
    return float((code_counts(tokenizer, clips) > 0).float().mean())


def encode_clip(tokenizer: Tokenizer, clip: Clip) -> Tensor:
    """Returns the codes of a clip's whole tokens, shape (n, codebooks)."""
    robot = torch.tensor([tokenizer.config.robots.index(clip.robot)])
    with torch.inference_mode(), single_thread():
        return tokenizer.encode(clip_tensor(tokenizer, clip), robot)[0]


def clip_tensor(tokenizer: Tokenizer, clip: Clip) -> Tensor:
    """Returns the features of a clip's whole tokens, shape (1, T, SIZE)."""
    end = len(clip) - len(clip) % tokenizer.config.frames_per_token
    return torch.tensor(clip.features[None, :end], dtype=torch.float32)
