"""Trajectories of 2 s as feature vectors that are independent of position and heading.

All comparisons of recorded with generated motion use them. They are computed from base
and joints; contact labels, which a generator also produces, are excluded.

============ ==========================================================================
channels     those of :mod:`loco_drake.generation.features` up to the joints: velocity
             of the base in its heading frame, yaw rate, height, roll, pitch, twelve
             joint angles
summary      mean and standard deviation of each channel over time, root mean squares of
             its first and second differences, and the correlations of the six pairs of
             thigh angles, which distinguish a pace from a trot; rounded to RESOLUTION,
             since a roll of exactly zero does not differ from one of 1e-5 rad
mirror image left and right are chance in recordings, and generators are trained with
             mirror images, so each trajectory and its mirror image count one half
============ ==========================================================================
"""

from collections import Counter
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.arrays import Array, Bools, Integers
from loco_drake.generation.features import (
    CONTACTS,
    JOINTS,
    VELOCITY,
    YAW_RATE,
    motion_features,
)
from loco_drake.models.robots import Robot
from loco_drake.motion.gaits import LABELS
from loco_drake.motion.motion import FPS, Motion
from loco_drake.retargeting.trajectories import trajectories

SECONDS = 2.0  # the paper's length of a trajectory
FRAMES = round(SECONDS * FPS)
CHANNELS = CONTACTS.start
_THIGHS = slice(JOINTS.start + 1, JOINTS.stop, 3)
_PAIRS = np.triu_indices(4, k=1)
# Where each part of a summary lies.
SUMMARY = {
    "mean": slice(0, CHANNELS),
    "spread": slice(CHANNELS, 2 * CHANNELS),
    "change": slice(2 * CHANNELS, 3 * CHANNELS),
    "change of change": slice(3 * CHANNELS, 4 * CHANNELS),
    "correlation": slice(4 * CHANNELS, 4 * CHANNELS + len(_PAIRS[0])),
}
SUMMARY_SIZE = SUMMARY["correlation"].stop
# In the units of the channels: .3 mm/s, .001 rad/s, .03 mm, .0001 rad.
RESOLUTION = np.full(SUMMARY_SIZE, 1e-4)
for _part in list(SUMMARY.values())[:4]:
    RESOLUTION[_part][VELOCITY] = RESOLUTION[_part][YAW_RATE] = 1e-3
RESOLUTION[SUMMARY["correlation"]] = 1e-3


@dataclass(frozen=True, eq=False)
class Samples:
    """Trajectories of FRAMES frames, each with its mirror image."""

    channels: Array  # shape (N, 2, FRAMES, CHANNELS); mirror images come second
    summaries: Array  # shape (N, 2, SUMMARY_SIZE)
    labels: Integers  # index into gaits.LABELS, shape (N,)
    # Who or what was recorded, see subject_of, shape (N,); trajectories of one subject
    # are not independent.
    subjects: NDArray[np.str_]

    def __len__(self) -> int:
        return len(self.labels)

    def __getitem__(self, index: Integers | Bools) -> "Samples":
        """Returns those that a mask or indices choose."""
        return Samples(*(column[index] for column in vars(self).values()))

    @property
    def rows(self) -> Array:
        """Summaries of trajectories, each before its mirror image, shape (2 N, ...)."""
        return self.summaries.reshape(2 * len(self), -1)


def make_samples(robot: Robot, motions: Sequence[Motion]) -> Samples:
    """Returns the first FRAMES frames of motions of the fifteen labels as samples.

    Motions without a subject in their provenance are subjects of their own.
    """
    channels = np.empty((len(motions), 2, FRAMES, CHANNELS))
    for i, motion in enumerate(motions):
        for side, variant in enumerate((motion, motion.mirrored())):
            features = motion_features(robot, variant.slice(0, FRAMES))
            channels[i, side] = features[:, :CHANNELS]
    return Samples(
        channels=channels,
        summaries=summarize(channels),
        labels=np.array([m.label.index for m in motions], dtype=np.int64),
        subjects=np.array(
            [subject_of(m) or f"motion {i}" for i, m in enumerate(motions)],
            dtype=np.str_,
        ),
    )


def subject_of(motion: Motion) -> str | None:
    """Returns the animal that a motion says was recorded, else the recording."""
    named = (motion.provenance.get(key) for key in ("animal", "recording", "file"))
    name = next(filter(None, named), None)
    return f"{motion.source}-{name}" if name else None


def cut(motions: Iterable[Motion]) -> list[Motion]:
    """Returns all trajectories of motions, in their order."""
    return [part for motion in motions for part in trajectories(motion)]


def labels_of(*sides: Container[str]) -> tuple[str, ...]:
    """Returns those of the fifteen labels that all sides have, in order."""
    return tuple(k for k in map(str, LABELS) if all(k in side for side in sides))


def by_label(motions: Iterable[Motion]) -> dict[str, list[Motion]]:
    """Returns the motions of each label, in their order."""
    found: dict[str, list[Motion]] = {}
    for motion in motions:
        found.setdefault(str(motion.label), []).append(motion)
    return found


def join(parts: Sequence[Samples]) -> Samples:
    """Returns all samples of ``parts``, in their order."""
    columns = zip(*(vars(part).values() for part in parts), strict=True)
    return Samples(*map(np.concatenate, columns))


def summarize(channels: Array) -> Array:
    """Returns summaries (..., SUMMARY_SIZE) of channels (..., T, CHANNELS)."""
    change = np.diff(channels, axis=-2)
    turn = np.diff(change, axis=-2)
    thighs = channels[..., _THIGHS]
    thighs = thighs - thighs.mean(axis=-2, keepdims=True)
    thighs /= np.maximum(thighs.std(axis=-2, keepdims=True), 1e-3)
    correlation = np.einsum("...ti,...tj->...ij", thighs, thighs) / channels.shape[-2]
    summary = np.concatenate(
        (
            channels.mean(axis=-2),
            channels.std(axis=-2),
            np.sqrt((change**2).mean(axis=-2)),
            np.sqrt((turn**2).mean(axis=-2)),
            correlation[..., _PAIRS[0], _PAIRS[1]],
        ),
        axis=-1,
    )
    rounded: Array = np.round(summary / RESOLUTION) * RESOLUTION
    return rounded


def label_weights(labels: Integers) -> Array:
    """Returns a weight for each sample, shape (N,), summing to 1.

    All labels weigh the same, however many samples each has; so do the samples of a
    label.
    """
    present, place, count = np.unique(labels, return_inverse=True, return_counts=True)
    weights: Array = 1.0 / (len(present) * count[place])
    return weights


def choose_per_label(
    samples: Samples, counts: Counter[int], random: np.random.Generator
) -> Samples:
    """Returns at most ``counts[label]`` samples of each label, drawn at random."""
    chosen = [
        random.permutation(np.flatnonzero(samples.labels == label))[: counts[label]]
        for label in np.unique(samples.labels).tolist()
    ]
    return samples[np.sort(np.concatenate(chosen))]


def count_per_label(samples: Samples) -> Counter[int]:
    """Returns how many samples there are of each label."""
    return Counter(samples.labels.tolist())
