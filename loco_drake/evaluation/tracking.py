"""How well a robot followed its plan: one definition for each number.

All are computed from what was simulated: states and plan states sampled every PLAN_DT,
the first at time 0, and the reward's terms. Where a robot falls the samples end.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.rotations import (
    quat_error,
    quat_multiply,
    quat_rotate,
    yaw_of,
    yaw_quat,
)
from loco_drake.control.action import GRAVITY
from loco_drake.control.plan import PLAN_DT
from loco_drake.control.state import (
    HEIGHT,
    JOINT_VELOCITIES,
    JOINTS,
    ORIENTATION,
    POSITION,
    VELOCITY,
    split,
)
from loco_drake.models.robots import Robot
from loco_drake.motion.motion import FPS
from loco_drake.motion.quality import stance_slip_speeds

Array = NDArray[np.float64]

# Base errors are re-aligned with the plan this often: they then tell how well the robot
# moves, not how far a small error of heading carries it off in the end.
WINDOW = 2.0  # s


@dataclass(frozen=True)
class Rollout:
    """What a simulation left.

    Attributes:
        state: the plant's [q, v] at each sample, shape (N + 1, 37).
        plan_state: the same of the plan.
        path_time: seconds of unsmoothed motion that have passed, shape (N + 1,).
        desired_joints: set-points of the PD in rad, shape (N + 1, 12).
        reward: of each sample, shape (N + 1,); that of the first is not counted.
        steps: how many steps were to be made; more than N if the robot fell.
        fell: whether it did.
    """

    state: Array
    plan_state: Array
    path_time: Array
    desired_joints: Array
    reward: Array
    steps: int
    fell: bool


def tracking_metrics(rollout: Rollout) -> dict[str, float]:
    """Returns how well the plan was followed, all figures by name."""
    position, orientation = base_errors(rollout)
    return {
        "normalized_return": normalized_return(rollout),
        "joint_rmse_rad": joint_rmse(rollout),
        "base_position_rmse_m": position,
        "base_orientation_rmse_rad": orientation,
        "stretch": stretch(rollout),
        "speed_mps": speed(rollout),
    }


def normalized_return(rollout: Rollout) -> float:
    """Reward summed over all steps that were to be made, over its maximum, times 100.

    The maximum is 1 a step. Steps lost to a fall count, with a reward of 0.
    """
    return 100 * float(rollout.reward[1:].sum()) / rollout.steps


def joint_rmse(rollout: Rollout) -> float:
    """Root mean square over samples and joints of the angle from the plan, rad."""
    q, _ = split(rollout.state - rollout.plan_state)
    error = q[JOINTS]
    return float(np.sqrt(np.mean(error**2)))


def base_errors(rollout: Rollout) -> tuple[float, float]:
    """Root mean squares of the base's distance (m) and angle (rad) from the plan.

    At the start of each 2 s window the plan is moved in x and y and turned about z so
    that its base is where the robot's is; height, roll and pitch are never aligned.
    The distance is Euclidean, the angle that of the rotation between the two; the mean
    is over all samples.
    """
    samples = round(WINDOW / PLAN_DT)
    squares = []
    for first in range(0, len(rollout.state), samples):
        own = rollout.state[first : first + samples]
        plan = rollout.plan_state[first : first + samples]
        q_own, q_plan = own[ORIENTATION], plan[ORIENTATION]
        turn = yaw_quat(yaw_of(q_own[0]) - yaw_of(q_plan[0]))
        p_plan = quat_rotate(turn, (plan - plan[0])[POSITION])
        p_plan[:, 2] = plan[:, HEIGHT]
        p_own = (own - own[0])[POSITION]
        p_own[:, 2] = own[:, HEIGHT]
        rotation = quat_error(q_own, quat_multiply(turn[None], q_plan))
        squares.append(
            np.stack(
                (((p_own - p_plan) ** 2).sum(axis=1), (rotation**2).sum(axis=1)), axis=1
            )
        )
    means = np.concatenate(squares).mean(axis=0)
    return float(np.sqrt(means[0])), float(np.sqrt(means[1]))


def stretch(rollout: Rollout) -> float:
    """Duration of the plan as it was played over its duration as it was written."""
    played = (len(rollout.path_time) - 1) * PLAN_DT
    written = float(rollout.path_time[-1] - rollout.path_time[0])
    return played / written if written > 0 else 1.0


def speed(rollout: Rollout) -> float:
    """Mean over samples of the base's velocity along its own heading, m/s."""
    q, v = split(rollout.state)
    yaw, v = yaw_of(q[ORIENTATION]), v[VELOCITY]
    return float(np.mean(v[:, 0] * np.cos(yaw) + v[:, 1] * np.sin(yaw)))


def slip_speeds(rollout: Rollout, robot: Robot) -> Array:
    """Horizontal speeds of the simulated toes in stance, m/s, shape (M,).

    See :func:`loco_drake.motion.quality.stance_slip_speeds`.
    """
    q, _ = split(rollout.state)
    p_BF_W = quat_rotate(q[ORIENTATION][:, None], robot.toe_positions(q[JOINTS]))
    p_WF = q[POSITION][:, None] + p_BF_W
    return stance_slip_speeds(p_WF, robot.foot_radius, FPS)


def effort_metrics(rollout: Rollout, robot: Robot) -> dict[str, float]:
    """Returns what the actuators have to do, all figures by name.

    With the torque that the PD asks for, tau = kp (q_d - q) - kd v, cut at the effort
    limit:

    - torque_saturation: share of samples and joints at the effort limit
    - speed_saturation: share of samples and joints at the speed limit or beyond
    - cost_of_transport: mean of sum |tau v| over mass, gravity and mean horizontal
      speed; what braking returns is not counted as a gain
    """
    q, base_and_joints = split(rollout.state)
    v = base_and_joints[JOINT_VELOCITIES]
    asked = robot.kp * (rollout.desired_joints - q[JOINTS]) - robot.kd * v
    torque = np.clip(asked, -robot.effort_limits, robot.effort_limits)
    power = float(np.abs(torque * v).sum(axis=1).mean())
    speed = float(np.linalg.norm(base_and_joints[VELOCITY][:, :2], axis=1).mean())
    return {
        "torque_saturation": float(np.mean(np.abs(asked) >= robot.effort_limits)),
        "speed_saturation": float(np.mean(np.abs(v) >= robot.joint_speed_limits)),
        "cost_of_transport": power / (robot.mass * GRAVITY * max(speed, 1e-3)),
    }
