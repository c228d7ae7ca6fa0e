"""Gait classifiers for trajectories: a transformer and a linear one.

The transformer follows PoseGPT's (Lucas et al. 2022), on which the paper's Table 1 is
based: attention over short stretches of the trajectory, averaged over time, then a
narrow layer in which the Frechet distance is measured.
"""

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler
from torch import Tensor, nn
from torch.nn import functional

from loco_drake.common.arrays import Array, Integers
from loco_drake.common.determinism import single_thread
from loco_drake.common.device import find_device
from loco_drake.common.weights import load_network, save_network
from loco_drake.evaluation.samples import CHANNELS, FRAMES, Samples, label_weights
from loco_drake.generation.loop_settings import LoopSettings
from loco_drake.generation.training import LoopResult, train
from loco_drake.motion.gaits import LABELS

BATCH = 48
STEPS = 300
LEARNING_RATE = 1e-3


@dataclass(frozen=True)
class ClassifierConfig:
    """Sizes of a :class:`GaitClassifier`."""

    labels: tuple[str, ...]  # names of the gait labels that it tells apart
    frames_per_patch: int = 5  # frames that are put side by side as one step of time
    width: int = 64  # channels
    layers: int = 2  # transformer layers
    heads: int = 4  # attention heads
    embedding: int = 32  # channels of the last layer but one
    dropout: float = 0.1  # probability, while training


class GaitClassifier(nn.Module):
    """Maps channels of :mod:`loco_drake.evaluation.samples` to logits of labels."""

    def __init__(self, config: ClassifierConfig) -> None:
        super().__init__()
        self.config = config
        self.register_buffer("mean", torch.zeros(CHANNELS))
        self.register_buffer("std", torch.ones(CHANNELS))
        self.mean: Tensor
        self.std: Tensor
        patches = FRAMES // config.frames_per_patch
        self.patch_in = nn.Linear(config.frames_per_patch * CHANNELS, config.width)
        self.time = nn.Parameter(torch.randn(patches, config.width) * 0.02)
        layer = nn.TransformerEncoderLayer(
            config.width,
            config.heads,
            2 * config.width,
            config.dropout,
            activation="gelu",
            batch_first=True,
            norm_first=True,
        )
        self.encoder = nn.TransformerEncoder(
            layer, config.layers, enable_nested_tensor=False
        )
        self.embed_out = nn.Sequential(
            nn.LayerNorm(config.width),
            nn.Linear(config.width, config.embedding),
            nn.Tanh(),
        )
        self.head = nn.Linear(config.embedding, len(config.labels))

    def set_statistics(self, channels: Tensor) -> None:
        """Takes mean and spread of channels (N, CHANNELS) for normalization."""
        self.mean.copy_(channels.mean(dim=0))
        self.std.copy_(channels.std(dim=0).clamp(min=1e-3))

    def embed(self, channels: Tensor) -> Tensor:
        """Maps (B, FRAMES, CHANNELS) to embeddings (B, embedding), within (-1, 1)."""
        x = (channels - self.mean) / self.std
        x = x.reshape(len(x), len(self.time), -1)
        x = self.encoder(self.patch_in(x) + self.time)
        out: Tensor = self.embed_out(x.mean(dim=1))
        return out

    def forward(self, channels: Tensor) -> Tensor:
        """Maps (B, FRAMES, CHANNELS) to logits (B, labels)."""
        logits: Tensor = self.head(self.embed(channels))
        return logits


def embeddings(classifier: GaitClassifier, channels: Array) -> Array:
    """Returns embeddings (..., embedding) of channels (..., FRAMES, CHANNELS)."""
    flat = channels.reshape(-1, FRAMES, CHANNELS)
    with torch.inference_mode(), single_thread():
        parts = [
            classifier.embed(torch.tensor(batch, dtype=torch.float32))
            for batch in np.split(flat, range(256, len(flat), 256))
        ]
    out = torch.cat(parts).numpy().astype(np.float64)
    return out.reshape(*channels.shape[:-2], -1)


def predict(classifier: GaitClassifier, channels: Array) -> Integers:
    """Returns the likeliest label's index in config.labels, shape (...)."""
    embedded = torch.tensor(embeddings(classifier, channels), dtype=torch.float32)
    with torch.inference_mode(), single_thread():
        logits = classifier.head(embedded)
    return logits.argmax(dim=-1).numpy()


def load_classifier(path: Path) -> GaitClassifier:
    """Reads a classifier, ready for inference.

    Raises:
        InputError: if the file is missing, damaged, or of something else.
    """
    return load_network(path, "classifier", GaitClassifier, ClassifierConfig)


def train_classifier(
    samples: Samples, config: ClassifierConfig, settings: LoopSettings
) -> tuple[GaitClassifier, LoopResult]:
    """Trains a classifier and writes ``classifier.safetensors`` if it was not stopped.

    Samples of labels that ``config`` lacks are left out. All labels are seen equally
    often, and so are trajectories and their mirror images.
    """
    classes = class_indices(samples.labels, config.labels)
    samples, classes = samples[classes >= 0], classes[classes >= 0]
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(settings.seed)
        classifier = GaitClassifier(config)
    device = find_device(settings.device)
    channels = torch.tensor(samples.channels, dtype=torch.float32)
    classifier.set_statistics(channels.reshape(-1, CHANNELS))
    channels, targets = channels.to(device), torch.tensor(classes).to(device)
    weights = label_weights(samples.labels)

    def loss_of_batch(random: np.random.Generator) -> tuple[Tensor, dict[str, float]]:
        rows = random.choice(len(samples), size=BATCH, p=weights)
        batch = channels[rows, random.integers(2, size=BATCH)]
        logits = classifier(batch)
        loss = functional.cross_entropy(logits, targets[rows], label_smoothing=0.05)
        right = (logits.argmax(dim=-1) == targets[rows]).float().mean()
        return loss, {"accuracy": right.item()}

    run = {"network": asdict(config), "motions": f"{len(samples)} trajectories"}
    result = train("classifier", classifier, loss_of_batch, settings, run)
    classifier.requires_grad_(False)
    if not result.stopped:
        path = Path(settings.out) / "classifier.safetensors"
        info = {"trajectories": len(samples)}
        save_network(path, "classifier", classifier, info)
    return classifier, result


def class_indices(labels: Integers, names: tuple[str, ...]) -> Integers:
    """Returns the position in ``names`` of each index into LABELS, -1 if absent."""
    known = map(str, LABELS)
    return np.array([names.index(k) if k in names else -1 for k in known])[labels]


def linear_classifier() -> Pipeline:
    """Returns a multinomial logistic regression on standardized features.

    All classes weigh the same, however many rows each has.
    """
    regression = LogisticRegression(C=1.0, class_weight="balanced", max_iter=3000)
    return make_pipeline(StandardScaler(), regression)
