"""Training of the tokenizer on windows of clips.

The codebooks follow exponential moving averages of what they stand for, and codes
that nothing is near to are taken from the batch anew, both by
vector-quantize-pytorch. The finest books are left out at random, so that the decoder
makes the best of the coarse ones alone.
"""

from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from torch import Tensor, nn
from torch.nn import functional
from vector_quantize_pytorch import ResidualVQ

from loco_drake.errors import InputError
from loco_drake.generation.features import CONTACTS, VELOCITY, YAW_RATE
from loco_drake.generation.library import Library, Sampler
from loco_drake.generation.toes import Toes
from loco_drake.generation.tokenizer import Tokenizer, TokenizerConfig, save_tokenizer
from loco_drake.generation.training import LoopResult, LoopSettings, train
from loco_drake.models.robots import get_robot

Array = NDArray[np.float64]

WINDOW = 64  # frames
BATCH = 32  # windows
FEWEST_BOOKS = 2  # batches are decoded from between so many and all of the books
TEMPO = 1.15  # windows are played at most this much faster or slower

# Weights of the losses; each is scaled to be about 1 before training.
WEIGHTS = {
    "features": 1.0,  # squared error in standard deviations
    "speeds": 0.5,  # ... of its change from frame to frame
    "accelerations": 0.5,  # ... of the change of that
    "toes": 1.0,  # squared error of toe positions, in units of TOE_SCALE
    "toe_speeds": 0.5,  # ... of their velocities over the ground, TOE_SPEED_SCALE
    "contacts": 0.2,  # cross-entropy
    "commitment": 0.25,
}
TOE_SCALE = 0.05  # m
TOE_SPEED_SCALE = 0.5  # m/s


class LearningTokenizer(nn.Module):
    """A tokenizer and the quantizer that learns its codebooks.

    Args:
        tokenizer: trained in place; its own codebooks are set by :meth:`finish`.
    """

    def __init__(self, tokenizer: Tokenizer) -> None:
        super().__init__()
        self.tokenizer = tokenizer
        self.quantizer = ResidualVQ(
            dim=tokenizer.config.code_size,
            num_quantizers=tokenizer.config.books,
            codebook_size=tokenizer.config.book_size,
            kmeans_init=True,
            kmeans_iters=20,
            decay=0.98,
            threshold_ema_dead_code=1,
            quantize_dropout=True,
            quantize_dropout_cutoff_index=FEWEST_BOOKS - 1,
        )

    def forward(self, features: Tensor, robot: Tensor) -> tuple[Tensor, Tensor]:
        """Encodes, quantizes and decodes features (B, T, SIZE).

        Args:
            features: frames, whole tokens of them.
            robot: index of each window's robot, shape (B,).

        Returns:
            Reconstruction with contacts as logits, and the commitment loss.
        """
        embedded = self.tokenizer.embed(features, robot)
        quantized, _, commitment = self.quantizer(embedded)
        return self.tokenizer.decode_embedded(quantized, robot), commitment.mean()

    def finish(self) -> Tokenizer:
        """Returns the tokenizer with the codebooks as they are now."""
        self.tokenizer.codebooks.copy_(self.quantizer.codebooks)
        return self.tokenizer.eval()


def train_tokenizer(
    library: Library, config: TokenizerConfig, settings: LoopSettings
) -> tuple[Tokenizer, LoopResult]:
    """Trains a tokenizer and writes ``tokenizer.safetensors`` if it was not stopped.

    Raises:
        InputError: if no clip is as long as a window, or a robot of the library is
            not in the config.
    """
    clips = [clip for clip in library.train if len(clip) >= WINDOW]
    if not clips:
        raise InputError(f"No motion to train on is at least {WINDOW} frames long.")
    missing = sorted(set(library.robots) - set(config.robots))
    if missing:
        raise InputError(f"The tokenizer is not to know {', '.join(missing)}.")
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(settings.seed)
        learning = LearningTokenizer(Tokenizer(config))
    frames = np.concatenate([clip.features for clip in clips])
    learning.tokenizer.set_statistics(torch.tensor(frames, dtype=torch.float32))
    toes = Toes([get_robot(name) for name in config.robots])
    sampler = Sampler(clips)
    curves = {clip: CubicSpline(np.arange(len(clip)), clip.features) for clip in clips}

    def loss_of_batch(random: np.random.Generator) -> tuple[Tensor, dict[str, float]]:
        chosen = [clips[i] for i in sampler(random, BATCH)]
        windows = [cut_window(curves[clip], random) for clip in chosen]
        target = torch.tensor(np.stack(windows), dtype=torch.float32)
        robot = torch.tensor([config.robots.index(clip.robot) for clip in chosen])
        losses = tokenizer_losses(learning, toes, target, robot)
        total = sum(
            (WEIGHTS[name] * loss for name, loss in losses.items()), torch.zeros(())
        )
        return total, {name: loss.item() for name, loss in losses.items()}

    run = {"network": asdict(config), "weights": WEIGHTS}
    result = train("tokenizer", learning, loss_of_batch, settings, run)
    tokenizer = learning.finish()
    if not result.stopped:
        info = {"labels": [str(label) for label in library.labels]}
        save_tokenizer(tokenizer, Path(settings.out) / "tokenizer.safetensors", info)
    return tokenizer, result


def cut_window(curve: CubicSpline, random: np.random.Generator) -> Array:
    """Returns WINDOW frames from anywhere in a clip, a little faster or slower.

    Feet that stand still do so at any tempo.

    Args:
        curve: the features of a clip over its frame numbers.
        random: decides where and how fast.
    """
    last = curve.x[-1]
    fastest = min(TEMPO, last / (WINDOW - 1))
    tempo = min(TEMPO ** random.uniform(-1, 1), fastest)
    start = random.uniform(0, last - tempo * (WINDOW - 1))
    window: Array = curve(start + tempo * np.arange(WINDOW))
    window[:, VELOCITY] *= tempo
    window[:, YAW_RATE] *= tempo
    window[:, CONTACTS] = window[:, CONTACTS] > 0.5
    return window


def tokenizer_losses(
    learning: LearningTokenizer, toes: Toes, target: Tensor, robot: Tensor
) -> dict[str, Tensor]:
    """Returns the losses of a batch, unweighted; see :data:`WEIGHTS`.

    Args:
        learning: in training mode its codebooks are updated.
        toes: of the tokenizer's robots.
        target: features, shape (B, T, SIZE).
        robot: index of each window's robot, shape (B,).
    """
    output, commitment = learning(target, robot)
    contacts = output[..., CONTACTS]
    error = ((output - target) / learning.tokenizer.std)[..., : CONTACTS.start]
    p_target = toes.positions(target, robot)
    p_output = toes.positions(output, robot)
    v_target = toes.velocities(target, p_target, robot)
    v_output = toes.velocities(output, p_output, robot)
    return {
        "features": error.square().mean(),
        "speeds": error.diff(dim=1).square().mean() * 10,
        "accelerations": error.diff(n=2, dim=1).square().mean() * 20,
        "toes": ((p_output - p_target) / TOE_SCALE).square().mean(),
        "toe_speeds": ((v_output - v_target) / TOE_SPEED_SCALE).square().mean(),
        "contacts": functional.binary_cross_entropy_with_logits(
            contacts, target[..., CONTACTS]
        ),
        "commitment": commitment,
    }
