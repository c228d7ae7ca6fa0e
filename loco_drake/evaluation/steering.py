"""How well a simulated robot follows velocity commands: the definitions.

All velocities are those of the base in its heading frame: forward and sideways in m/s,
yaw rate in rad/s. They are differences of poses on the ground, averaged over one stride
of the simulated robot, centred at each sample.

================== ====================================================================
velocity_rmse_mps  root of the mean square distance of the horizontal velocity from the
                   command, over all samples of all points
yaw_rate_rmse      the same of the yaw rate, rad/s
latency_reference  from the change of the command to the first sample of the plan that
                   differs, s; the largest of all steps
latency_robot      from the change of the command until the velocity has covered 90 %
                   of the step, s; the median of all steps
================== ====================================================================
"""

from collections.abc import Sequence

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.rotations import quat_rotate, yaw_of
from loco_drake.control.ground_path import ground_pose, path_velocity
from loco_drake.control.plan import PLAN_DT, Plan, first_change
from loco_drake.control.state import JOINTS, ORIENTATION, POSITION, split
from loco_drake.models.robots import Robot
from loco_drake.motion.gait_timing import Track, stride_period
from loco_drake.motion.motion import FPS

# Of a gait whose period cannot be told, s.
_DEFAULT_STRIDE = 0.5
_COVERED = 0.9  # of a step


def stride_velocity(robot: Robot, state: Array) -> Array:
    """Returns the base's velocity averaged over one stride, shape (N, 3).

    At the ends, where a stride is not complete, the average is over what there is.

    Args:
        robot: the robot.
        state: [q, v] or q at each sample, shape (N, ...), N at least 2.
    """
    q = state[:, : 7 + len(robot.joint_names)]
    stride = stride_of(robot, q)
    length = min(max(1, round(stride / PLAN_DT)), len(q) - 1)
    # Sample k lies between steps k - 1 and k.
    steps = path_velocity(ground_pose(q))
    total = np.concatenate((np.zeros((1, 3)), np.cumsum(steps, axis=0)))
    k = np.arange(len(q))
    first = np.maximum(k - length // 2, 0)
    last = np.minimum(first + length, len(steps))
    first = np.maximum(last - length, 0)
    mean: Array = (total[last] - total[first]) / (last - first)[:, None]
    return mean


def stride_of(robot: Robot, q: Array) -> float:
    """Returns the stride period of a motion (N, 19) in s, or a default without one."""
    p_BF_W = quat_rotate(q[ORIENTATION][:, None], robot.toe_positions(q[JOINTS]))
    soles = q[POSITION][:, None] + p_BF_W - [0.0, 0.0, robot.foot_radius]
    track = Track(
        fps=FPS,
        trunk=q[POSITION][:, :2],
        yaw=yaw_of(q[ORIENTATION]),
        soles=soles,
        stance_height=robot.stand_height,
    )
    return stride_period(track) or _DEFAULT_STRIDE


def rmse(errors: Sequence[Array]) -> tuple[float, float] | tuple[None, None]:
    """Returns velocity_rmse_mps and yaw_rate_rmse of errors (N, 3) of many points.

    They are None without any sample.
    """
    all_errors = np.concatenate(errors)
    if not len(all_errors):
        return None, None
    squares = np.mean(all_errors**2, axis=0)
    return float(np.sqrt(squares[:2].sum())), float(np.sqrt(squares[2]))


def robot_latency(
    velocity: Array, before: Array, after: Array, changed: int
) -> float | None:
    """Returns latency_robot of one step in s, or None if it is never covered.

    Args:
        velocity: averaged over a stride, shape (N, 3).
        before: the command before the step, shape (3,).
        after: the command after it, shape (3,).
        changed: the sample at which the command changes.
    """
    step = after - before
    covered = (velocity[changed:] - before) @ step / (step @ step)
    if not (covered >= _COVERED).any():
        return None
    return float(np.argmax(covered >= _COVERED)) * PLAN_DT


def reference_latency(plans: Sequence[Plan], changed: int) -> float | None:
    """Returns latency_reference of one step in s, or None if no plan changes.

    Args:
        plans: the plan in use at each sample of a simulation.
        changed: the sample at which the command changes.
    """
    for old, new in zip(plans[changed:], plans[changed + 1 :], strict=False):
        if new is old:
            continue
        path_time = first_change(old, new)
        k = int(np.searchsorted(new.path_time, path_time))
        due = new.start_time + k * PLAN_DT
        if due <= old.end_time + PLAN_DT / 2:
            return float(due - changed * PLAN_DT)
    return None


def distance_from_plan(state: Array, plan_state: Array) -> float:
    """Returns the largest horizontal distance of the base from its plan, m."""
    own, plan = (split(s)[0][POSITION][:, :2] for s in (state, plan_state))
    return float(np.linalg.norm(own - plan, axis=1).max())
