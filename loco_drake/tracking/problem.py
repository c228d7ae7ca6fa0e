"""Tracking a plan as a problem of optimal control, in the physics that is simulated."""

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.control.action import joint_targets, set_points
from loco_drake.control.domain import Domain
from loco_drake.control.plan import Plan
from loco_drake.control.reward import REWARD_WEIGHTS, reward_residuals
from loco_drake.control.state import has_fallen, split, unit_base
from loco_drake.control.state_change import change_between, changed
from loco_drake.models.robots import get_simulated
from loco_drake.tracking.config import EnvironmentConfig
from loco_drake.tracking.physics import SharedWorld

# Half a difference in each of a change's parts: base rotation and translation, joints,
# angular velocity and velocity of the base, and joint velocities; rad, m, s. A contact
# yields 1 mm to some tens of newtons; differences across some millimetres average it.
_STEPS = (0.012, 0.006, 0.012, 0.12, 0.06, 0.3)
_ACTION_STEP = 0.18
_COST_STEP = 1e-5
# A term of the reward that is nearly lost still draws with this share of its weight.
_LEAST_SHARE = 0.3


class TrackingProblem:
    """The physics of one control period, and what a state costs, along a plan.

    The cost of a state is 1 minus its reward. Changes of states are as in
    :mod:`.state_change`, n = 12 + 2 J. The world is ``domain``, without its pushes and
    terrain, or the model's.
    """

    def __init__(
        self, plan: Plan, config: EnvironmentConfig, domain: Domain | None = None
    ) -> None:
        robot = get_simulated(config.robot)
        self._robot, self._plan = robot, plan
        self._world = SharedWorld(config, domain)
        self._set_points = set_points(robot, plan)
        joints = len(robot.joint_names)
        self._steps = np.repeat(_STEPS, (3, 3, joints, 3, 3, joints))
        self.joints = joints
        self.periods = 0  # simulated so far

    def next_state(
        self, sample: int, state: Array, action: Array, before: Array
    ) -> Array:
        """Returns the state at ``sample`` after that at the sample before.

        ``before`` is the action before ``action``, both of shape (J,).
        """
        self.periods += 1
        desired = joint_targets(self._set_points[sample], action)
        last = None
        if self._world.delays:
            last = joint_targets(self._set_points[sample - 1], before)
        after: Array = unit_base(self._world.advance(state, desired, last)[None])[0]
        return after

    def is_fallen(self, state: Array) -> bool:
        """Says whether the robot has fallen, see :func:`has_fallen`."""
        return bool(has_fallen(self._robot, split(state)[0]))

    def linearize(
        self, sample: int, state: Array, action: Array, before: Array
    ) -> tuple[Array, Array]:
        """Returns A (n, n + J) and B (n, J) of the change at ``sample``.

        A is about the state before, and about the action before that counts where
        motors delay it. They are central differences.
        """
        n, joints = len(self._steps), self.joints
        steps = np.concatenate((self._steps, np.full(2 * joints, _ACTION_STEP)))
        columns = np.zeros((n, len(steps)))
        for i, step in enumerate(steps):
            if n + joints <= i and not self._world.delays:
                break
            change = np.zeros(len(steps))
            change[i] = step
            of_state, of_action, of_before = np.split(change, (n, n + joints))
            low, high = (
                self.next_state(
                    sample,
                    changed(state, side * of_state),
                    action + side * of_action,
                    before + side * of_before,
                )
                for side in (-1, 1)
            )
            columns[:, i] = change_between(low, high) / (2 * step)
        A, B, C = np.split(columns, (n, n + joints), axis=1)
        return np.hstack((A, C)), B

    def rewards(self, first: int, states: Array) -> Array:
        """Returns the rewards (T,) of states (T, 13 + 2 J), the first at ``first``."""
        samples = slice(first, first + len(states))
        parts = self._residuals(samples, states)
        return sum(
            weight * np.exp(-np.square(part).sum(axis=-1))
            for weight, part in zip(REWARD_WEIGHTS, parts, strict=True)
        )

    def expand(self, sample: int, state: Array) -> tuple[Array, Array]:
        """Returns gradient (n,) and Gauss-Newton Hessian (n, n) of a state's cost."""
        n = len(self._steps)
        states = changed(state, np.vstack((np.zeros(n), _COST_STEP * np.eye(n))))
        gradient, hessian = np.zeros(n), np.zeros((n, n))
        parts = self._residuals(np.full(n + 1, sample), states)
        for weight, part in zip(REWARD_WEIGHTS, parts, strict=True):
            residual, J = part[0], (part[1:] - part[0]).T / _COST_STEP
            share = np.exp(-residual @ residual)
            gradient += 2 * weight * share * J.T @ residual
            hessian += 2 * weight * max(share, _LEAST_SHARE) * J.T @ J
        return gradient, hessian

    def _residuals(self, samples: slice | Array, states: Array) -> tuple[Array, ...]:
        plan = self._plan
        return reward_residuals(
            self._robot, plan.state[samples], plan.p_BoF_H[samples], states
        )
