"""Steering: a plan whose ground path is bent until the base moves as commanded.

The base keeps its height, its roll and pitch and its swaying within a stride; its mean
velocity becomes the commanded one. Feet that stand stay where they are, see
:mod:`.footholds`. The legs follow in closed form.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from loco_drake.common.arrays import Array, Integers
from loco_drake.common.gravity import GRAVITY
from loco_drake.common.immutable import Immutable
from loco_drake.common.rotations import (
    angular_velocity,
    quat_conjugate,
    quat_continuous,
    quat_multiply,
    quat_rotate,
    rotate_plane,
    yaw_quat,
)
from loco_drake.control.command import ANY_COMMAND, CommandRange, check_finite
from loco_drake.control.footholds import Bend, toe_offsets
from loco_drake.control.ground_path import (
    filtered,
    ground_pose,
    integrate,
    pace,
    path_velocity,
)
from loco_drake.control.plan import PLAN_DT, Plan, make_plan
from loco_drake.control.state import JOINTS, ORIENTATION, POSITION
from loco_drake.models.robots import Robot

# By how much toes that stand, and any below the ground, may miss their place, m.
_REACH_TOLERANCE = 2e-3
# The same of toes that swing: a leg that is folded as far as it goes does no harm.
_SWING_TOLERANCE = 20e-3
# Highest rate of the filtered command along each axis, m/s^2; yaw has no limit. A robot
# in a bound kept up with 3 m/s^2, but not with the 4.8 m/s^2 of a step of 2 m/s.
_STEEPEST = np.array([3.0, 3.0, np.inf])
# Shares of a command that are tried until legs and joints can follow it.
_SHARES = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0)


@dataclass(frozen=True, eq=False)
class Steered(Immutable):
    """A steered plan and what is needed to steer it on.

    The arrays have one row for each sample of the plan.
    """

    raw: Plan  # the plan before steering
    plan: Plan  # the plan after steering, on the same clock
    # The command of the last gait as far as it is followed, on the plan's clock, (3,).
    command: Array
    speed: Array  # filtered command, m/s and rad/s, shape (N, 3)
    rate: Array  # time derivative of ``speed``, shape (N, 3)
    pose: Array  # of the base on the ground, x, y, yaw, shape (N, 3)
    # From where each toe would be if it moved with the base to where it is, m in W,
    # shape (N, 4, 2).
    offset: Array


def begin(raw: Plan) -> Steered:
    """Returns ``raw`` not steered yet: the command is the pace that it has."""
    pose = ground_pose(raw.q)
    speed = pace(path_velocity(pose))
    offset = np.zeros((len(raw), 4, 2))
    return Steered(raw, raw, speed[-1], speed, np.zeros_like(speed), pose, offset)


def steer(
    robot: Robot,
    before: Steered,
    raw: Plan,
    command: Array,
    fixed: float,
    response: float,
    ranges: Mapping[int, CommandRange] | None = None,
    clock_rate: float = 1.0,
) -> Steered:
    """Returns ``raw`` steered by a command, continuing ``before``.

    Each gait gets the command in its range that is nearest. If legs would still have to
    reach or move farther than they can, they get the largest share of the change from
    the motion's own pace that they can follow.

    Args:
        robot: the robot.
        before: the steered plan so far.
        raw: the plan to steer, equal to ``before.raw`` up to ``fixed``.
        command: forward and sideways velocity in m/s and yaw rate in rad/s, in the
            heading frame, shape (3,).
        fixed: plan time up to which the plan must not change, s.
        response: time in which 90 % of a step of the command is covered, s.
        ranges: range of commands of each gait, by its row of gaits.ONE_HOT.
        clock_rate: seconds of the plan that are played per second, above 0.

    Raises:
        InputError: if a number of the command is not finite.
    """
    check_finite(command)
    drop = round((raw.path_time[0] - before.raw.path_time[0]) / PLAN_DT)
    before = _tail(before, drop)
    last = int(np.ceil((fixed - raw.path_time[0]) / PLAN_DT - 1e-6))
    last = min(max(last, 0), len(before.plan) - 1, len(raw) - 1)
    raw_pose = ground_pose(raw.q)
    natural = pace(path_velocity(raw_pose))
    now = natural[last:].mean(axis=0)
    wanted = {
        label: (ranges or {}).get(label, ANY_COMMAND).clip(command) / clock_rate
        for label in np.unique(raw.labels[last:]).tolist()
    }
    best: tuple[float, Steered] | None = None
    for share in _SHARES:
        targets = {k: c - (1 - share) * (c - now) for k, c in wanted.items()}
        bent, excess = _bend(
            robot, before, raw, raw_pose, natural, targets, last, response
        )
        if best is None or excess < best[0]:
            best = excess, bent
        if excess <= 0:
            break
    assert best is not None
    return best[1]


def _tail(steered: Steered, first: int) -> Steered:
    """Returns the samples from ``first`` on."""
    if first <= 0:
        return steered
    rows = {
        name: getattr(steered, name)[first:]
        for name in ("speed", "rate", "pose", "offset")
    }
    return replace(
        steered, raw=steered.raw.slice(first), plan=steered.plan.slice(first), **rows
    )


def _bend(
    robot: Robot,
    before: Steered,
    raw: Plan,
    raw_pose: Array,
    natural: Array,
    targets: Mapping[int, Array],
    last: int,
    response: float,
) -> tuple[Steered, float]:
    """Returns ``raw`` bent after sample ``last``, and by how much legs fall short.

    ``targets`` are the commands of the gaits. The shortfall is positive if a toe misses
    its place by more than the tolerance or a joint is faster than its limit; the unit
    is that of these limits.
    """
    speed, rate = before.speed[: last + 1], before.rate[: last + 1]
    for label, count in _runs(raw.labels[last + 1 :]):
        more = filtered(targets[label], speed[-1], rate[-1], response, count, _STEEPEST)
        speed, rate = (
            np.concatenate(ab) for ab in zip((speed, rate), more, strict=True)
        )
    change = (speed - natural)[last:]
    velocity = path_velocity(raw_pose[last:]) + (change[:-1] + change[1:]) / 2
    pose = np.concatenate(
        (before.pose[: last + 1], integrate(before.pose[last], velocity))
    )
    lean = _lean(robot, speed, natural, pose[:, 2])
    bend = Bend(raw, raw_pose, pose, lean, last)
    carried = bend.carried()
    offset = toe_offsets(bend, carried, before.offset)
    p_WF = raw.p_WF.copy()
    p_WF[..., :2] = carried + offset
    q = raw.q.copy()
    q[ORIENTATION] = quat_multiply(yaw_quat(bend.turn), raw.q[ORIENTATION])
    q[POSITION][:, :2] = pose[:, :2]
    p_BF = quat_rotate(
        quat_conjugate(q[ORIENTATION])[:, None], p_WF - q[POSITION][:, None]
    )
    q[JOINTS] = robot.nearest_joints(p_BF)
    q[: last + 1] = before.plan.q[: last + 1]
    q[ORIENTATION] = quat_continuous(q[ORIENTATION])
    v = np.concatenate(
        (
            angular_velocity(q[ORIENTATION], PLAN_DT),
            np.gradient(q[:, 4:], PLAN_DT, axis=0),
        ),
        axis=1,
    )
    v[: last + 1] = before.plan.v[: last + 1]
    plan = make_plan(
        robot,
        q=q,
        v=v,
        contacts=raw.contacts,
        labels=raw.labels,
        start_time=raw.start_time,
        path_time=raw.path_time,
        open_ended=raw.open_ended,
    )
    missed = np.abs(plan.p_WF - p_WF)[last + 1 :].max(axis=-1)
    tolerated = np.where(raw.contacts, _REACH_TOLERANCE, _SWING_TOLERANCE)[last + 1 :]
    sunk = np.minimum(p_WF[..., 2], robot.foot_radius) - plan.p_WF[..., 2]
    # The smoother slows what is too fast already.
    fast, raw_fast = (
        np.abs(each.v[last + 1 :, 6:] / robot.joint_speed_limits).max(initial=0.0)
        for each in (plan, raw)
    )
    excess = max(
        (missed / tolerated).max(initial=0.0) - 1,
        sunk[last + 1 :].max(initial=0.0) / _REACH_TOLERANCE - 1,
        fast - max(raw_fast, 1.0),
    )
    command = targets[int(raw.labels[-1])]
    return Steered(raw, plan, command, speed, rate, pose, offset), excess


def _runs(labels: Integers) -> Iterator[tuple[int, int]]:
    """Yields each label and how often it follows itself."""
    for label, same in groupby(labels.tolist()):
        yield label, len(list(same))


def _lean(robot: Robot, speed: Array, natural: Array, yaw: Array) -> Array:
    """Returns by how much the feet are displaced in a turn, m in W, shape (N, 2).

    An inverted pendulum that is to accelerate stands beside its foot, by the
    acceleration times height over gravity. That of the turn alone counts: a change of
    speed is over before the feet have followed.
    """
    centripetal = speed[:, 2] * speed[:, 0] - natural[:, 2] * natural[:, 0]
    along = -speed[:, 2] * speed[:, 1] + natural[:, 2] * natural[:, 1]
    inward = np.stack((along, centripetal), axis=-1)
    return rotate_plane(-robot.stand_height / GRAVITY * inward, yaw)
