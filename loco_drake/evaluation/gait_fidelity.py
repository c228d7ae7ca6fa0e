"""How well a robot keeps the rhythm of the animal that it moves like.

Both rhythms are those of :mod:`loco_drake.motion.gait_timing`: that of the animal from
its keypoints, that of the robot from its kinematics, neither from contact labels.
"""

from dataclasses import dataclass

import numpy as np

from loco_drake.motion.gait_timing import GaitTiming, Track, gait_timing

# The animal decides whether there are enough strides: a robot's motion can end a frame
# before its clip, and a slower robot makes fewer strides.
_ROBOT_STRIDES = 2


@dataclass(frozen=True)
class GaitFidelity:
    """Errors of a robot's rhythm; 0 is perfect.

    Attributes:
        stride_period_error: ``|T_robot / T_source - 1|``.
        phase_lag_error: the largest error of the lag of one toe behind another, over
            the six pairs of toes; a share of the stride, around the circle, so at most
            .5. So no toe has a special part, and one wrong toe is one error.
        duty_factor_error: mean over the toes of the absolute error.
    """

    stride_period_error: float
    phase_lag_error: float
    duty_factor_error: float


# Of a robot that has no rhythm, or fewer than two strides, where the animal has three.
NO_RHYTHM = GaitFidelity(
    stride_period_error=1.0, phase_lag_error=0.5, duty_factor_error=1.0
)


def gait_fidelity(source: Track, robot: Track) -> GaitFidelity | None:
    """Returns how far the robot's rhythm is off.

    Args:
        source: of the animal.
        robot: of the motion made of it.

    Returns:
        None if the animal makes fewer than three strides; :data:`NO_RHYTHM` if the
        robot then makes fewer than two.
    """
    own = gait_timing(source)
    if own is None:
        return None
    made = gait_timing(robot, _ROBOT_STRIDES)
    return NO_RHYTHM if made is None else timing_errors(own, made)


def timing_errors(source: GaitTiming, robot: GaitTiming) -> GaitFidelity:
    """Returns how far the timing of a robot is off that of an animal."""
    late = robot.phase_lags - source.phase_lags
    between = (late[:, None] - late + 0.5) % 1.0 - 0.5
    duty = np.abs(robot.duty_factors - source.duty_factors)
    return GaitFidelity(
        stride_period_error=abs(robot.stride_period / source.stride_period - 1),
        phase_lag_error=float(np.abs(between).max()),
        duty_factor_error=float(duty.mean()),
    )
