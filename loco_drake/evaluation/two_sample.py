"""Two-sample test: whether a classifier distinguishes generated from recorded motion.

The test of Lopez-Paz and Oquab 2017; .5 is chance. Both classes have the same number of
trajectories per label. Accuracies are those of held-out folds; all trajectories of a
subject, with their mirror images, are in one fold.
"""

from collections.abc import Callable
from dataclasses import astuple
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.model_selection import StratifiedGroupKFold
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC

from loco_drake.evaluation.classifier import fit_linear
from loco_drake.evaluation.confidence import Estimate, accuracy
from loco_drake.evaluation.samples import (
    Samples,
    choose_per_label,
    count_per_label,
    join,
)

Array = NDArray[np.float64]

FOLDS = 5


def fit_kernel(features: Array, classes: NDArray[np.int64]) -> Pipeline:
    """Fits a support vector machine with radial basis functions.

    It finds nonlinear differences.
    """
    return make_pipeline(StandardScaler(), SVC(C=3.0)).fit(features, classes)


FITS: dict[str, Callable[[Array, NDArray[np.int64]], Any]] = {
    "linear": fit_linear,
    "kernel": fit_kernel,
}


def two_sample_accuracy(
    a: Samples, b: Samples, seeds: list[int], fit: str = "linear"
) -> Estimate | None:
    """Returns the accuracy of distinguishing trajectories of ``a`` and ``b``.

    Args:
        a: one set, such as real trajectories.
        b: the other set.
        seeds: each draws trajectories and folds anew; the accuracy is the mean.
        fit: which classifier of the summaries, a key of FITS.

    Returns:
        Accuracy and interval, see :func:`loco_drake.evaluation.confidence.accuracy`;
        None if there are fewer than FOLDS subjects in either set.
    """
    counts_a, counts_b = count_per_label(a), count_per_label(b)
    counts = {
        label: min(n, counts_b[label])
        for label, n in counts_a.items()
        if label in counts_b
    }
    runs = []
    for seed in seeds:
        random = np.random.default_rng(seed)
        drawn = [choose_per_label(each, counts, random) for each in (a, b)]
        if min(len(np.unique(each.subjects)) for each in drawn) < FOLDS:
            return None
        runs.append(_cross_validate(drawn[0], drawn[1], FITS[fit], seed))
    # Every run draws anew: what is drawn again are runs, and subjects within them.
    estimates = [
        accuracy(right[None], weights, subjects) for right, weights, subjects in runs
    ]
    columns = zip(*map(astuple, estimates), strict=True)
    return Estimate(*(float(np.mean(column)) for column in columns))


def _cross_validate(
    a: Samples, b: Samples, fit: Callable[[Array, NDArray[np.int64]], Any], seed: int
) -> tuple[Array, Array, NDArray[np.str_]]:
    """Returns for each trajectory its share classified rightly, weight and subject."""
    both = join((a, b))
    classes = np.repeat([0, 1], (len(a), len(b)))
    subjects = np.char.add(np.repeat(["a:", "b:"], (len(a), len(b))), both.subjects)
    folds = StratifiedGroupKFold(FOLDS, shuffle=True, random_state=seed)
    right = np.empty(len(both))
    for train, test in folds.split(both.summaries[:, 0], classes, subjects):
        rows = both.summaries[train].reshape(2 * len(train), -1)
        fitted = fit(rows, np.repeat(classes[train], 2))
        found = fitted.predict(both.summaries[test].reshape(2 * len(test), -1))
        right[test] = (found.reshape(-1, 2) == classes[test, None]).mean(axis=1)
    return right, np.full(len(both), 1.0 / len(both)), subjects
