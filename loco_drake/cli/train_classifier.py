"""The command ``train classifier``."""

import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar

from loco_drake.cli.output import print_table, write_json
from loco_drake.cli.training import print_stopped
from loco_drake.common.errors import InputError
from loco_drake.generation.loop_settings import LoopSettings
from loco_drake.motion.gaits import LABELS


@dataclass(kw_only=True)
class TrainClassifier(LoopSettings):
    """Train the transformer that classifies the gait of a 2 s trajectory.

    `evaluate generation` trains its own classifiers and does not need this one. Ctrl-C
    saves a checkpoint and stops; --resume continues.
    """

    NAME: ClassVar[str] = "classifier"
    # Folder of Motion files written by `retarget`; motions of the validation set are
    # held out for testing.
    motions: Path = Path("motions/go2")
    # Folder for classifier.safetensors, the checkpoint and logs.
    out: Path = Path("runs/classifier")
    # Total optimizer steps.
    steps: int = 300
    # Peak learning rate.
    learning_rate: float = 1e-3
    # Write the figures to this JSON file.
    json: Path | None = None

    def run(self) -> int:
        """Trains; returns 1 if it was stopped before its last step, else 0.

        Raises:
            InputError: if an option is wrong.
        """
        self.check()
        from loco_drake.common.run_folder import check_folder
        from loco_drake.evaluation.classifier import (
            ClassifierConfig,
            class_indices,
            predict,
            train_classifier,
        )
        from loco_drake.evaluation.confidence import accuracy
        from loco_drake.evaluation.recorded import load_recorded
        from loco_drake.evaluation.samples import (
            SECONDS,
            cut,
            label_weights,
            make_samples,
        )

        check_folder(self.out, f"{self.NAME}.safetensors", self.resume)
        robot, recorded = load_recorded(self.motions)
        train, validation = cut(recorded.train), cut(recorded.validation)
        present = {motion.label for motion in train}
        labels = tuple(str(label) for label in LABELS if label in present)
        if len(labels) < 2:
            raise InputError(
                f"To tell gaits apart takes motions of {SECONDS:g} s and longer of two "
                f"labels for training; there are {', '.join(labels) or 'none'}."
            )
        validation = [motion for motion in validation if motion.label in present]
        samples = make_samples(robot, train)
        start = time.perf_counter()
        classifier, result = train_classifier(
            samples, ClassifierConfig(labels=labels), self
        )
        if result.stopped:
            return print_stopped(result.steps, self.steps)
        figures: dict[str, Any] = {
            "steps": result.steps,
            "wall_clock_s": time.perf_counter() - start,
        }
        rows = []
        for name, motions in (("train", train), ("validation", validation)):
            estimate = None
            if motions:
                samples = make_samples(robot, motions)
                right = class_indices(samples.labels, labels)
                correct = predict(classifier, samples.channels) == right[:, None]
                weights = label_weights(samples.labels)
                correct = correct.mean(axis=1)[None]
                estimate = accuracy(correct, weights, samples.subjects)
            figures[f"{name}_accuracy"] = estimate and asdict(estimate)
            rows.append([name, str(len(motions)), str(estimate or "-")])
        write_json(self.json, figures)
        title = f"{self.out / 'classifier.safetensors'}: {', '.join(labels)}"
        print_table(title, ["recordings", "trajectories", "accuracy"], rows)
        return 0
