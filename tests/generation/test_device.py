"""Losses compute on the device of their network, on one without values if need be.

As on a GPU, what is left on the CPU cannot be computed with there.
"""

import numpy as np
import pytest
import torch
from torch import nn

from loco_drake.generation.clips import Clip
from loco_drake.generation.features import SIZE
from loco_drake.generation.generator import Generator, GeneratorConfig
from loco_drake.generation.point_masses import PointMasses
from loco_drake.generation.tokenizer import Tokenizer, TokenizerConfig
from loco_drake.generation.tokenizer_score import Toes
from loco_drake.generation.train_generator import generator_loss, on_device
from loco_drake.generation.train_tokenizer import (
    BATCH,
    LearningTokenizer,
    Scales,
    tokenizer_losses,
)
from loco_drake.motion.gaits import LABELS

META = torch.device("meta")
ROBOTS = ("go2", "a1")


class Unquantized(nn.Module):
    """In place of the codebooks, whose use depends on values."""

    def forward(self, x):
        return x, None, x.mean()


def test_of_the_tokenizer():
    clips = [Clip("go2", LABELS[0], "made", np.ones((90, SIZE)))]
    toes, masses = Toes(ROBOTS, META), PointMasses(ROBOTS, META)
    scales = Scales(clips, META)
    with META:
        learning = LearningTokenizer(Tokenizer(TokenizerConfig(robots=ROBOTS)))
        target = torch.zeros(2 * BATCH, 64, SIZE)
        robot = torch.zeros(2 * BATCH, dtype=torch.long)
    learning.quantizer = Unquantized()
    losses = tokenizer_losses(learning, toes, masses, scales(robot), target, robot)
    assert {loss.device for loss in losses.values()} == {META}
    sum(losses.values()).backward()
    gradients = [p.grad for p in learning.parameters()]
    assert {gradient.device for gradient in gradients} == {META}


@pytest.mark.parametrize("told", [False, True])
def test_of_the_generator(told):
    config = GeneratorConfig(
        tokenizer="0" * 16,
        codebooks=4,
        codebook_size=16,
        frames_per_token=4,
        labels=("dog-trot",),
        told=told,
    )
    with META:
        generator = Generator(config)
    shape = (2, 8, config.codebooks)
    batch = (
        torch.zeros(shape, dtype=torch.long),
        torch.zeros(2, 8, dtype=torch.long),
        torch.zeros(2, 8, dtype=torch.long),
        torch.zeros(2, dtype=torch.long),
        torch.zeros(shape, dtype=torch.long),
        torch.zeros(2, 8, 3) if told else None,
    )
    loss = generator_loss(generator, on_device(batch, META))
    assert loss.device == META
    loss.backward()
    with pytest.raises(RuntimeError):  # tensors of two devices
        generator_loss(generator, batch)
