"""Teaching a tokenizer robots that it does not know, and nothing else.

Encoder and decoder are told the robot by a row that is added to their hidden layer. A
further robot learns a row, and layers of its own where features come in and go out; all
else is held. What a code means, and how robots are decoded that the tokenizer knows,
remains the same to the last bit.
"""

from collections.abc import Iterable
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from loco_drake.common.device import find_device
from loco_drake.common.errors import InputError
from loco_drake.generation.loop_settings import LoopSettings
from loco_drake.generation.tokenizer import (
    BODY_ROWS,
    BodyLayers,
    Tokenizer,
    load_tokenizer,
)
from loco_drake.generation.tokenizer_score import Toes
from loco_drake.generation.train_tokenizer import (
    BATCH,
    WEIGHTS,
    Scales,
    save_trained,
    tokenizer_losses,
    weighed,
)
from loco_drake.generation.training import LoopResult, train
from loco_drake.generation.training_motions import Library
from loco_drake.generation.windows import PairedWindows, long_enough

# What a robot's own motion is like counts most. Momentum is not asked for: what the
# codes lack of it, a body cannot give, and would leave its own motion for.
_WEIGHTS = {name: WEIGHTS[name] for name in WEIGHTS if name != "momentum"}
_WEIGHTS["features"] = 4.0


class _Rows(nn.Module):
    """An embedding of which only the last rows are learned."""

    known: Tensor

    def __init__(self, known: Tensor, count: int) -> None:
        super().__init__()
        self.register_buffer("known", known, persistent=False)
        # Between those of the robots that are known, as another body is.
        self.new = nn.Parameter(known.mean(dim=0).repeat(count, 1))

    @property
    def weight(self) -> Tensor:
        return torch.cat((self.known, self.new))

    def forward(self, robot: Tensor) -> Tensor:
        return functional.embedding(robot, self.weight)


def train_bodies(
    library: Library, path: Path, settings: LoopSettings
) -> tuple[Tokenizer, LoopResult]:
    """Teaches the tokenizer at ``path`` what robots of the library it does not know.

    Where there is motion of a robot that it knows, too, of the same stretches, its
    tokens are decoded for the new robots, and the other way round. Writes
    ``tokenizer.safetensors`` if it was not stopped.

    Raises:
        InputError: if no clip is as long as a window, all robots are known, or the
            tokenizer cannot be read.
    """
    base = load_tokenizer(path)
    clips = long_enough(library.train)
    known = base.config.robots
    names = tuple(name for name in library.robots if name not in known)
    if not names:
        raise InputError(
            f"The tokenizer knows {', '.join(known)} already: there is none of another "
            "robot among the motions."
        )
    rows = {
        name.removesuffix(".weight"): _Rows(base.state_dict()[name], len(names))
        for name in BODY_ROWS
    }
    grown = _grown(base, names)
    own = grown.bodies[-len(names) :].requires_grad_(True)
    learning = nn.ModuleDict({**rows, "bodies": own})
    for name, row in rows.items():
        setattr(grown, name, row)
    device = find_device(settings.device)
    grown.to(device)
    robots = grown.config.robots
    toes = Toes(robots, device)
    windows, scales = PairedWindows(clips, robots), Scales(clips, device)

    def loss_of_batch(random: np.random.Generator) -> tuple[Tensor, dict[str, float]]:
        target, robot, label = (x.to(device) for x in windows(random, BATCH))
        losses = tokenizer_losses(
            _Held(grown), toes, None, scales(label), target, robot
        )
        return weighed(losses, _WEIGHTS)

    run = {
        "network": asdict(grown.config),
        "weights": _WEIGHTS,
        "motions": library.summary,
        "base": base.fingerprint,
    }
    result = train("tokenizer", learning, loss_of_batch, settings, run)
    grown.cpu()
    tokenizer = _finished(grown, rows.values())
    if not result.stopped:
        save_trained(tokenizer, library, settings, path)
    return tokenizer, result


class _Held:
    """A tokenizer as :class:`.train_tokenizer.LearningTokenizer`, its codes held."""

    def __init__(self, tokenizer: Tokenizer) -> None:
        self._tokenizer = tokenizer

    def __call__(
        self, features: Tensor, robot: Tensor, decoded_for: Tensor
    ) -> tuple[Tensor, Tensor]:
        embedded = self._tokenizer.embed(features, robot)
        with torch.no_grad():
            codes = self._tokenizer.encode(features, robot)
            quantized = self._tokenizer.lookup(codes)
        commitment = (embedded - quantized).square().mean()
        # Decoded are the codes; their gradient is the embedding's.
        through = embedded + (quantized - embedded).detach()
        repeated = through.repeat(len(decoded_for) // len(robot), 1, 1)
        return self._tokenizer.decode_embedded(repeated, decoded_for), commitment


def _grown(base: Tokenizer, names: tuple[str, ...]) -> Tokenizer:
    """Returns ``base`` with further robots, which have the layers of all as their own.

    Their rows are those of the first robot.
    """
    config = replace(
        base.config,
        robots=(*base.config.robots, *names),
        added=(*base.config.added, *names),
        bodies=(*base.config.bodies, *names),
    )
    tokenizer, state = Tokenizer(config), base.state_dict()
    for name in BODY_ROWS:
        state[name] = torch.cat((state[name], state[name][:1].repeat(len(names), 1)))
    for index in range(len(base.config.bodies), len(config.bodies)):
        for name in BodyLayers(config).state_dict():
            state[f"bodies.{index}.{name}"] = state[name]
    tokenizer.load_state_dict(state)
    return tokenizer.eval().requires_grad_(False)


def _finished(grown: Tokenizer, rows: Iterable[_Rows]) -> Tokenizer:
    """Returns a tokenizer that has learned ``rows``, ready for inference."""
    tokenizer, state = Tokenizer(grown.config), grown.state_dict()
    for name, row in zip(BODY_ROWS, rows, strict=True):
        del state[name.replace("weight", "new")]
        state[name] = row.weight.detach()
    tokenizer.load_state_dict(state)
    return tokenizer.eval().requires_grad_(False)
