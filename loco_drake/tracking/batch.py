"""A batch of robots that track plans, one control period at a time."""

import numpy as np
from numpy.typing import NDArray

from loco_drake.control.action import joint_targets, set_points
from loco_drake.control.domain import Domain, draw_error, measure
from loco_drake.control.observation import LOOK_AHEAD, Preview, observe
from loco_drake.control.plan import PLAN_DT, Plan
from loco_drake.control.reward import reward_terms
from loco_drake.control.state import POSITION, VELOCITY, has_fallen, split, unit_base
from loco_drake.models.robots import get_simulated
from loco_drake.tracking.config import EnvironmentConfig
from loco_drake.tracking.physics import OwnWorld, SharedWorld

Array = NDArray[np.float64]


class TrackingBatch:
    """B robots that track plans, one control period at a time.

    Joint targets, observations, rewards and terminations are computed for all robots at
    once, with the functions that the systems use. For one robot at a time this would
    cost as much as the physics.
    """

    def __init__(
        self, plans: list[Plan], config: EnvironmentConfig, count: int
    ) -> None:
        self._plans = plans
        self._config = config
        self._robot = get_simulated(config.robot)
        config.randomization.check(self._robot, config.plant)
        self._worlds: list[SharedWorld] | list[OwnWorld] = (
            [OwnWorld(config) for _ in range(count)]
            if config.randomization.changes_physics
            else [SharedWorld(config)] * count
        )
        self._domains = [Domain()] * count
        self._lengths = np.array([len(plan) for plan in plans])
        # Samples of all plans concatenated, for one lookup per step.
        self._first = np.cumsum(self._lengths) - self._lengths
        self._wanted = np.concatenate([plan.state for plan in plans])
        self._set_points = np.concatenate(
            [set_points(self._robot, plan) for plan in plans]
        )
        self._toes = np.concatenate([plan.p_BoF_H for plan in plans])
        self._contacts = np.concatenate([plan.contacts for plan in plans])
        self._labels = np.concatenate([plan.labels for plan in plans])
        self.plan = np.zeros(count, dtype=np.int64)  # index of each robot's plan
        self.start = np.zeros(count, dtype=np.int64)  # sample that it started at
        self.sample = np.zeros(count, dtype=np.int64)  # sample that it is at
        # Of its last step, for distance, falls and actions.
        self.penalty = np.zeros(count)
        self._last = np.zeros(count, dtype=np.int64)
        joints = len(self._robot.joint_names)
        self._state = np.zeros((count, 13 + 2 * joints))
        self._action = np.zeros((count, joints))

    @property
    def states(self) -> Array:
        """The robots' states [q, v], a copy of shape (B, 13 + 2 J)."""
        return self._state.copy()

    def reset(
        self,
        i: int,
        random: np.random.Generator,
        plan: int | None = None,
        sample: int | None = None,
    ) -> None:
        """Starts an episode of robot ``i``.

        Draws the plan, unless its index is given, and the sample of it to start at:
        anywhere that leaves half an episode, where the plan is that long.
        """
        if plan is None:
            plan = int(random.integers(len(self._plans)))
        length = int(self._lengths[plan])
        steps = self._config.episode_steps
        if sample is None:
            sample = int(random.integers(max(1, length - steps // 2)))
        self.plan[i], self.start[i], self.sample[i] = plan, sample, sample
        self._last[i] = min(sample + steps, length - 1)
        wanted = self._plans[plan].state[sample]
        self._state[i] = self._config.reset_noise.draw(wanted, random)
        self._action[i] = 0.0
        domain = self._config.randomization.draw(
            self._robot, random, sample * PLAN_DT, self._last[i] * PLAN_DT
        )
        if domain.terrain is not None:
            self._state[i] = domain.terrain.placed(self._robot, self._state[i])
        self._domains[i] = domain
        self._worlds[i].begin(domain, sample)

    def place(self, i: int, sample: int, state: Array, action: Array) -> None:
        """Puts robot ``i`` at a sample of its plan, in a state, after an action.

        Its motors forget what was before.
        """
        self.sample[i], self._state[i], self._action[i] = sample, state, action
        self._worlds[i].begin(self._domains[i], sample)

    def drawn(self, i: int) -> Domain | None:
        """Returns the world that was drawn for robot ``i``; None if it is the model."""
        changed = self._config.randomization.changes_physics
        return self._domains[i] if changed else None

    def push(self, i: int, v_W: Array) -> None:
        """Adds ``v_W``, m/s, to the velocity of robot ``i``'s base."""
        split(self._state[i])[1][VELOCITY] += v_W

    def step(
        self, actions: NDArray[np.floating]
    ) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
        """Advances every robot by one control period, given actions (B, J).

        Returns the reward's terms (B, 5), who terminated, and who is truncated, (B,).
        """
        self._action[:] = actions
        self.sample += 1
        now = self._first[self.plan] + self.sample
        desired_state = joint_targets(self._set_points[now], self._action)
        for i, state in enumerate(self._state):
            self._state[i] = self._worlds[i].advance(state, desired_state[i])
        self._state = unit_base(self._state)
        wanted, toes = self._wanted[now], self._toes[now]
        terms = reward_terms(self._robot, wanted, toes, self._state)
        gap = (self._state - wanted)[POSITION][:, :2]
        fallen = has_fallen(self._robot, split(self._state)[0])
        self.penalty = self._config.position_penalty * np.linalg.norm(gap, axis=1)
        self.penalty += self._config.fall_cost * fallen
        effort = np.square(self._action).mean(axis=1)
        self.penalty += self._config.action_penalty * effort
        lost = fallen | self._config.termination.exceeded(self._state, wanted)
        return terms, lost, ~lost & (self.sample >= self._last)

    def observe(
        self, robots: NDArray[np.int64] | slice = slice(None), *, exact: bool = False
    ) -> NDArray[np.float32]:
        """Returns observations (B, size of the Layout), or those of some robots.

        They are those of the measured state, or if ``exact`` of the true one.
        """
        plan, sample = self.plan[robots], self.sample[robots]
        first, last = self._first[plan], self._lengths[plan] - 1
        ahead = np.minimum(sample[:, None] + LOOK_AHEAD, last[:, None])
        rows = first[:, None] + ahead
        q, v = split(self._wanted[rows])
        shown = Preview(q, v, self._contacts[rows], self._labels[first + sample])
        state = self._state[robots] if exact else self._measured(robots)
        action = self._action[robots]
        return observe(self._robot, shown, state, action).astype(np.float32)

    def _measured(self, robots: NDArray[np.int64] | slice) -> Array:
        """Returns states as robots measure them."""
        if self._config.randomization.noise is None:
            return self._state[robots]
        errors = []
        for i in np.arange(len(self._state))[robots]:
            sensors = self._domains[i].sensors
            assert sensors is not None
            errors.append(draw_error(sensors, int(self.sample[i])))
        return measure(self._state[robots], np.array(errors))
