"""Training of the tokenizer on windows of clips.

vector-quantize-pytorch updates the codebooks by exponential moving averages and
replaces dead codes by samples of the batch. The finest codebooks are dropped at random,
so that the decoder can use the coarse ones alone.
"""

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import reduce
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional
from vector_quantize_pytorch import ResidualVQ

from loco_drake.common.device import find_device
from loco_drake.common.errors import InputError
from loco_drake.common.weights import save_network
from loco_drake.generation.clips import Chosen, Clip, in_parts
from loco_drake.generation.features import CONTACTS
from loco_drake.generation.loop_settings import LoopSettings
from loco_drake.generation.point_masses import PointMasses
from loco_drake.generation.tokenizer import Tokenizer, TokenizerConfig
from loco_drake.generation.tokenizer_score import Toes
from loco_drake.generation.training import LoopResult, train
from loco_drake.generation.training_motions import (
    Library,
    read_training_record,
    training_record,
)
from loco_drake.generation.windows import PairedWindows, long_enough
from loco_drake.motion.gaits import LABELS

Array = NDArray[np.float64]
Moments = tuple[int, Array, Array]  # number of rows, their mean and their variance

BATCH = 32  # windows
# Batches are decoded from between so many and all of the codebooks.
FEWEST_CODEBOOKS = 2

# Weights of the losses; each is about 1 before training.
WEIGHTS = {
    "features": 1.0,  # squared error, see Scales
    "changes": 0.25,  # ... of the change from frame to frame
    "jitter": 0.1,  # ... of the change of that
    "energy": 0.5,  # squared error of the logarithm of the RMS of that in a window
    "toes": 1.0,  # squared error of toe positions, in units of TOE_SCALE
    "toe_speeds": 0.5,  # ... of their velocities over the ground, TOE_SPEED_SCALE
    # What forces of the feet do not explain of the error of momentum's rate of change,
    # MOMENTUM_SCALE.
    "momentum": 0.25,
    "contacts": 0.2,  # cross-entropy
    "commitment": 0.25,
}
LEAST_SHARE = 0.1  # of a label's scale in that of all
LEAST_SCALES = (0.02, 0.005, 0.002)  # of deviation, change, jitter: rad, stand heights
QUIET = 0.2  # share of a label's jitter that is taken for none
TOE_SCALE = 0.05  # m
TOE_SPEED_SCALE = 0.5  # m/s
MOMENTUM_SCALE = 0.1  # of the weight, see PointMasses.unexplained


class Scales:
    """Scales of the features by label, the units of their errors.

    The trunk of a walking horse moves so evenly that in units of the variation between
    gaits its jitter would have no weight. Labels without clips get the scales of all.
    """

    def __init__(
        self, clips: Sequence[Clip], device: torch.device | str = "cpu"
    ) -> None:
        by_label: dict[int, list[int]] = defaultdict(list)
        for row, clip in enumerate(clips):
            by_label[clip.label.index].append(row)
        own = {
            label: _variances(Chosen(clips, rows)) for label, rows in by_label.items()
        }
        everything: Array = np.mean(list(own.values()), axis=0)
        table = np.stack([own.get(i, everything) for i in range(len(LABELS))])
        # Do not amplify features that hardly vary.
        scales = np.sqrt(np.maximum(table, LEAST_SHARE**2 * everything))
        scales = np.maximum(scales, np.array(LEAST_SCALES)[:, None])
        # (labels, 3, ...)
        self._scales = torch.tensor(scales, dtype=torch.float32, device=device)

    def __call__(self, label: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Returns those of deviations, changes and jitter, (N, 1, ...), for (N,)."""
        deviation, change, jitter = self._scales[label, :, None].unbind(dim=1)
        return deviation, change, jitter


def _variances(clips: Sequence[Clip]) -> Array:
    """Returns variances and mean squared first and second differences, (3, N)."""
    orders = []
    for part in in_parts(clips):
        values = [clip.features[:, : CONTACTS.start] for clip in part]
        frames = np.concatenate(values)
        found = [(len(frames), frames.mean(axis=0), frames.var(axis=0))]
        for n in (1, 2):
            changes = np.concatenate([np.diff(x, n=n, axis=0) for x in values])
            square = np.square(changes).mean(axis=0)
            found.append((len(changes), np.zeros_like(square), square))
        orders.append(found)
    together = (reduce(_together, order) for order in zip(*orders, strict=True))
    return np.stack([variance for _, _, variance in together])


def _together(a: Moments, b: Moments) -> Moments:
    """Returns number, mean and variance of two sets of rows together."""
    (n, mean_a, variance_a), (m, mean_b, variance_b) = a, b
    share = m / (n + m)
    apart = mean_b - mean_a
    variance = (1 - share) * variance_a + share * variance_b
    variance = variance + share * (1 - share) * np.square(apart)
    return n + m, mean_a + share * apart, variance


def statistics(clips: Sequence[Clip]) -> tuple[Tensor, Tensor]:
    """Returns mean and standard deviation of the features of clips, (SIZE,) each."""
    parts = []
    for part in in_parts(clips):
        frames = np.concatenate([clip.features for clip in part])
        rows = torch.tensor(frames, dtype=torch.float32)
        parts.append((len(rows), rows.mean(dim=0), rows.std(dim=0)))
    _, mean, std = parts[0]
    if len(parts) == 1:
        return mean, std
    moments = (
        (n, mean.double().numpy(), np.square(std.double().numpy()) * (1 - 1 / n))
        for n, mean, std in parts
    )
    n, means, variances = reduce(_together, moments)
    deviations = np.sqrt(variances / (1 - 1 / n))
    return torch.from_numpy(means).float(), torch.from_numpy(deviations).float()


class LearningTokenizer(nn.Module):
    """A tokenizer, trained in place, with the quantizer that learns its codebooks."""

    def __init__(self, tokenizer: Tokenizer) -> None:
        super().__init__()
        self.tokenizer = tokenizer
        self.quantizer = ResidualVQ(
            dim=tokenizer.config.code_size,
            num_quantizers=tokenizer.config.codebooks,
            codebook_size=tokenizer.config.codebook_size,
            kmeans_init=True,
            kmeans_iters=20,
            decay=0.98,
            threshold_ema_dead_code=1,
            quantize_dropout=True,
            quantize_dropout_cutoff_index=FEWEST_CODEBOOKS - 1,
        )

    def forward(
        self, features: Tensor, robot: Tensor, decoded_for: Tensor | None = None
    ) -> tuple[Tensor, Tensor]:
        """Encodes, quantizes and decodes features (B, T, SIZE) of robots (B,).

        The tokens are decoded for the robots ``decoded_for``, shape (R * B,): first one
        for each window, then a second for each, and so on; None: the windows' own.
        Returns reconstructions (R * B, T, SIZE) with contacts as logits, and the
        commitment loss.
        """
        decoded_for = robot if decoded_for is None else decoded_for
        embedded = self.tokenizer.embed(features, robot)
        quantized, _, commitment = self.quantizer(embedded)
        repeated = quantized.repeat(len(decoded_for) // len(robot), 1, 1)
        output = self.tokenizer.decode_embedded(repeated, decoded_for)
        return output, commitment.mean()

    def finish(self) -> Tokenizer:
        """Returns the tokenizer after setting its codebooks."""
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
    clips = long_enough(library.train)
    missing = sorted(set(library.robots) - set(config.robots))
    if missing:
        raise InputError(f"The tokenizer is not to know {', '.join(missing)}.")
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(settings.seed)
        learning = LearningTokenizer(Tokenizer(config))
    with torch.no_grad():
        # Start with constant output: unlearning initial jitter would kill most codes.
        learning.tokenizer.decoder_out.weight.mul_(0.01)
    learning.tokenizer.set_statistics(*statistics(clips))
    device = find_device(settings.device)
    toes = Toes(config.robots, device)
    masses = PointMasses(config.robots, device)
    windows = PairedWindows(clips, config.robots)
    scales = Scales(clips, device)

    def loss_of_batch(random: np.random.Generator) -> tuple[Tensor, dict[str, float]]:
        target, robot, label = (x.to(device) for x in windows(random, BATCH))
        losses = tokenizer_losses(learning, toes, masses, scales(label), target, robot)
        return weighed(losses, WEIGHTS)

    network, motions = asdict(config), library.summary
    run = {"network": network, "weights": WEIGHTS, "motions": motions}
    result = train("tokenizer", learning, loss_of_batch, settings, run)
    tokenizer = learning.finish()
    if not result.stopped:
        save_trained(tokenizer, library, settings)
    return tokenizer, result


def save_trained(
    tokenizer: Tokenizer,
    library: Library,
    settings: LoopSettings,
    base: Path | None = None,
) -> None:
    """Writes ``tokenizer.safetensors``, with the record of its training.

    The record includes that of the tokenizer at ``base``, with which it began.
    """
    before = None if base is None else read_training_record(base, "tokenizer")
    record = training_record(library, settings, before)
    info = {"labels": [str(label) for label in library.labels], "training": record}
    path = Path(settings.out) / "tokenizer.safetensors"
    save_network(path, "tokenizer", tokenizer, info, half=True)


def weighed(
    losses: Mapping[str, Tensor], weights: Mapping[str, float]
) -> tuple[Tensor, dict[str, float]]:
    """Returns the sum of those losses that have weights, and each without, to log."""
    chosen = {name: loss for name, loss in losses.items() if name in weights}
    parts = (weights[name] * loss for name, loss in chosen.items())
    total = sum(parts, torch.zeros_like(next(iter(chosen.values()))))
    return total, {name: loss.item() for name, loss in chosen.items()}


def tokenizer_losses(
    learning: Callable[[Tensor, Tensor, Tensor], tuple[Tensor, Tensor]],
    toes: Toes,
    masses: PointMasses | None,
    scales: tuple[Tensor, Tensor, Tensor],
    target: Tensor,
    robot: Tensor,
) -> dict[str, Tensor]:
    """Returns the losses of a batch, unweighted; see :data:`WEIGHTS`.

    Args:
        learning: returns reconstructions and the commitment loss, see
            :class:`LearningTokenizer`, whose codebooks are updated in training mode.
        toes: of the tokenizer's robots.
        masses: of the tokenizer's robots; None to leave out momentum.
        scales: of the windows, see :class:`Scales`.
        target: features, shape (N, T, SIZE). The first BATCH windows are encoded, and
            all are to be decoded from their tokens, see :class:`PairedWindows`.
        robot: index of each window's robot, shape (N,).
    """
    output, commitment = learning(target[:BATCH], robot[:BATCH], robot)
    contacts = output[..., CONTACTS]
    error = (output - target)[..., : CONTACTS.start]
    deviation, change, jitter = scales
    p_target = toes.positions(target, robot)
    p_output = toes.positions(output, robot)
    v_target = toes.velocities(target, p_target, robot)
    v_output = toes.velocities(output, p_output, robot)
    momentum = {}
    if masses is not None:
        # Half of the windows are enough, at half the time.
        half = (x[::2] for x in (output, target, p_target, robot))
        momentum["momentum"] = masses.unexplained(*half).mean() / MOMENTUM_SCALE**2
    return {
        "features": (error / deviation).square().mean(),
        "changes": (error.diff(dim=1) / change).square().mean(),
        "jitter": (error.diff(n=2, dim=1) / jitter).square().mean(),
        "energy": energy_error(output, target, jitter),
        "toes": ((p_output - p_target) / TOE_SCALE).square().mean(),
        "toe_speeds": ((v_output - v_target) / TOE_SPEED_SCALE).square().mean(),
        **momentum,
        "contacts": functional.binary_cross_entropy_with_logits(
            contacts, target[..., CONTACTS]
        ),
        "commitment": commitment,
    }


def energy_error(output: Tensor, target: Tensor, jitter: Tensor) -> Tensor:
    """Returns the error of the energy of jitter per window, in logarithmic scale.

    A token cannot encode the phase of jitter. The squared error alone would therefore
    remove jitter; this loss requires it, in any phase. Features are (N, T, SIZE);
    ``jitter`` is its scale, see :class:`Scales`.
    """

    def energy(features: Tensor) -> Tensor:
        turn = features[..., : CONTACTS.start].diff(n=2, dim=1) / jitter
        return torch.log(turn.square().mean(dim=1) + QUIET**2) / 2

    return (energy(output) - energy(target)).square().mean()
