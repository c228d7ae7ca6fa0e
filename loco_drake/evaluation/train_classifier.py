"""Training of the gait classifiers: the transformer, and a linear one to compare."""

from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler
from torch import Tensor
from torch.nn import functional

from loco_drake.evaluation.classifier import (
    ClassifierConfig,
    GaitClassifier,
    save_classifier,
)
from loco_drake.evaluation.samples import CHANNELS, Samples, label_weights
from loco_drake.generation.loop_settings import LoopSettings
from loco_drake.generation.training import LoopResult, train
from loco_drake.motion.gaits import LABELS

BATCH = 48
STEPS = 300
LEARNING_RATE = 1e-3


def train_classifier(
    samples: Samples, config: ClassifierConfig, settings: LoopSettings
) -> tuple[GaitClassifier, LoopResult]:
    """Trains a classifier and writes ``classifier.safetensors`` if it was not stopped.

    All labels are seen equally often, and every trajectory as it is as often as
    mirrored.

    Args:
        samples: of the labels in ``config``; others are not looked at.
        config: sizes of the network.
        settings: of the training.
    """
    classes = class_indices(samples.labels, config.labels)
    samples, classes = samples[classes >= 0], classes[classes >= 0]
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(settings.seed)
        classifier = GaitClassifier(config)
    channels = torch.tensor(samples.channels, dtype=torch.float32)
    classifier.set_statistics(channels.reshape(-1, CHANNELS))
    targets = torch.tensor(classes)
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
        save_classifier(classifier, path, {"trajectories": len(samples)})
    return classifier, result


def class_indices(
    labels: NDArray[np.int64], names: tuple[str, ...]
) -> NDArray[np.int64]:
    """Returns the place in ``names`` of each index into LABELS, -1 where it is not."""
    place = {
        str(label): names.index(str(label)) for label in LABELS if str(label) in names
    }
    table = np.array([place.get(str(label), -1) for label in LABELS])
    return table[labels]


def fit_linear(features: NDArray[np.float64], classes: NDArray[np.int64]) -> Pipeline:
    """Fits a multinomial logistic regression on standardized features.

    Args:
        features: shape (N, C).
        classes: shape (N,); all weigh the same, however many rows each has.
    """
    return make_pipeline(
        StandardScaler(),
        LogisticRegression(C=1.0, class_weight="balanced", max_iter=3000),
    ).fit(features, classes)
