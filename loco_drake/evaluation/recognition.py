"""Table 1 of the paper: can gaits be told apart, in real and in generated motion?

A classifier of all labels is trained on one set of trajectories and tested on another
(GAN-train and GAN-test of Shmelkov, Schmid, Alahari 2018):

* real_to_real: trained on recordings, tested on recordings of other subjects
* real_to_generated: trained on recordings, tested on generated motion: quality
* generated_to_real: trained on generated motion, tested on the recordings of
  validation: diversity
* generated_to_real_matched: the same, with no more generated trajectories of a label
  than the recordings to train on have

Accuracies are means over labels, each of which weighs the same; mirror images count
half. Rows of a source are of the same classifier, over the labels of that source.
"""

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from sklearn import metrics

from loco_drake.common.arrays import Array, Integers
from loco_drake.evaluation.classifier import (
    LEARNING_RATE,
    STEPS,
    ClassifierConfig,
    GaitClassifier,
    linear_classifier,
    predict,
    train_classifier,
)
from loco_drake.evaluation.confidence import Estimate, accuracy
from loco_drake.evaluation.samples import (
    Samples,
    choose_per_label,
    count_per_label,
    join,
    label_weights,
)
from loco_drake.generation.loop_settings import LoopSettings
from loco_drake.motion.gaits import LABELS, SOURCES

# Returns the label, as index into LABELS, of each side of samples, shape (N, 2).
Recognizer = Callable[[Samples], Integers]
# Trains a classifier on samples, with a seed.
Fit = Callable[[Samples, int], Recognizer]


def linear_recognizer(samples: Samples, seed: int = 0) -> Recognizer:
    """Fits a multinomial logistic regression to the summaries, deterministically."""
    fitted = linear_classifier().fit(samples.rows, np.repeat(samples.labels, 2))
    return lambda tested: fitted.predict(tested.rows).reshape(-1, 2)


class TransformerRecognizer:
    """Trains the transformer of :mod:`.classifier` on samples."""

    def __init__(self, samples: Samples, seed: int = 0, steps: int = STEPS) -> None:
        self._labels = np.unique(samples.labels)
        names = tuple(str(LABELS[label]) for label in self._labels)
        with tempfile.TemporaryDirectory() as folder:
            settings = LoopSettings(
                out=Path(folder), steps=steps, learning_rate=LEARNING_RATE, seed=seed
            )
            self.classifier: GaitClassifier
            self.classifier, result = train_classifier(
                samples, ClassifierConfig(labels=names), settings
            )
        if result.stopped:
            raise KeyboardInterrupt

    def __call__(self, samples: Samples) -> Integers:
        """Returns the label of each side, shape (N, 2)."""
        found: Integers = self._labels[predict(self.classifier, samples.channels)]
        return found


@dataclass(frozen=True, eq=False)
class Recognition:
    """The results of one kind of classifier."""

    # By row of the table above, then by "all" or source.
    accuracies: dict[str, dict[str, Estimate]]
    # By row, how often (share) each label was taken for which: shape (labels, labels),
    # rows are the truth.
    confusion: dict[str, Array]
    labels: Integers  # those of the rows and columns, index into LABELS
    # The classifiers that were trained on recordings, one a seed.
    of_recordings: tuple[Recognizer, ...]

    def rows(self) -> dict[str, Any]:
        """Returns the accuracies as JSON, and the share that generated motion keeps."""
        rows: dict[str, Any] = {
            row: {name: asdict(estimate) for name, estimate in by_name.items()}
            for row, by_name in self.accuracies.items()
        }
        real = rows["real_to_real"]["all"]["mean"]
        diversity = rows["generated_to_real"]["all"]["mean"]
        return {**rows, "diversity_over_real": diversity / real if real else None}


def recognize(
    fit: Fit,
    train: Samples,
    validation: Samples,
    generated: Sequence[Samples],
    seeds: Sequence[int],
    say: Callable[[str], None] = lambda text: None,
) -> Recognition:
    """Trains classifiers on recordings and on generated motion, and tests them.

    Args:
        fit: kind of classifier.
        train: recordings to train on.
        validation: recordings of other subjects, of the same labels.
        generated: sets of generated motion; run by run, a classifier learns from the
            next of them.
        seeds: seeds of the classifiers, one for each run.
        say: receives messages about the progress.
    """
    everything = join(generated)
    counts = count_per_label(train)
    of_recordings = []
    answers: dict[str, list[Integers]] = {}
    for run, seed in enumerate(seeds):
        place = f"run {run + 1} of {len(seeds)}:"
        say(f"{place} learning from recordings")
        recognizer = fit(train, seed)
        of_recordings.append(recognizer)
        say(f"{place} learning from generated motion")
        own = generated[run % len(generated)]
        found = {
            "real_to_real": recognizer(validation),
            "real_to_generated": recognizer(everything),
            "generated_to_real": fit(own, seed)(validation),
        }
        few = choose_per_label(own, counts, np.random.default_rng(seed))
        found["generated_to_real_matched"] = found["generated_to_real"]
        if len(few) < len(own):
            say(f"{place} ... of as many trajectories")
            found["generated_to_real_matched"] = fit(few, seed)(validation)
        for row, labels in found.items():
            answers.setdefault(row, []).append(labels)
    present = np.unique(validation.labels)
    accuracies, confusion = {}, {}
    for row, runs in answers.items():
        tested = everything if row == "real_to_generated" else validation
        accuracies[row] = _accuracies(np.stack(runs), tested)
        confusion[row] = confusion_matrix(np.stack(runs), tested.labels, present)
    return Recognition(accuracies, confusion, present, tuple(of_recordings))


def _accuracies(answers: Integers, tested: Samples) -> dict[str, Estimate]:
    """Returns accuracies of answers (runs, N, 2), of all labels and of each source."""
    correct = (answers == tested.labels[:, None]).mean(axis=2)
    sources = np.array([LABELS[label].source for label in tested.labels])
    rows = {"all": np.ones(len(tested), dtype=np.bool_)}
    rows |= {source: sources == source for source in SOURCES if source in sources}
    return {
        name: accuracy(
            correct[:, chosen],
            label_weights(tested.labels[chosen]),
            tested.subjects[chosen],
        )
        for name, chosen in rows.items()
    }


def confusion_matrix(answers: Integers, truth: Integers, labels: Integers) -> Array:
    """Returns a confusion matrix (L, L); rows are true labels and sum to 1.

    Answers (runs, N, 2), truth (N,) and the labels of rows and columns (L,) are indices
    into LABELS.
    """
    true = np.broadcast_to(truth[:, None], answers.shape)
    return metrics.confusion_matrix(
        true.ravel(), answers.ravel(), labels=labels, normalize="true"
    )
