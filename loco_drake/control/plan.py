"""The immutable motion that all systems exchange."""

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from loco_drake.common.arrays import Array, Bools, Integers, read_only
from loco_drake.common.errors import InputError
from loco_drake.common.immutable import Immutable
from loco_drake.common.rotations import quat_conjugate, quat_rotate, yaw_of, yaw_quat
from loco_drake.control.state import JOINTS, ORIENTATION, POSITION, unit_base
from loco_drake.models.simulated import SimulatedRobot
from loco_drake.motion.gaits import ROW_LABELS
from loco_drake.motion.motion import FPS, Motion

PLAN_DT = 1.0 / FPS
# Update period in s of systems that output plans. As a power of two times PLAN_DT, it
# makes these events coincide exactly with control periods. With .1 s the two would be
# 6e-17 s apart at .3 s, and CENIC fails over a step that short.
UPDATE_PERIOD = 4 * PLAN_DT
_ARRAYS = ("q", "v", "vdot", "p_WF", "contacts", "labels", "path_time")
_MAX_NORM_ERROR = 1e-3  # of quaternions


@dataclass(frozen=True, eq=False)
class Plan(Immutable):
    """An immutable stretch of motion on its own clock, sampled every PLAN_DT.

    Sample k is due at Context time ``start_time + k * PLAN_DT``. ``q`` and ``v`` are in
    the order of the robot's MultibodyPlant: ``q = [R_WB as w x y z, p_WB, joints]`` and
    ``v = [w_WB_W, v_WB_W, joint velocities]``.

    A Plan owns its arrays, which are read-only, and is compared by identity.

    Raises:
        InputError: if an array has an invalid type, shape or value.
    """

    start_time: float  # Context time of the first sample, s
    q: Array  # positions, m and rad, shape (N, 7 + J)
    v: Array  # velocities, m/s and rad/s, shape (N, 6 + J)
    vdot: Array  # time derivatives of v, shape (N, 6 + J)
    p_WF: Array  # the robot's contact points in m, shape (N, 4, 3)
    contacts: Bools  # whether each should be on the ground, shape (N, 4)
    labels: Integers  # row of motion.gaits.ONE_HOT, shape (N,)
    # Time in the motion before smoothing, s, shape (N,); the smoother slows this clock
    # down where the robot could not keep up.
    path_time: Array
    open_ended: bool = False  # whether the producer will extend the plan

    def __post_init__(self) -> None:
        n, size = np.shape(self.q) if np.ndim(self.q) == 2 else (0, 0)
        rows = ((size,), (size - 1,), (size - 1,), (4, 3), (4,), (), ())
        types = {"contacts": np.bool_, "labels": np.int64}
        for name, row in zip(_ARRAYS, rows, strict=True):
            wanted = types.get(name, np.float64)
            given = np.asarray(getattr(self, name))
            if not np.can_cast(given.dtype, wanted, "same_kind"):
                raise InputError(
                    f"A plan's {name} must be of type {wanted.__name__}, "
                    f"not {given.dtype}."
                )
            if given.shape != (n, *row) or n < 1 or size < 8:
                raise InputError(
                    f"A plan's q must have the shape (N, 7 + J), N at least 1, and its "
                    f"{name} one that goes with that, not {given.shape}."
                )
            # A copy, since the caller may hold the array or a view of it.
            object.__setattr__(self, name, read_only(given.astype(wanted)))
        self._check_values()
        object.__setattr__(self, "q", read_only(unit_base(self.q)))

    def _check_values(self) -> None:
        """Raises InputError if an array has an invalid value."""
        finite = all(np.isfinite(getattr(self, name)).all() for name in _ARRAYS)
        if not (finite and np.isfinite(self.start_time)):
            raise InputError("A plan's numbers and start time must be finite.")
        norms = np.linalg.norm(self.q[ORIENTATION], axis=1)
        if np.abs(norms - 1).max() > _MAX_NORM_ERROR:
            raise InputError(
                "A plan's q must begin with unit quaternions w, x, y, z; one has the "
                f"length {norms[np.abs(norms - 1).argmax()]:.4g}."
            )
        if self.labels.min() < 0 or self.labels.max() >= len(ROW_LABELS):
            raise InputError(
                f"A plan's labels must be indices from 0 to {len(ROW_LABELS) - 1}."
            )
        if (np.diff(self.path_time) < 0).any():
            raise InputError("A plan's path_time must never decrease.")

    def __len__(self) -> int:
        return len(self.q)

    def __reduce__(self) -> tuple[Any, ...]:
        # Unpickled arrays would be writable.
        return Plan, tuple(getattr(self, field.name) for field in fields(self))

    @cached_property
    def state(self) -> Array:
        """[q, v], shape (N, 13 + 2 J)."""
        return read_only(np.hstack((self.q, self.v)))

    @cached_property
    def p_BoF_H(self) -> Array:
        """Toes relative to the base in its heading frame (z up), m, shape (N, 4, 3)."""
        q_HW = quat_conjugate(yaw_quat(yaw_of(self.q[ORIENTATION])))
        p_BoF_W = self.p_WF - self.q[POSITION][:, None]
        return read_only(quat_rotate(q_HW[:, None], p_BoF_W))

    @property
    def end_time(self) -> float:
        """Context time of the last sample, s."""
        return self.start_time + (len(self) - 1) * PLAN_DT

    def slice(self, first: int, end: int | None = None) -> "Plan":
        """Returns the samples from ``first`` on, up to ``end`` (exclusive)."""
        arrays: dict[str, Any] = {
            name: getattr(self, name)[first:end] for name in _ARRAYS
        }
        return replace(self, start_time=self.start_time + first * PLAN_DT, **arrays)

    def index(self, time: float) -> int:
        """Returns the index of the sample nearest to ``time``, clamped to the plan."""
        k = round((time - self.start_time) / PLAN_DT)
        return min(max(k, 0), len(self) - 1)


def make_plan(
    robot: SimulatedRobot,
    *,
    q: Array,
    v: Array,
    contacts: Bools,
    labels: Integers,
    start_time: float = 0.0,
    path_time: Array | None = None,
    open_ended: bool = False,
) -> Plan:
    """Returns a Plan; contact points follow from joints, accelerations from ``v``."""
    p_BF = robot.contact_points(q[JOINTS])
    p_WF = q[POSITION][:, None] + quat_rotate(q[ORIENTATION][:, None], p_BF)
    if path_time is None:
        path_time = PLAN_DT * np.arange(len(q), dtype=np.float64)
    vdot = np.gradient(v, axis=0) * FPS if len(v) > 1 else np.zeros_like(v)
    return Plan(start_time, q, v, vdot, p_WF, contacts, labels, path_time, open_ended)


def plan_from_motion(
    robot: SimulatedRobot, motion: Motion, start_time: float = 0.0
) -> Plan:
    """Returns ``motion`` as a Plan of ``robot``.

    Raises:
        InputError: if the motion is not at :data:`loco_drake.motion.motion.FPS`, is of
            another robot, or has other joints.
    """
    if motion.fps != FPS:
        raise InputError(
            f"The motion is at {motion.fps} frames/s, but plans are at {FPS}."
        )
    if motion.robot != robot.name:
        raise InputError(f"The motion is of {motion.robot}, not of {robot.name}.")
    if motion.joint_names != robot.joint_names:
        raise InputError(
            f"The joints of the motion are not those of {robot.name}: "
            f"{', '.join(robot.joint_names)}."
        )
    q = (motion.base_quaternion, motion.base_position, motion.joint_positions)
    v = (motion.base_angular_velocity, motion.base_velocity, motion.joint_velocities)
    return make_plan(
        robot,
        q=np.hstack(q),
        v=np.hstack(v),
        contacts=motion.contacts,
        labels=motion.label_indices,
        start_time=start_time,
    )


def join_plans(first: Plan, second: Plan) -> Plan:
    """Returns one plan; ``second`` must start one sample after ``first`` ends."""
    arrays: dict[str, Any] = {
        name: np.concatenate((getattr(first, name), getattr(second, name)))
        for name in _ARRAYS
    }
    return replace(second, start_time=first.start_time, **arrays)


def first_change(before: Plan, after: Plan) -> float:
    """Returns the plan time of the first sample of ``after`` that is not in ``before``.

    Of an extended plan this is the first new sample, and of the same plan the time
    after its end. Samples that ``after`` has dropped don't count.
    """
    time = float(after.path_time[0])
    k = int(np.searchsorted(before.path_time, time))
    n = min(len(before) - k, len(after))
    same = (
        (before.path_time[k : k + n] == after.path_time[:n])
        & (before.q[k : k + n] == after.q[:n]).all(axis=1)
        & (before.labels[k : k + n] == after.labels[:n])
    )
    count = n if same.all() else int(same.argmin())
    if count < len(after):
        return float(after.path_time[count])
    return float(after.path_time[-1]) + PLAN_DT


def standing_plan(robot: SimulatedRobot, start_time: float = 0.0) -> Plan:
    """Returns a plan to stand still, the default value of ports."""
    q = np.concatenate(([1, 0, 0, 0, 0, 0, robot.stand_height], robot.stand_joints))
    return make_plan(
        robot,
        q=q[None],
        v=np.zeros((1, len(q) - 1)),
        contacts=np.ones((1, 4), dtype=bool),
        labels=np.zeros(1, dtype=np.int64),
        start_time=start_time,
    )
