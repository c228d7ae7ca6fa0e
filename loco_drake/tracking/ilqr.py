"""Better actions along a plan, by iterative LQR in the physics that is simulated.

iLQR (Li and Todorov 2004, "Iterative linear quadratic regulator design for nonlinear
biological movement systems"; Tassa et al. 2012, "Synthesis and stabilization of complex
behaviors through online trajectory optimization") linearizes the physics along a
trajectory, solves the linear-quadratic problem backwards in time, and runs the feedback
law that it finds.
"""

from dataclasses import dataclass, replace

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.control.state_change import change_between
from loco_drake.tracking.guided_config import IlqrConfig
from loco_drake.tracking.problem import TrackingProblem

_LARGEST_CHANGE = 1.5  # of an action, from one iteration to the next
_SHARES = (1.0, 0.5, 0.2, 0.07)  # of a step that are tried
# Damping of a step, which rises while steps fail, and falls.
_DAMPING, _LEAST_DAMPING, _RISE = 0.05, 0.01, 4.0
# First with a linearization, and further on.
_TRIES, _FURTHER_TRIES = 6, 2
_ENOUGH = 1e-4  # least gain of a step, in cost

Linear = list[tuple[Array, Array]]  # A and B of each action


@dataclass(frozen=True)
class FeedbackLaw:
    """Actions along a trajectory, and how they change beside it.

    ``states`` (T + 1, 13 + 2 J) are visited, ``actions`` (T, J) taken, ``previous``
    (J,) is the action before them, and ``gains`` (T, J, 12 + 3 J) multiply the change
    of the state and then of the action before. ``curvatures`` (T, J, J) say how much
    another action costs: half its square.
    """

    states: Array
    actions: Array
    previous: Array
    gains: Array
    curvatures: Array
    cost: float  # mean of a sample
    reward: float  # mean of a sample

    def __len__(self) -> int:
        """The number of actions."""
        return len(self.actions)

    def before(self) -> Array:
        """Returns the action before each, (T, J)."""
        return np.vstack((self.previous, self.actions[:-1]))

    def cut(self, length: int) -> "FeedbackLaw":
        """Returns the law's first actions; cost and reward stay those of the whole."""
        return replace(
            self,
            states=self.states[: length + 1],
            actions=self.actions[:length],
            gains=self.gains[:length],
            curvatures=self.curvatures[:length],
        )


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
        cost, reward = self._cost(first, states, actions, previous)
        none = np.zeros((0, 0, 0))
        law = FeedbackLaw(states, actions, previous, none, none, cost, reward)
        damping = _DAMPING
        for _ in range(self._config.iterations):
            taken = zip(law.states[:-1], law.actions, law.before(), strict=True)
            linear = [
                self._problem.linearize(first + t + 1, *where)
                for t, where in enumerate(taken)
            ]
            start = law
            for k in range(self._config.steps):
                tries = _TRIES if k == 0 else _FURTHER_TRIES
                better, damping = self._step(first, law, linear, damping, tries)
                if better is None:
                    break
                law = better
            if law is start:
                break
        return law if law.gains.size else None

    def _step(
        self, first: int, law: FeedbackLaw, linear: Linear, damping: float, tries: int
    ) -> tuple[FeedbackLaw | None, float]:
        """Returns a law that costs less, None if none is found, and the damping."""
        for _ in range(tries):
            steps, found = self._solve(first, law, linear, damping)
            laws = (self._run(first, found, share * steps) for share in _SHARES)
            standing = [x for x in laws if x is not None]
            best = min(standing, key=lambda x: x.cost, default=law)
            if best.cost < law.cost - _ENOUGH:
                return best, max(damping / _RISE, _LEAST_DAMPING)
            damping *= _RISE
        return None, damping

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
            change = np.clip(change, -_LARGEST_CHANGE, _LARGEST_CHANGE)
            last, action = action, law.actions[t] + change
            state = self._problem.next_state(first + t + 1, state, action, last)
            if not np.isfinite(state).all() or self._problem.is_fallen(state):
                return None
            states.append(state)
            actions.append(action)
        visited, taken = np.array(states), np.array(actions)
        cost, reward = self._cost(first, visited, taken, law.previous)
        return replace(law, states=visited, actions=taken, cost=cost, reward=reward)

    def _solve(
        self, first: int, law: FeedbackLaw, linear: Linear, damping: float
    ) -> tuple[Array, FeedbackLaw]:
        """Returns steps (T, J), and the trajectory with the gains of the problem.

        The state of the quadratic problem is the change of the robot's state, n
        numbers, and of the action before.
        """
        states, actions, before = law.states, law.actions, law.before()
        T, joints = actions.shape
        n = len(linear[0][0])
        eye = np.eye(joints)
        effort, change = (
            2 * cost / joints * eye
            for cost in (self._config.effort, self._config.change)
        )
        V, v = np.zeros((n + joints,) * 2), np.zeros(n + joints)
        v[:n], V[:n, :n] = self._problem.expand(first + T, states[T])
        steps = np.empty((T, joints))
        gains = np.empty((T, joints, n + joints))
        curvatures = np.empty((T, joints, joints))
        for t in reversed(range(T)):
            A = np.zeros_like(V)
            A[:n] = linear[t][0]
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
            steps[t], gains[t], curvatures[t] = k, K, Q_uu
            v = Q_x + K.T @ (Q_uu @ k + Q_u) + Q_ux.T @ k
            V = Q_xx + K.T @ Q_uu @ K + K.T @ Q_ux + Q_ux.T @ K
            V = (V + V.T) / 2
            if t > 0:
                gradient, hessian = self._problem.expand(first + t, states[t])
                v[:n] += gradient
                V[:n, :n] += hessian
        return steps, replace(law, gains=gains, curvatures=curvatures)
