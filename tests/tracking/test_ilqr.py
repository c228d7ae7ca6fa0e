"""Actions that iterative LQR improves: against closed forms, and in the physics."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from loco_drake.control.reward import reward_terms
from loco_drake.control.state_change import change_between, changed
from loco_drake.tracking.config import EnvironmentConfig
from loco_drake.tracking.guided_config import IlqrConfig
from loco_drake.tracking.ilqr import Ilqr
from loco_drake.tracking.problem import TrackingProblem

CHANGES = 12 + 2 * 12


@pytest.fixture(scope="module")
def problem(trot):
    return TrackingProblem(trot, EnvironmentConfig(robot="go2"))


def rollout(problem, state, actions, first=0):
    states, before = [state], np.zeros(problem.joints)
    for t, action in enumerate(actions):
        states.append(problem.next_state(first + t + 1, states[-1], action, before))
        before = action
    return np.array(states)


class Linear:
    """x' = A x + B u in the coordinates of changes, and 1 - reward = |x|^2 / 2."""

    def __init__(self, joints=2):
        random = np.random.default_rng(0)
        n = 12 + 2 * joints
        self.joints, self.n = joints, n
        self.A = 0.9 * np.linalg.qr(random.standard_normal((n, n)))[0]
        self.B = random.standard_normal((n, joints))
        for of in (self.A, self.B):
            of[:6] = 0.0  # the base stays where it is, at a height of 1 m
        self.A[:, :6] = 0.0
        self.still = np.append([1.0], np.zeros(n))
        self.still[6] = 1.0

    def next_state(self, sample, state, action, before):
        change = self.A @ change_between(self.still, state) + self.B @ action
        return changed(self.still, change)

    def is_fallen(self, state):
        return False

    def linearize(self, sample, state, action, before):
        return np.hstack((self.A, np.zeros_like(self.B))), self.B

    def rewards(self, first, states):
        return 1 - np.square(change_between(self.still, states)).sum(axis=-1) / 2

    def expand(self, sample, state):
        return change_between(self.still, state), np.eye(self.n)


def test_of_a_linear_system_one_iteration_finds_the_regulator():
    linear = Linear()
    config = IlqrConfig(iterations=1, effort=0.5, change=0.0, gain_cost=0.0)
    start = changed(linear.still, np.append(np.zeros(6), 0.1 * np.ones(linear.n - 6)))
    actions = np.zeros((60, 2))
    states = rollout(linear, start, actions)
    law = Ilqr(linear, config).improve(0, states, actions, np.zeros(2))
    # Cost of a sample: |x|^2 / 2 + .5 |u|^2 / 2, so R = .5.
    A, B, R = linear.A, linear.B, 0.5 * np.eye(2)
    P = solve_discrete_are(A, B, np.eye(linear.n), R)
    K = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
    assert law.gains[0, :, :-2] == pytest.approx(-K, abs=1e-6)
    assert law.gains[0, :, -2:] == pytest.approx(0.0, abs=1e-12)
    x = change_between(linear.still, states[0])
    # But for the damping of steps, which .05 is small against.
    assert law.actions[0] == pytest.approx(-K @ x, rel=0.05, abs=1e-3)
    assert law.cost < 0.7 * np.square(change_between(linear.still, states)).sum() / 120


def test_actions_that_may_not_change_stay():
    linear = Linear()
    start = changed(linear.still, np.append(np.zeros(6), 0.1 * np.ones(linear.n - 6)))
    actions, before = np.full((20, 2), 0.3), np.full(2, 0.3)
    states = rollout(linear, start, actions)
    config = IlqrConfig(iterations=1, effort=0.0, change=1e6)
    law = Ilqr(linear, config).improve(0, states, actions, before)
    assert law.actions == pytest.approx(np.full((20, 2), 0.3), abs=0.02)
    # The gain of the action before is one: a wrong one goes on.
    assert law.gains[5, :, -2:] == pytest.approx(np.eye(2), abs=0.02)


def test_rewards_are_those_of_training(problem, trot):
    random = np.random.default_rng(1)
    states = changed(trot.state[5:9], 0.05 * random.standard_normal((4, CHANGES)))
    robot = problem._robot
    terms = reward_terms(robot, trot.state[5:9], trot.p_BoF_H[5:9], states)
    assert problem.rewards(5, states) == pytest.approx(terms.sum(axis=-1), abs=1e-12)


def test_gradient_of_the_cost(problem, trot):
    random = np.random.default_rng(2)
    state = changed(trot.state[7], 0.03 * random.standard_normal(CHANGES))
    gradient, hessian = problem.expand(7, state)
    for i in range(CHANGES):
        step = 1e-5 * np.eye(CHANGES)[i]
        low, high = (changed(state, side * step)[None] for side in (-1, 1))
        slope = (problem.rewards(7, low) - problem.rewards(7, high))[0] / 2e-5
        assert gradient[i] == pytest.approx(slope, rel=1e-3, abs=1e-5)
    assert (np.linalg.eigvalsh(hessian) > -1e-9).all()


def test_law_improves_a_trot_and_returns_to_it(problem, trot):
    """From no actions, and from a start that is turned, shifted and slower."""
    first, T = 10, 50
    start = trot.state[first]
    actions = np.zeros((T, 12))
    states = rollout(problem, start, actions, first)
    config = IlqrConfig(iterations=1)
    law = Ilqr(problem, config).improve(first, states, actions, np.zeros(12))
    lost = 1 - problem.rewards(first + 1, states[1:]).mean()
    assert 1 - law.reward < 0.6 * lost
    again = rollout(problem, law.states[0], law.actions, first)
    assert (again == law.states).all()
    shift = np.zeros(CHANGES)
    shift[[2, 3, 4]] = 0.1, 0.05, -0.05
    state, action = changed(start, shift), law.previous
    moved = []
    for t, before in enumerate(law.before()):
        off = np.append(change_between(law.states[t], state), action - before)
        last, action = action, law.actions[t] + law.gains[t] @ off
        state = problem.next_state(first + t + 1, state, action, last)
        moved.append(state)
    held = rollout(problem, changed(start, shift), law.actions, first)[1:]
    with_gains, without = (
        problem.rewards(first + 1, np.array(x))[T // 2 :].mean() for x in (moved, held)
    )
    assert 1 - with_gains < 0.75 * (1 - without)
