"""Better actions along a plan, by iterative LQR in the physics that is simulated.

iLQR (Li and Todorov 2004, "Iterative linear quadratic regulator design for nonlinear
biological movement systems"; Tassa et al. 2012, "Synthesis and stabilization of complex
behaviors through online trajectory optimization") linearizes the physics along a
trajectory, solves the linear-quadratic problem backwards in time, and runs the feedback
law that it finds.
"""

from dataclasses import dataclass

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.control.state import HEIGHT
from loco_drake.control.state_change import change_between
from loco_drake.tracking.problem import TrackingProblem

_LARGEST_CHANGE = 1.5  # of an action, from one iteration to the next
_SHARES = (1.0, 0.5, 0.2, 0.07)  # of a step that are tried
_LOWEST = 0.1  # m; a base that is lower has fallen
# Damping of a step, which rises while steps fail, and falls.
_DAMPING, _LEAST_DAMPING, _RISE, _TRIES = 0.05, 0.01, 4.0, 6
_ENOUGH = 1e-4  # least gain of a step, in cost


@dataclass(kw_only=True)
class IlqrConfig:
    """How actions are improved."""

    # Iterations at most.
    iterations: int = 5
    # Cost of the mean square of the actions.
    effort: float = 0.02
    # Cost of the mean square of their changes. Without it the actions alternate from
    # period to period, which no policy learns.
    change: float = 0.15
    # Cost of actions that keeps the gains low.
    gain_cost: float = 0.3


@dataclass(frozen=True)
class FeedbackLaw:
    """Actions along a trajectory, and how they change beside it.

    ``states`` (T + 1, 13 + 2 J) are visited, ``actions`` (T, J) taken, ``previous``
    (J,) is the action before them, and ``gains`` (T, J, 12 + 3 J) multiply the change
    of the state and then of the action before.
    """

    states: Array
    actions: Array
    previous: Array
    gains: Array
    cost: float  # mean of a sample
    reward: float  # mean of a sample

    def before(self) -> Array:
        """Returns the action before each, (T, J)."""
        return np.vstack((self.previous, self.actions[:-1]))


class Ilqr:
    """Improves actions along one problem's plan."""

    def __init__(self, problem: TrackingProblem, config: IlqrConfig) -> None:
        self._problem, self._config = problem, config

    def improve(
        self, first: int, states: Array, actions: Array, previous: Array
    ) -> FeedbackLaw | None:
        """Returns a law that costs less than the trajectory, None if none is found.

        Args:
            first: sample of the first state.
            states: a trajectory, shape (T + 1, 13 + 2 J).
            actions: that lead from each to the next, shape (T, J).
            previous: the action before them, shape (J,).
        """
        cost, _ = self._cost(first, states, actions, previous)
        law, damping = None, _DAMPING
        for _ in range(self._config.iterations):
            pairs = zip(states[:-1], actions, strict=True)
            linear = [
                self._problem.linearize(first + t + 1, x, u)
                for t, (x, u) in enumerate(pairs)
            ]
            for _ in range(_TRIES):
                steps, gains = self._solve(
                    first, states, actions, previous, linear, damping
                )
                base = FeedbackLaw(states, actions, previous, gains, cost, 0.0)
                tried = [self._run(first, base, s * steps) for s in _SHARES]
                best = min((x for x in tried if x), key=lambda x: x.cost, default=None)
                if best is not None and best.cost < cost - _ENOUGH:
                    break
                damping *= _RISE
            else:
                return law
            law, damping = best, max(damping / _RISE, _LEAST_DAMPING)
            states, actions, cost = law.states, law.actions, law.cost
        return law

    def _cost(
        self, first: int, states: Array, actions: Array, previous: Array
    ) -> tuple[float, float]:
        """Returns the mean cost of a sample, and the mean reward."""
        reward = float(np.mean(self._problem.rewards(first + 1, states[1:])))
        changes = np.diff(np.vstack((previous, actions)), axis=0)
        cost = self._config.effort * np.square(actions).mean()
        cost += self._config.change * np.square(changes).mean()
        return 1 - reward + float(cost), reward

    def _run(self, first: int, law: FeedbackLaw, steps: Array) -> FeedbackLaw | None:
        """Runs a law with steps (T, J) added, in the physics; None if it falls."""
        state, action = law.states[0], law.previous
        states, actions = [state], []
        for t, before in enumerate(law.before()):
            off = np.append(change_between(law.states[t], state), action - before)
            change = steps[t] + law.gains[t] @ off
            action = law.actions[t] + np.clip(change, -_LARGEST_CHANGE, _LARGEST_CHANGE)
            state = self._problem.next_state(first + t + 1, state, action)
            if not np.isfinite(state).all() or state[HEIGHT] < _LOWEST:
                return None
            states.append(state)
            actions.append(action)
        visited, taken = np.array(states), np.array(actions)
        own = self._cost(first, visited, taken, law.previous)
        return FeedbackLaw(visited, taken, law.previous, law.gains, *own)

    def _solve(
        self,
        first: int,
        states: Array,
        actions: Array,
        previous: Array,
        linear: list[tuple[Array, Array]],
        damping: float,
    ) -> tuple[Array, Array]:
        """Returns steps (T, J) and gains (T, J, n + J) of the quadratic problem.

        The state of the problem is the change of the robot's state, n numbers, and of
        the action before.
        """
        T, joints = actions.shape
        n = linear[0][0].shape[0]
        eye = np.eye(joints)
        effort, change = (
            2 * cost / joints * eye
            for cost in (self._config.effort, self._config.change)
        )
        before = np.vstack((previous, actions[:-1]))
        V, v = np.zeros((n + joints,) * 2), np.zeros(n + joints)
        v[:n], V[:n, :n] = self._problem.expand(first + T, states[T])
        steps = np.empty((T, joints))
        gains = np.empty((T, joints, n + joints))
        for t in reversed(range(T)):
            A = np.zeros_like(V)
            A[:n, :n] = linear[t][0]
            B = np.vstack((linear[t][1], eye))
            drift = change @ (actions[t] - before[t])
            Q_x, Q_u = A.T @ v, B.T @ v + effort @ actions[t] + drift
            Q_xx, Q_uu = A.T @ V @ A, B.T @ V @ B + effort + change
            Q_ux = B.T @ V @ A
            Q_x[n:] -= drift
            Q_xx[n:, n:] += change
            Q_ux[:, n:] -= change
            k = -np.linalg.solve(Q_uu + damping * eye, Q_u)
            K = -np.linalg.solve(Q_uu + self._config.gain_cost * eye, Q_ux)
            steps[t], gains[t] = k, K
            v = Q_x + K.T @ (Q_uu @ k + Q_u) + Q_ux.T @ k
            V = Q_xx + K.T @ Q_uu @ K + K.T @ Q_ux + Q_ux.T @ K
            V = (V + V.T) / 2
            if t > 0:
                gradient, hessian = self._problem.expand(first + t, states[t])
                v[:n] += gradient
                V[:n, :n] += hessian
        return steps, gains
