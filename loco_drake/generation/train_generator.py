"""Training of the generator on the tokens of clips."""

from array import array
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from loco_drake.common.determinism import single_thread
from loco_drake.common.device import find_device
from loco_drake.common.errors import InputError
from loco_drake.common.weights import save_network
from loco_drake.generation import speed_rank, stitching
from loco_drake.generation.clips import Chosen, Clip
from loco_drake.generation.generator import (
    LONGEST,
    Generator,
    GeneratorConfig,
    duration_bin,
)
from loco_drake.generation.loop_settings import LoopSettings
from loco_drake.generation.telling import AXES, token_velocities
from loco_drake.generation.tokenizer import Tokenizer
from loco_drake.generation.tokenizer_score import encode_clip
from loco_drake.generation.training import LoopResult, train
from loco_drake.generation.training_motions import Library, training_record
from loco_drake.motion.gaits import GaitLabel
from loco_drake.motion.motion import FPS

BATCH = 24  # windows
GROWTH = 12  # tokens by which a window grows while a chunk is written
NO_HISTORY = 0.15  # share of windows that begin a sequence
# Long training motions, on average for each robot and label. Tokens depend on where a
# motion is divided into them, so repeated clips remain useful.
STITCHED = 50
STITCHED_SECONDS = 20.0  # each
CORRUPTION = 0.1  # share of input codes replaced, so that the model learns to recover


# What Generator.forward takes: before, labels, speed_bins, duration, codes, velocities.
Batch = tuple[Tensor, Tensor, Tensor, Tensor, Tensor, Tensor | None]


@dataclass(frozen=True, eq=False)
class Codes:
    """The tokens of one motion."""

    label: int  # index into gaits.LABELS
    codes: NDArray[np.int64]  # (n, codebooks)
    speeds: NDArray[np.float64]  # see speed_rank.token_speeds, (n,)
    velocities: NDArray[np.float64]  # see telling.token_velocities, (n, 3)


def encode_clips(
    tokenizer: Tokenizer, clips: Iterable[Clip], codebooks: int
) -> list[Codes]:
    """Returns the tokens of each clip, the first ``codebooks`` codes of each."""
    encoded = []
    for clip in clips:
        codes = encode_clip(tokenizer, clip)[:, :codebooks].numpy()
        speeds, velocities = (
            of(clip.features, tokenizer.config.frames_per_token)
            for of in (speed_rank.token_speeds, token_velocities)
        )
        encoded.append(Codes(clip.label.index, codes, speeds, velocities))
    return encoded


def stitched_clips(clips: Sequence[Clip], count: int, seed: int) -> Iterator[Clip]:
    """Yields long motions assembled from the clips.

    There are ``count`` on average per robot and label; their number is proportional to
    the square root of the duration of its clips, since gaits with more recordings are
    more varied.

    Raises:
        InputError: if all clips of a robot and label are too short.
    """
    random = np.random.default_rng(seed)
    groups: dict[tuple[str, GaitLabel], array[int]] = defaultdict(lambda: array("q"))
    frames: Counter[tuple[str, GaitLabel]] = Counter()
    for row, clip in enumerate(clips):
        groups[clip.robot, clip.label].append(row)
        frames[clip.robot, clip.label] += len(clip)
    roots = {key: frames[key] ** 0.5 for key in groups}
    mean = sum(roots.values()) / len(roots)
    for (robot, label), rows in sorted(groups.items()):
        number = max(1, round(count * roots[robot, label] / mean))
        pools = stitching.pools(Chosen(clips, rows), random)
        # The first ones make one motion more, if need be.
        for index, pool in enumerate(pools[:number]):
            stitcher = stitching.Stitcher(pool)
            for _ in range(index, number, len(pools)):
                features = stitcher(round(STITCHED_SECONDS * FPS), random)
                yield Clip(robot, label, "stitched", features)


def train_generator(
    library: Library,
    tokenizer: Tokenizer,
    config: GeneratorConfig,
    settings: LoopSettings,
    stitched: int = STITCHED,
) -> tuple[Generator, LoopResult]:
    """Trains a generator and writes ``generator.safetensors`` if it was not stopped.

    It learns from ``stitched`` long motions on average for each robot and label.

    Raises:
        InputError: if the tokenizer does not know a robot of the library, or all
            clips of a label are too short.
    """
    check_known("tokenizer", library.robots, tokenizer.config.robots)
    clips = stitched_clips(library.train, stitched, settings.seed)
    encoded = encode_clips(tokenizer, clips, config.codebooks)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(settings.seed)
        generator = Generator(config)
    found = speed_rank.speed_edges((each.label, each.speeds) for each in encoded)
    generator.speed_edges.copy_(torch.from_numpy(found))
    edges = generator.speed_edges.numpy()
    device = find_device(settings.device)

    def loss_of_batch(random: np.random.Generator) -> tuple[Tensor, dict[str, float]]:
        chosen = [encoded[i] for i in random.integers(len(encoded), size=BATCH)]
        batch = make_batch(config, edges, chosen, random)
        return generator_loss(generator, on_device((*batch[:5], None), device)), {}

    run = {
        "network": asdict(config),
        "motions": library.summary,
        "books": config.codebooks,
        "stitched": stitched,
    }
    result = train("generator", generator, loss_of_batch, settings, run)
    if not result.stopped:
        record = {**training_record(library, settings), "stitched": stitched}
        info = {"robots": list(library.robots), "training": record}
        path = Path(settings.out) / "generator.safetensors"
        save_network(path, "generator", generator, info, half=True)
    return generator, result


def check_known(what: str, found: Sequence[str], known: Sequence[str]) -> None:
    """Raises InputError if names are ``found`` that ``what`` was not trained on."""
    missing = sorted(set(found) - set(known))
    if missing:
        raise InputError(
            f"The {what} knows {', '.join(known)}, not {', '.join(missing)}."
        )


def make_batch(
    config: GeneratorConfig,
    edges: NDArray[np.floating],
    chosen: Sequence[Codes],
    random: np.random.Generator,
) -> Batch:
    """Cuts a window out of each sequence, at random.

    The duration that a window is told is drawn too: any stretch of a gait is also
    one of a longer performance.
    """
    length = config.window + GROWTH
    batch = len(chosen)
    windows = np.empty((batch, length + 1, config.codebooks), dtype=np.int64)
    speed_bins = np.empty((batch, length), dtype=np.int64)
    velocities = np.empty((batch, length, AXES), dtype=np.float32)
    for i, sequence in enumerate(chosen):
        # The token before the window is all that the first step is told.
        start = random.integers(len(sequence.codes) - length)
        windows[i] = sequence.codes[start : start + length + 1]
        velocities[i] = sequence.velocities[start + 1 : start + length + 1]
        speeds = sequence.speeds[start + 1 : start + length + 1]
        speed_bins[i] = np.searchsorted(edges[sequence.label], speeds)
    windows[random.random(batch) < NO_HISTORY, 0] = config.codebook_size
    before, codes = windows[:, :-1].copy(), windows[:, 1:].copy()
    labels = np.repeat([[sequence.label] for sequence in chosen], length, axis=1)
    shortest = length * config.frames_per_token / FPS
    seconds = shortest * (4 * LONGEST / shortest) ** random.random(batch)
    wrong = random.random(before.shape) < CORRUPTION * random.random((batch, 1, 1)) * 2
    wrong &= before < config.codebook_size
    before[wrong] = random.integers(config.codebook_size, size=int(wrong.sum()))
    return (
        torch.from_numpy(before),
        torch.from_numpy(labels),
        torch.from_numpy(speed_bins),
        torch.from_numpy(duration_bin(seconds)),
        torch.from_numpy(codes),
        torch.from_numpy(velocities),
    )


def on_device(batch: Batch, device: torch.device) -> Batch:
    """Returns a batch on a device."""
    before, labels, speed_bins, duration, codes, velocities = batch
    return (
        before.to(device),
        labels.to(device),
        speed_bins.to(device),
        duration.to(device),
        codes.to(device),
        None if velocities is None else velocities.to(device),
    )


def generator_loss(generator: Generator, batch: Batch) -> Tensor:
    """Returns the mean cross-entropy in nats a code."""
    logits, codes = generator(*batch), batch[4]
    return functional.cross_entropy(logits.flatten(0, 2), codes.flatten())


def score_generator(
    generator: Generator,
    tokenizer: Tokenizer,
    clips: Sequence[Clip],
    *,
    told: bool = False,
) -> float:
    """Returns the cross-entropy of whole clips in nats a code.

    ``told`` is whether the generator is told the velocity of each token.
    """
    total, count = 0.0, 0
    config = generator.config
    first = torch.full((1, 1, config.codebooks), config.codebook_size)
    duration = torch.from_numpy(duration_bin(np.array([LONGEST])))
    edges = generator.speed_edges.numpy()
    for sequence in encode_clips(tokenizer, clips, config.codebooks):
        codes = torch.from_numpy(sequence.codes)[None]
        before = torch.cat((first, codes[:, :-1]), dim=1)
        labels = torch.full(codes.shape[:2], sequence.label)
        bins = np.searchsorted(edges[sequence.label], sequence.speeds)
        velocities = torch.from_numpy(sequence.velocities).float()[None]
        batch = (
            before,
            labels,
            torch.from_numpy(bins)[None],
            duration,
            codes,
            velocities if told else None,
        )
        with torch.inference_mode(), single_thread():
            loss = generator_loss(generator, batch)
        total, count = total + float(loss) * codes.numel(), count + codes.numel()
    return total / max(count, 1)
