"""Many made motions of a gait, which differ as recordings of one gait do."""

from dataclasses import replace

import numpy as np

from loco_drake.motion.motion import Motion, make_motion
from tests.synthetic_motion import synthetic_motion


def varied_motions(
    label: str, count: int, seed: int = 0, seconds: float = 2.0, split: str = "train"
) -> list[Motion]:
    """Returns motions that differ in speed, turn, period and phase, one recording each.

    Recordings of another seed or split are others.
    """
    random = np.random.default_rng([seed, split == "train", *label.encode()])
    return [
        synthetic_motion(
            label,
            seconds,
            speed=random.uniform(0.6, 1.0),
            turn=random.uniform(-0.2, 0.2),
            period=random.uniform(0.45, 0.6),
            phase=random.uniform(),
            recording=f"{label} {split} {seed} {i}",
            split=split,
        )
        for i in range(count)
    ]


def shaken(motion: Motion, size: float, seed: int = 0) -> Motion:
    """Returns a motion with noise of ``size`` rad added to its joints."""
    noise = np.random.default_rng(seed).normal(size=motion.joint_positions.shape)
    return make_motion(
        robot=motion.robot,
        label=motion.label,
        joint_names=motion.joint_names,
        base_position=motion.base_position,
        base_quaternion=motion.base_quaternion,
        joint_positions=motion.joint_positions + size * noise,
        contacts=motion.contacts,
        provenance=motion.provenance,
    )


def as_generated(motion: Motion) -> Motion:
    """Returns a motion that does not say that it was recorded."""
    return replace(motion, provenance={})
