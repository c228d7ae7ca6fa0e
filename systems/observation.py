"""What the policy sees: the robot's state and the plan relative to it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.systems.framework import Context, LeafSystem

from loco_drake.gaits import ONE_HOT, ONE_HOT_SIZE
from loco_drake.models.robots import Robot
from loco_drake.rotations import (
    heading_matrix,
    quat_conjugate,
    quat_log,
    quat_multiply,
    quat_to_matrix,
)

from .plan import Plan, standing_plan

Array = NDArray[np.float64]

# Samples of the plan after the present one that are shown to the policy.
LOOK_AHEAD = np.array([1, 2, 4, 8])
_K = len(LOOK_AHEAD)

# Name and size of each part, in order; weights of a policy record this layout. H is
# the base's heading frame: at the base, z up, x along the base's x in the plane.
OBSERVATION_LAYOUT = (
    ("gravity_B", 3),  # direction of gravity
    ("w_WB_B", 3),  # rad/s
    ("v_WB_H", 3),  # m/s
    ("height", 1),  # z of the base, m
    ("joint_positions", 12),  # from the standing pose, rad
    ("joint_velocities", 12),  # a tenth of rad/s
    ("last_action", 12),
    ("plan_joint_velocities", 12),  # of the next sample, a tenth of rad/s
    ("plan_joints", 12 * _K),  # plan minus robot, rad
    ("plan_p_H", 3 * _K),  # base position of the plan from the robot's, m
    ("plan_R_B", 3 * _K),  # base rotation of the plan from the robot's, so(3), rad
    ("plan_v_H", 3 * _K),  # base velocity of the plan, m/s
    ("plan_w_H", 3 * _K),  # base angular velocity of the plan, rad/s
    ("plan_contacts", 4 * _K),
    ("label", ONE_HOT_SIZE),  # one-hot of the source, one-hot of the gait
)
OBSERVATION_SIZE = sum(size for _, size in OBSERVATION_LAYOUT)


@dataclass(frozen=True)
class Preview:
    """What the policy is shown of its plan; any leading shape, K samples ahead.

    Attributes:
        q: positions as in :class:`Plan`, shape (..., K, 19).
        v: velocities as in :class:`Plan`, shape (..., K, 18).
        contacts: shape (..., K, 4).
        label: index into :data:`loco_drake.gaits.LABELS` of the present, shape (...).
    """

    q: Array
    v: Array
    contacts: NDArray[np.bool_]
    label: NDArray[np.int64]


def preview(plan: Plan, time: float) -> Preview:
    """Returns what is to be shown of ``plan`` at a context time in s."""
    now = plan.index(time)
    k = np.minimum(now + LOOK_AHEAD, len(plan) - 1)
    return Preview(plan.q[k], plan.v[k], plan.contacts[k], plan.labels[now])


def observe(
    robot: Robot,
    ahead: Preview,
    state: Array,
    action: Array,
    R_WB: Array | None = None,
) -> Array:
    """Returns observations, shape (..., OBSERVATION_SIZE).

    Args:
        robot: the robot.
        ahead: what it is to do.
        state: the plant's [q, v], as in :class:`Plan`, shape (..., 37).
        action: the action being applied, shape (..., 12).
        R_WB: the base's rotation matrix (..., 3, 3), if it is known already.
    """
    q, v = state[..., :19], state[..., 19:]
    if R_WB is None:
        R_WB = quat_to_matrix(q[..., :4])
    R_WH = heading_matrix(R_WB)
    parts = (
        -R_WB[..., 2, :],
        _times(v[..., :3], R_WB),
        _times(v[..., 3:6], R_WH),
        q[..., 6:7],
        q[..., 7:] - robot.stand_joints,
        0.1 * v[..., 6:],
        action,
        0.1 * ahead.v[..., 0, 6:],
        ahead.q[..., 7:] - q[..., None, 7:],
        (ahead.q[..., 4:7] - q[..., None, 4:7]) @ R_WH,
        quat_log(quat_multiply(quat_conjugate(q[..., None, :4]), ahead.q[..., :4])),
        ahead.v[..., 3:6] @ R_WH,
        ahead.v[..., :3] @ R_WH,
        ahead.contacts,
        ONE_HOT[ahead.label],
    )
    shape = state.shape[:-1]
    return np.concatenate([part.reshape(*shape, -1) for part in parts], axis=-1)


def _times(rows: Array, R: Array) -> Array:
    """Returns row vectors (..., 3) times matrices (..., 3, 3)."""
    return (rows[..., None, :] @ R)[..., 0, :]


class Observation(LeafSystem):
    """Computes :func:`observe` from its inputs.

    .. pydrake_system::

        name: Observation
        input_ports:
        - plan
        - state
        - action
        output_ports:
        - observation
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        self._robot = robot
        joints = len(robot.joint_names)
        self._plan = self.DeclareAbstractInputPort("plan", Value(standing_plan(robot)))
        self._state = self.DeclareVectorInputPort("state", 13 + 2 * joints)
        self._action = self.DeclareVectorInputPort("action", joints)
        self.DeclareVectorOutputPort(
            "observation",
            OBSERVATION_SIZE,
            self._calc,
            prerequisites_of_calc={
                self.time_ticket(),
                self._plan.ticket(),
                self._state.ticket(),
                self._action.ticket(),
            },
        )

    def _calc(self, context: Context, output: Any) -> None:
        output.set_value(
            observe(
                self._robot,
                preview(self._plan.Eval(context), context.get_time()),
                self._state.Eval(context),
                self._action.Eval(context),
            )
        )
