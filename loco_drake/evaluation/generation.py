"""All figures of ``loco-drake evaluate generation``."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from loco_drake.common.errors import InputError
from loco_drake.evaluation import drift as drifting
from loco_drake.evaluation.classifier import embeddings
from loco_drake.evaluation.distances import frechet_distance, moments, nearest_distances
from loco_drake.evaluation.effort import Effort
from loco_drake.evaluation.motion_scores import compare, measure, overall
from loco_drake.evaluation.recognition import (
    Fit,
    Recognition,
    TransformerRecognizer,
    linear_recognizer,
    recognize,
)
from loco_drake.evaluation.recorded import Recorded
from loco_drake.evaluation.samples import (
    FRAMES,
    SUMMARY,
    Samples,
    by_label,
    cut,
    join,
    label_weights,
    labels_of,
    make_samples,
)
from loco_drake.evaluation.two_sample import FOLDS, two_sample_accuracy
from loco_drake.models.robots import Robot
from loco_drake.motion.gaits import LABELS
from loco_drake.motion.motion import Motion


@dataclass(frozen=True, eq=False)
class Generated:
    """Motion to be scored."""

    # Trajectories of 2 s, drawn several times over.
    sets: tuple[tuple[Motion, ...], ...]
    # Motions of a minute by label, for the drift; may lack labels.
    long: dict[str, list[Motion]]


def score_generation(
    robot: Robot,
    recorded: Recorded,
    generated: Generated,
    effort: Effort,
    seed: int,
    say: Callable[[str], None] = lambda text: None,
) -> tuple[dict[str, Any], dict[str, Recognition]]:
    """Compares generated with recorded motion of one robot.

    Only labels with training and validation recordings and generated motion are
    compared. All that is random follows ``seed``; ``say`` receives messages about the
    progress.

    Returns:
        The figures, as JSON; what the classifiers did, by their kind.

    Raises:
        InputError: if there are fewer than two such labels.
    """
    names = labels_of(recorded.labels, by_label(generated.sets[0]))
    if len(names) < 2:
        raise InputError(
            "To tell gaits apart takes two labels at least, with recordings for "
            f"training and for validation; there are {', '.join(names) or 'none'}."
        )
    train, validation, *sets = (
        [m for m in side if str(m.label) in names]
        for side in (recorded.train, recorded.validation, *generated.sets)
    )
    cut_train, cut_validation = cut(train), cut(validation)
    seeds = list(range(seed, seed + effort.seeds))
    fits: dict[str, Fit] = {
        "transformer": partial(TransformerRecognizer, steps=effort.steps),
        "linear": linear_recognizer,
    }
    with threadpool_limits(1):  # the same figures on any machine
        of_train = make_samples(robot, cut_train)
        of_validation = make_samples(robot, cut_validation)
        of_sets = _samples_of_sets(robot, sets)
        recognition = {}
        for kind, fit in fits.items():
            say(f"Training {kind} classifiers")
            recognition[kind] = recognize(
                fit, of_train, of_validation, of_sets, seeds, say
            )
        say("Comparing real with generated motion")
        figures: dict[str, Any] = {
            "trajectories": {
                "train": len(of_train),
                "validation": len(of_validation),
                "generated": sum(map(len, of_sets)),
            },
            "classifiers": {kind: found.rows() for kind, found in recognition.items()},
            "confusion": _confusion(recognition),
            **_two_sample(of_train, of_validation, join(of_sets), seeds),
            **_frechet(recognition["transformer"], of_train, of_validation, of_sets),
            **_nearest(train, cut_train, cut_validation, sets),
            **_drift(robot, generated.long, recorded),
            **_by_label(robot, recorded, generated),
        }
    few = f"Fewer than {FOLDS} subjects on a side."
    reasons = {
        "two_sample_accuracy": few,
        "two_sample_accuracy_real_real": few,
        "drift_60s": "No label has two motions of a minute.",
    }
    figures["reason"] = {k: v for k, v in reasons.items() if figures[k] is None}
    return figures, recognition


def _samples_of_sets(robot: Robot, sets: Sequence[Sequence[Motion]]) -> list[Samples]:
    """Returns samples of each set; motions without a subject are one each."""
    joined = make_samples(robot, [motion for each in sets for motion in each])
    ends = np.cumsum([len(each) for each in sets])
    return [joined[rows] for rows in np.split(np.arange(len(joined)), ends[:-1])]


def _confusion(recognition: dict[str, Recognition]) -> dict[str, Any]:
    matrices = {
        kind: {row: matrix.round(4).tolist() for row, matrix in r.confusion.items()}
        for kind, r in recognition.items()
    }
    labels = recognition["linear"].labels
    return {"labels": [str(LABELS[label]) for label in labels], **matrices}


def _two_sample(
    train: Samples, validation: Samples, generated: Samples, seeds: list[int]
) -> dict[str, Any]:
    """Returns the two-sample tests: of all recordings, and of parts of the summary."""
    real = join((train, validation))

    def test(a: Samples, b: Samples, kind: str = "linear") -> dict[str, float] | None:
        estimate = two_sample_accuracy(a, b, seeds, kind)
        return None if estimate is None else asdict(estimate)

    def part(samples: Samples, columns: slice) -> Samples:
        return replace(samples, summaries=samples.summaries[..., columns])

    return {
        "two_sample_accuracy": test(real, generated),
        "two_sample_accuracy_kernel": test(real, generated, "kernel"),
        "two_sample_accuracy_of_parts": {
            name: test(part(real, columns), part(generated, columns))
            for name, columns in SUMMARY.items()
        },
        "two_sample_accuracy_real_real": test(train, validation),
    }


def _frechet(
    recognition: Recognition,
    train: Samples,
    validation: Samples,
    sets: Sequence[Samples],
) -> dict[str, Any]:
    """Returns Frechet distances, means over classifiers and sets, and their spread."""
    distances, floors = [], []
    for recognizer in recognition.of_recordings:
        assert isinstance(recognizer, TransformerRecognizer)
        classifier = recognizer.classifier
        of_train, of_validation, *of_sets = (
            moments(embeddings(classifier, s.channels), label_weights(s.labels))
            for s in (train, validation, *sets)
        )
        floors.append(frechet_distance(of_train, of_validation))
        distances.append([frechet_distance(of_train, each) for each in of_sets])
    return {
        "fid": float(np.mean(distances)),
        "fid_real_real": float(np.mean(floors)),
        "fid_over_real_real": float(np.mean(distances) / np.mean(floors)),
        "fid_range": [float(np.min(distances)), float(np.max(distances))],
        "fid_real_real_range": [float(np.min(floors)), float(np.max(floors))],
    }


def _nearest(
    train: Sequence[Motion],
    cut_train: Sequence[Motion],
    cut_validation: Sequence[Motion],
    sets: Sequence[Sequence[Motion]],
) -> dict[str, Any]:
    """Returns mean distances to the nearest stretch of training; labels weigh alike."""

    def mean(
        motions: Sequence[Motion], *, other_subjects: bool = False
    ) -> float | None:
        distances = nearest_distances(motions, train, other_subjects=other_subjects)
        known = np.isfinite(distances)
        if not known.any():
            return None
        labels = np.array([m.label.index for m in motions])[known]
        return float(distances[known] @ label_weights(labels))

    return {
        "nearest_training_rad": mean([motion for each in sets for motion in each]),
        "nearest_training_rad_validation": mean(cut_validation),
        "nearest_training_rad_leave_one_out": mean(cut_train, other_subjects=True),
    }


def _drift(
    robot: Robot, long: dict[str, list[Motion]], recorded: Recorded
) -> dict[str, Any]:
    drifts = {
        label: drifting.drift(robot, motions)
        for label, motions in long.items()
        if len(motions) > 1
    }
    worst = drifting.worst(drifts)
    beyond = {
        label: drifting.beyond_recorded(long[label], real)
        for label in drifts
        if (real := [motion for motion in recorded.of(label) if len(motion) >= FRAMES])
    }
    return {
        "drift_60s": None if worst is None else worst["drift"],
        "drift": {"worst": worst, "labels": drifts, "beyond_recorded": beyond},
    }


def _by_label(robot: Robot, recorded: Recorded, generated: Generated) -> dict[str, Any]:
    """Returns the figures of each label, of all and of labels beyond the fifteen."""
    motions = by_label(motion for each in generated.sets for motion in each)
    measured = {name: measure(robot, own) for name, own in motions.items()}
    figures = {}
    for name, own in measured.items():
        stretches = recorded.of(name)
        real = measure(robot, cut(stretches) or stretches) if stretches else None
        figures[name] = compare(own, real)
    known = {name: figures[name] for name in labels_of(figures)}
    return {
        "labels": known,
        "all": overall(known, [measured[name] for name in known]),
        "other": {name: own for name, own in figures.items() if name not in known},
    }
