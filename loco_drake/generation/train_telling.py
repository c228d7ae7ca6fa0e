"""Training of a generator to be told velocities, see :mod:`.telling`."""

from dataclasses import asdict, replace
from hashlib import sha256
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from loco_drake.common.device import find_device
from loco_drake.common.errors import InputError
from loco_drake.common.weights import load_weights, save_network
from loco_drake.generation.generator import Generator, load_generator
from loco_drake.generation.loop_settings import LoopSettings
from loco_drake.generation.telling import told_bounds
from loco_drake.generation.tokenizer import Tokenizer
from loco_drake.generation.train_generator import (
    BATCH,
    STITCHED,
    check_known,
    encode_clips,
    generator_loss,
    make_batch,
    on_device,
    stitched_clips,
)
from loco_drake.generation.training import LoopResult, train
from loco_drake.generation.training_motions import Library, training_record

LATER = 0.5  # share of windows in which the first tokens are told nothing
HELD = 0.5  # share of windows that are told their mean velocity, as a command is
SHORTEST = 8  # tokens that are told in a window, at least


def train_telling(
    library: Library,
    tokenizer: Tokenizer,
    path: Path,
    settings: LoopSettings,
    stitched: int = STITCHED,
) -> tuple[Generator, LoopResult]:
    """Teaches velocities to a generator; writes it if the training was not stopped.

    What the generator writes without being told remains the same. A generator that was
    taught before is taught anew.

    Args:
        library: what to learn from.
        tokenizer: that of the generator.
        path: weights of the generator, which are not modified.
        settings: how to train; ``generator.safetensors`` is written to its folder.
        stitched: long motions to learn from, on average for each robot and label.

    Raises:
        InputError: if the weights cannot be read, the tokenizer is another, the library
            has labels or robots that the generator does not know, or all clips of a
            label are too short.
    """
    plain = load_generator(path)
    _, header = load_weights(path, "generator")
    _check(library, tokenizer, plain)
    config = replace(plain.config, told=True)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(settings.seed)
        generator = Generator(config)
    own = {
        name: value
        for name, value in plain.state_dict().items()
        if not name.startswith("telling.")
    }
    generator.load_state_dict(own, strict=False)
    generator.eval().requires_grad_(False)
    telling = generator.telling
    assert telling is not None
    telling.requires_grad_(True)
    clips = stitched_clips(library.train, stitched, settings.seed)
    encoded = encode_clips(tokenizer, clips, config.codebooks)
    bounds = told_bounds((each.label, each.velocities) for each in encoded)
    for name, found in zip(("low", "high"), bounds, strict=True):
        getattr(telling, name).copy_(torch.from_numpy(found))
    edges = generator.speed_edges.numpy()
    device = find_device(settings.device)
    generator.to(device)

    def loss_of_batch(random: np.random.Generator) -> tuple[Tensor, dict[str, float]]:
        chosen = [encoded[i] for i in random.integers(len(encoded), size=BATCH)]
        batch = make_batch(config, edges, chosen, random)
        assert batch[5] is not None
        told = as_commands(batch[5], random)
        return generator_loss(generator, on_device((*batch[:5], told), device)), {}

    run = {
        "network": asdict(config),
        "motions": library.summary,
        "stitched": stitched,
        "taught": sha256(Path(path).read_bytes()).hexdigest(),
    }
    result = train("generator", telling, loss_of_batch, settings, run)
    generator.cpu()
    if not result.stopped:
        record = {**training_record(library, settings), "stitched": stitched}
        out = Path(settings.out) / "generator.safetensors"
        info = {**(header.get("info") or {}), "telling": record}
        save_network(out, "generator", generator, info, half=True)
    return generator.requires_grad_(False), result


def as_commands(velocities: Tensor, random: np.random.Generator) -> Tensor:
    """Returns velocities (B, T, 3) as a command would tell them.

    In some windows it comes later, in some it holds.
    """
    batch, length, _ = velocities.shape
    told = velocities.clone()
    for i in range(batch):
        first = 0
        if random.random() < LATER:
            first = int(random.integers(length - SHORTEST + 1))
        if random.random() < HELD:
            told[i] = told[i, first:].mean(dim=0)
        told[i, :first] = torch.nan
    return told


def _check(library: Library, tokenizer: Tokenizer, plain: Generator) -> None:
    if plain.config.tokenizer != tokenizer.fingerprint:
        raise InputError(
            f"The generator's weights are for the tokenizer {plain.config.tokenizer}, "
            f"not for {tokenizer.fingerprint}."
        )
    check_known("tokenizer", library.robots, tokenizer.config.robots)
    labels = [str(label) for label in library.labels]
    check_known("generator", labels, plain.config.labels)
