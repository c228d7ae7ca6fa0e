"""Two-sample test: whether a classifier distinguishes generated from recorded motion.

The test of Lopez-Paz and Oquab 2017; .5 is chance. Both classes have the same number of
trajectories per label. Accuracies are those of held-out folds; all trajectories of a
subject, with their mirror images, are in one fold.
"""

from dataclasses import astuple

import numpy as np
from numpy.typing import NDArray
from sklearn.model_selection import StratifiedGroupKFold, cross_val_predict
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC

from loco_drake.common.arrays import Array
from loco_drake.evaluation.classifier import linear_classifier
from loco_drake.evaluation.confidence import Estimate, accuracy
from loco_drake.evaluation.samples import (
    Samples,
    choose_per_label,
    count_per_label,
    join,
)

FOLDS = 5
# The kernel, of radial basis functions, finds nonlinear differences.
CLASSIFIERS = {
    "linear": linear_classifier(),
    "kernel": make_pipeline(StandardScaler(), SVC(C=3.0)),
}


def two_sample_accuracy(
    a: Samples, b: Samples, seeds: list[int], classifier: str = "linear"
) -> Estimate | None:
    """Returns the accuracy of distinguishing trajectories of ``a`` and ``b``.

    It is the mean over seeds, each of which draws trajectories and folds anew, with the
    interval of :func:`.confidence.accuracy`; None if either set has fewer than FOLDS
    subjects. ``classifier`` is a key of CLASSIFIERS.
    """
    counts = count_per_label(a) & count_per_label(b)
    estimates = []
    for seed in seeds:
        random = np.random.default_rng(seed)
        of_a, of_b = (choose_per_label(each, counts, random) for each in (a, b))
        if min(len(np.unique(each.subjects)) for each in (of_a, of_b)) < FOLDS:
            return None
        right, subjects = _cross_validate(of_a, of_b, classifier, seed)
        # Every run draws anew, so only subjects within it are drawn again.
        weights = np.full(len(right), 1.0 / len(right))
        estimates.append(accuracy(right[None], weights, subjects))
    columns = zip(*map(astuple, estimates), strict=True)
    return Estimate(*(float(np.mean(column)) for column in columns))


def _cross_validate(
    a: Samples, b: Samples, classifier: str, seed: int
) -> tuple[Array, NDArray[np.str_]]:
    """Returns each trajectory's share that is classified rightly, and its subject."""
    both = join((a, b))
    classes = np.repeat([0, 1], (len(a), len(b)))
    subjects = np.char.add(np.repeat(["a:", "b:"], (len(a), len(b))), both.subjects)
    found = cross_val_predict(
        CLASSIFIERS[classifier],
        both.rows,
        np.repeat(classes, 2),
        groups=np.repeat(subjects, 2),
        cv=StratifiedGroupKFold(FOLDS, shuffle=True, random_state=seed),
    )
    return (found.reshape(-1, 2) == classes[:, None]).mean(axis=1), subjects
