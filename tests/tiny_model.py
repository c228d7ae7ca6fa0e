"""A motion model that is made in a moment."""

import torch

from loco_drake.generation.features import JOINTS, SIZE
from loco_drake.generation.generator import Generator, GeneratorConfig
from loco_drake.generation.motion_model import MotionModel
from loco_drake.generation.tokenizer import Tokenizer, TokenizerConfig
from loco_drake.generation.train_tokenizer import LearningTokenizer
from loco_drake.models.robots import get_robot


def make_tiny_model(robots: tuple[str, ...] = ("go2",)) -> MotionModel:
    """Returns untrained networks that write wild but bounded motion of the first."""
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
        tokenizer.set_statistics(statistics)
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
    return MotionModel(tokenizer, generator.eval(), robots[0])
