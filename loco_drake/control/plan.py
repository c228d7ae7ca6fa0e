"""The one type that generator, smoother, player, policy and reward exchange."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.errors import InputError
from loco_drake.common.rotations import quat_conjugate, quat_rotate, yaw_of, yaw_quat
from loco_drake.control.feed_forward import feed_forward_torques
from loco_drake.models.kinematics import toe_positions
from loco_drake.models.robots import Robot
from loco_drake.motion.gaits import parse_label
from loco_drake.motion.motion import FPS, Motion

Array = NDArray[np.float64]

PLAN_DT = 1.0 / FPS
# s between a producer's looks at whether more plan is needed. A power of two times
# PLAN_DT: these events then come at the very times of the control periods. With .1 s
# they would be 6e-17 s apart at .3 s, and CENIC explodes over a step that short.
LOOK_PERIOD = 4 * PLAN_DT
_ARRAYS = ("q", "v", "set_points", "p_WF", "contacts", "labels", "path_time")


@dataclass(frozen=True, eq=False)
class Plan:
    """An immutable stretch of motion on its own clock, sampled every PLAN_DT.

    Sample k is due at context time ``start_time + k * PLAN_DT``. ``q`` and ``v`` are
    in the order of the robot's MultibodyPlant: ``q = [R_WB as w x y z, p_WB, joints]``
    and ``v = [w_WB_W, v_WB_W, joint velocities]``.

    A Plan is held in abstract state and compared by identity; copying one returns the
    same object, since Drake copies all abstract state at each unrestricted update.

    Attributes:
        start_time: context time in s of the first sample.
        q: positions, shape (N, 7 + J).
        v: velocities, shape (N, 6 + J).
        set_points: of the joints' PD, in rad, shape (N, J): the positions, and beyond
            them what the damping and the feed-forward torques need.
        p_WF: centres of the toe spheres in m, shape (N, 4, 3).
        contacts: whether each foot is meant to be on the ground, shape (N, 4).
        labels: index into :data:`loco_drake.motion.gaits.LABELS`, shape (N,).
        path_time: seconds of the unsmoothed motion that have passed, shape (N,);
            the smoother slows this clock down where the robot cannot follow.
        open_ended: whether whoever made the plan will write more of it.
    """

    start_time: float
    q: Array
    v: Array
    set_points: Array
    p_WF: Array
    contacts: NDArray[np.bool_]
    labels: NDArray[np.int64]
    path_time: Array
    open_ended: bool = False

    def __post_init__(self) -> None:
        for name in _ARRAYS:
            value = getattr(self, name)
            if len(value) != len(self.q):
                raise ValueError(f"{name} has {len(value)} samples, q {len(self.q)}")
            value.setflags(write=False)

    def __len__(self) -> int:
        return len(self.q)

    def __copy__(self) -> "Plan":
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> "Plan":
        return self

    @cached_property
    def state(self) -> Array:
        """[q, v], shape (N, 13 + 2 J)."""
        return np.hstack((self.q, self.v))

    @cached_property
    def p_BoF_H(self) -> Array:
        """Toes relative to the base in its heading frame (z up), m, shape (N, 4, 3)."""
        q_HW = quat_conjugate(yaw_quat(yaw_of(self.q[:, :4])))
        return quat_rotate(q_HW[:, None], self.p_WF - self.q[:, None, 4:7])

    @property
    def end_time(self) -> float:
        """Context time in s of the last sample."""
        return self.start_time + (len(self) - 1) * PLAN_DT

    def tail(self, first: int) -> "Plan":
        """Returns the plan from sample ``first`` on."""
        arrays = {name: getattr(self, name)[first:].copy() for name in _ARRAYS}
        return replace(self, start_time=self.start_time + first * PLAN_DT, **arrays)

    def index(self, time: float) -> int:
        """Returns the sample nearest to ``time``, at the ends the first or last."""
        k = round((time - self.start_time) / PLAN_DT)
        return min(max(k, 0), len(self) - 1)


def make_plan(
    robot: Robot,
    *,
    q: Array,
    v: Array,
    contacts: NDArray[np.bool_],
    labels: NDArray[np.int64],
    start_time: float = 0.0,
    path_time: Array | None = None,
    open_ended: bool = False,
) -> Plan:
    """Returns a Plan; toes and set-points follow from the robot's model.

    The set-points are q + (kd v + tau) / kp, with the gains of the PD and the torques
    tau of :func:`feed_forward_torques`: all act through the position.
    """
    p_BF = toe_positions(robot, q[:, 7:])
    p_WF = q[:, None, 4:7] + quat_rotate(q[:, None, :4], p_BF)
    written = PLAN_DT * np.arange(len(q), dtype=np.float64)
    times = written if path_time is None else path_time
    torques = feed_forward_torques(robot, q, v, contacts)
    set_points = q[:, 7:] + (robot.kd * v[:, 6:] + torques) / robot.kp
    return Plan(start_time, q, v, set_points, p_WF, contacts, labels, times, open_ended)


def plan_from_motion(robot: Robot, motion: Motion, start_time: float = 0.0) -> Plan:
    """Returns ``motion`` as a Plan for ``robot``.

    Raises:
        InputError: if the motion is not at :data:`loco_drake.motion.motion.FPS`, is of
            another robot, or of a gait that is none of the fifteen.
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
    label = parse_label(str(motion.label))
    return make_plan(
        robot,
        q=np.hstack(
            (motion.base_quaternion, motion.base_position, motion.joint_positions)
        ),
        v=np.hstack(
            (
                motion.base_angular_velocity,
                motion.base_velocity,
                motion.joint_velocities,
            )
        ),
        contacts=motion.contacts.copy(),
        labels=np.full(len(motion), label.index),
        start_time=start_time,
    )


def join_plans(first: Plan, second: Plan) -> Plan:
    """Returns one plan; ``second`` must start one sample after ``first`` ends."""
    arrays: dict[str, Any] = {
        name: np.concatenate((getattr(first, name), getattr(second, name)))
        for name in _ARRAYS
    }
    return replace(second, start_time=first.start_time, **arrays)


def standing_plan(robot: Robot, start_time: float = 0.0) -> Plan:
    """Returns the plan to stand still; what ports hold before anything is planned."""
    q = np.concatenate(([1, 0, 0, 0, 0, 0, robot.stand_height], robot.stand_joints))
    return make_plan(
        robot,
        q=q[None],
        v=np.zeros((1, len(q) - 1)),
        contacts=np.ones((1, 4), dtype=bool),
        labels=np.zeros(1, dtype=np.int64),
        start_time=start_time,
    )
