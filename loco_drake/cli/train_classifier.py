"""The command ``train classifier``."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar

from loco_drake.cli.options import Motions, OutFolder
from loco_drake.cli.training import Learned, NetworkTraining, Scores
from loco_drake.common.errors import InputError
from loco_drake.motion.gaits import LABELS


@dataclass(kw_only=True)
class TrainClassifier(NetworkTraining):
    """Train the transformer that classifies the gait of a 2 s trajectory.

    `evaluate generation` trains its own classifiers and does not need this one. Ctrl-C
    saves a checkpoint and stops; --resume continues.
    """

    NAME: ClassVar[str] = "classifier"
    # Folder of Motion files: written by `retarget`; motions of the validation set are
    # held out for testing.
    motions: Motions = Path("motions/go2")
    # Folder to write to: classifier.safetensors, the checkpoint and logs.
    out: OutFolder = Path("runs/classifier")
    # Number of training steps: the optimizer's, including those before --resume.
    steps: int = 300
    # Learning rate: its peak.
    learning_rate: float = 1e-3

    def learn(self) -> Learned:
        """Trains a classifier of the labels in the motions for training."""
        from loco_drake.evaluation import samples
        from loco_drake.evaluation.classifier import (
            ClassifierConfig,
            class_indices,
            predict,
            train_classifier,
        )
        from loco_drake.evaluation.confidence import accuracy
        from loco_drake.evaluation.recorded import load_recorded

        robot, recorded = load_recorded(self.motions)
        train = samples.cut(recorded.train)
        present = {motion.label for motion in train}
        labels = tuple(str(label) for label in LABELS if label in present)
        if len(labels) < 2:
            raise InputError(
                f"To tell gaits apart takes motions of {samples.SECONDS:g} s and "
                "longer of two labels for training; there are "
                f"{', '.join(labels) or 'none'}."
            )
        validation = samples.cut(recorded.validation)
        validation = [motion for motion in validation if motion.label in present]
        classifier, result = train_classifier(
            samples.make_samples(robot, train), ClassifierConfig(labels=labels), self
        )

        def score() -> Scores:
            figures: dict[str, Any] = {}
            rows = []
            for name, motions in (("train", train), ("validation", validation)):
                estimate = None
                if motions:
                    made = samples.make_samples(robot, motions)
                    right = class_indices(made.labels, labels)
                    correct = predict(classifier, made.channels) == right[:, None]
                    estimate = accuracy(
                        correct.mean(axis=1)[None],
                        samples.label_weights(made.labels),
                        made.subjects,
                    )
                figures[f"{name}_accuracy"] = estimate and asdict(estimate)
                rows.append((name, str(len(motions)), str(estimate or "-")))
            columns = ("recordings", "trajectories", "accuracy")
            return Scores(figures, columns, rows, f": {', '.join(labels)}")

        return result, score
