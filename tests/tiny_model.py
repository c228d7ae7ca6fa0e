"""A motion model that is made in a moment."""

from dataclasses import replace

import torch

from loco_drake.generation.features import JOINTS, SIZE
from loco_drake.generation.generator import Generator, GeneratorConfig
from loco_drake.generation.motion_model import MotionModel
from loco_drake.generation.tokenizer import Tokenizer, TokenizerConfig
from loco_drake.generation.train_tokenizer import LearningTokenizer
from loco_drake.models.robots import get_robot


def make_tiny_model(
    robots: tuple[str, ...] = ("go2",), *, told: bool = False
) -> MotionModel:
    """Returns untrained networks that write wild but bounded motion of the first.

    With ``told``, the same ones that what they are told makes write something else.
    """
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(3)
        config = TokenizerConfig(
            robots=robots,
            width=16,
            depth=2,
            frame_width=8,
            codebooks=2,
            codebook_size=16,
        )
        tokenizer = Tokenizer(config)
        learning = LearningTokenizer(tokenizer)
        statistics = torch.randn(1000, SIZE) * 0.1
        statistics[:, JOINTS] += torch.tensor(get_robot("go2").stand_joints).float()
        statistics[:, 3] += 1.0
        tokenizer.set_statistics(statistics.mean(dim=0), statistics.std(dim=0))
        for _ in range(2):
            frames = statistics[torch.randint(1000, (16, 32))]
            learning(frames, torch.zeros(16, dtype=torch.long))
        learning.finish()
        generator = Generator(
            GeneratorConfig(
                tokenizer=tokenizer.fingerprint,
                codebooks=2,
                codebook_size=16,
                frames_per_token=4,
                labels=("dog-pace", "dog-trot"),
                window=6,
                width=16,
                layers=2,
                heads=2,
            )
        )
        if told:
            generator = taught(generator)
    return MotionModel(tokenizer, generator.eval(), robots[0])


def taught(plain: Generator) -> Generator:
    """Returns a generator that velocities of up to 5 heights/s or rad/s change."""
    generator = Generator(replace(plain.config, told=True))
    generator.load_state_dict(plain.state_dict(), strict=False)
    telling = generator.telling
    assert telling is not None
    telling.low.fill_(-5.0)
    telling.high.fill_(5.0)
    for adapter in telling.adapters:
        torch.nn.init.normal_(adapter[-1].weight, std=2.0)
    return generator.eval()
