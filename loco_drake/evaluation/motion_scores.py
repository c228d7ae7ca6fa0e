"""How generated motion of a gait compares, figure by figure, with recorded motion.

======================== ==============================================================
stance_slip_median_mps   median speed of all toes in stance, pooled over all motions;
                         see :func:`loco_drake.motion.quality.stance_slip_speeds`
penetration_max_m        deepest below the ground of any toe of any motion
jerk_ratio               RMS of the joints' jerk, over that of recorded motion
speed_error_mps          ``|mean speed - mean speed of recorded motion|``
speed_distance_mps       how far speeds would have to be moved, on average, to be spread
                         like those of recorded motion (Wasserstein distance)
======================== ==============================================================

Jerk is the third difference of joint angles times FPS cubed, RMS over frames, joints
and motions. Speed is the mean over a trajectory of the base's velocity along its
heading. Of recorded motion all subjects count, those of validation too. For all
labels together: the median of the pooled speeds, the deepest, the geometric mean of
the jerk ratios, the means of the two speed figures over labels.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import gmean, wasserstein_distance

from loco_drake.common.arrays import Array
from loco_drake.generation.features import VELOCITY, motion_features
from loco_drake.models.robots import Robot
from loco_drake.motion.motion import Motion
from loco_drake.motion.quality import (
    penetration_max,
    stance_slip_speeds,
    toe_trajectories,
)

# Of a label without generated motion.
NULL_FIGURES: dict[str, Any] = dict.fromkeys(
    ("stance_slip_median_mps", "penetration_max_m", "jerk_ratio", "speed_error_mps")
)


@dataclass(frozen=True, eq=False)
class Measured:
    """What several motions of a label measure."""

    slip_speeds: Array  # of each step of each toe in stance, m/s, shape (N,)
    penetration: float  # deepest below the ground, m
    # RMS of the joints' jerk, rad/s^3; None if all motions are too short.
    jerk: float | None
    speeds: Array  # mean speed of each motion along its heading, m/s, shape (M,)


def measure(robot: Robot, motions: Sequence[Motion]) -> Measured:
    """Returns the figures of one or more motions of one robot."""
    slips, depths = [], []
    for motion in motions:
        p_WF = toe_trajectories(motion, robot)
        slips.append(stance_slip_speeds(p_WF, robot.foot_radius, motion.fps))
        depths.append(penetration_max(p_WF, robot.foot_radius))
    return Measured(
        slip_speeds=np.concatenate(slips),
        penetration=max(depths),
        jerk=joint_jerk(motions),
        speeds=np.array([mean_speed(robot, motion) for motion in motions]),
    )


def joint_jerk(motions: Sequence[Motion]) -> float | None:
    """Returns the RMS of the joints' jerk in rad/s^3, None without four frames."""
    jerks = [np.diff(m.joint_positions, n=3, axis=0) * m.fps**3 for m in motions]
    squares = np.concatenate([jerk.ravel() ** 2 for jerk in jerks])
    return float(np.sqrt(squares.mean())) if len(squares) else None


def mean_speed(robot: Robot, motion: Motion) -> float:
    """Returns the mean velocity of the base along its heading, m/s."""
    along = motion_features(robot, motion)[1:, VELOCITY][:, 0]
    return float(along.mean()) * robot.stand_height


def compare(generated: Measured, recorded: Measured | None) -> dict[str, Any]:
    """Returns the figures of a label; those that need recordings may be None."""
    figures = {**NULL_FIGURES, "speed_distance_mps": None, **_of_one_side(generated)}
    if recorded is None:
        return {**figures, "reason": "There are no recordings of this label."}
    if generated.jerk is not None and recorded.jerk:
        figures["jerk_ratio"] = generated.jerk / recorded.jerk
    apart = generated.speeds.mean() - recorded.speeds.mean()
    figures["speed_error_mps"] = abs(float(apart))
    figures["speed_distance_mps"] = float(
        wasserstein_distance(generated.speeds, recorded.speeds)
    )
    return {**figures, "recorded": _of_one_side(recorded)}


def _of_one_side(measured: Measured) -> dict[str, Any]:
    return {
        "stance_slip_median_mps": median(measured.slip_speeds),
        "penetration_max_m": measured.penetration,
        "speed_mps": float(measured.speeds.mean()),
    }


def median(values: Array) -> float | None:
    """Returns the median; None of no values."""
    return float(np.median(values)) if len(values) else None


def overall(
    labels: Mapping[str, dict[str, Any]], measured: Sequence[Measured]
) -> dict[str, Any]:
    """Returns the figures of all labels together.

    They are made of those of each label, from :func:`compare`, and of what its
    generated motion measures.
    """
    slips = np.concatenate([np.empty(0), *(m.slip_speeds for m in measured)])

    def average(key: str, mean: Callable[[list[float]], Any] = np.mean) -> float | None:
        values = [f[key] for f in labels.values() if f.get(key) is not None]
        return float(mean(values)) if values else None

    return {
        "stance_slip_median_mps": median(slips),
        "penetration_max_m": max((m.penetration for m in measured), default=None),
        "jerk_ratio": average("jerk_ratio", gmean),
        "speed_error_mps": average("speed_error_mps"),
        "speed_distance_mps": average("speed_distance_mps"),
    }
