"""Better actions where a policy gets to, which it is then to learn.

Guided policy search (Levine and Koltun 2013; Mordatch and Todorov 2014, "Combining the
benefits of function approximation and trajectory optimization"): the policy tracks a
plan for a while, iterative LQR improves its actions, and the feedback law that results
tells what the policy should do there and beside it.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import torch

from loco_drake.common.arrays import Array
from loco_drake.common.determinism import single_thread
from loco_drake.control.actor import Actor
from loco_drake.control.actor_file import load_actor
from loco_drake.control.plan import Plan
from loco_drake.engine.executor import Executor
from loco_drake.models.robots import get_simulated
from loco_drake.tracking.batch import TrackingBatch
from loco_drake.tracking.config import EnvironmentConfig
from loco_drake.tracking.guided_config import FEWEST, StretchConfig
from loco_drake.tracking.ilqr import FeedbackLaw, Ilqr
from loco_drake.tracking.problem import TrackingProblem

# A policy that loses its plan still finds a law on what it did until shortly before.
_BEFORE_LOSS = 3  # samples
_FEWEST_LOST = 10  # samples that a policy tracks before it loses its plan


@dataclass(frozen=True)
class Found:
    """A law of a plan, by its number, from a sample on."""

    plan: int
    sample: int
    law: FeedbackLaw
    before: float  # mean reward of a sample without the law
    periods: int  # control periods that were simulated to find it


def find_laws(
    plans: list[Plan],
    policy: Path,
    environment: EnvironmentConfig,
    config: StretchConfig,
    seeds: Iterable[tuple[int, ...]],
    executor: Executor,
) -> Iterator[Found | None]:
    """Yields what :func:`find_law` gives for each seed, in order."""
    make = partial(_make_finder, plans, policy, environment, config)
    return executor.map(make, seeds)


def _make_finder(
    plans: list[Plan],
    policy: Path,
    environment: EnvironmentConfig,
    config: StretchConfig,
) -> Callable[[tuple[int, ...]], Found | None]:
    actor = load_actor(policy, get_simulated(environment.robot))
    return partial(find_law, plans, actor, environment, config)


def find_law(
    plans: list[Plan],
    actor: Actor,
    environment: EnvironmentConfig,
    config: StretchConfig,
    seed: tuple[int, ...],
) -> Found | None:
    """Returns a law on a random stretch of a random plan; None if none is found.

    The robot starts beside the plan, by the noise of the environment's starts, and may
    be pushed. Where the policy loses the plan, what it did is improved and it goes on
    from there. There is no law where it loses the plan at once, or where no actions
    cost less.
    """
    random = np.random.default_rng(seed)
    number = int(random.integers(len(plans)))
    length = len(plans[number])
    first, lead = config.draw(random, length)
    batch = TrackingBatch([plans[number]], environment, 1)
    batch.reset(0, random, 0, first)
    problem = TrackingProblem(plans[number], environment, batch.drawn(0))
    _, taken = track(batch, actor, lead)
    if len(taken) < lead:
        return None
    previous = taken[-1] if lead else np.zeros(problem.joints)
    batch.push(0, config.draw_push(random))
    start = first + lead
    whole = min(config.length, length - start - 2)
    visited, taken = track(batch, actor, whole)
    before = float(problem.rewards(start + 1, visited[1:]).mean()) if len(taken) else 0
    ilqr = Ilqr(problem, config.ilqr)
    law: FeedbackLaw | None = None
    for rescue in range(config.rescues + 1):
        lost = len(taken) < whole
        if lost:
            visited, taken = visited[:-_BEFORE_LOSS], taken[:-_BEFORE_LOSS]
        if len(taken) < _FEWEST_LOST:
            return None
        better = ilqr.improve(start, visited, taken, previous)
        law = better or law
        if better is None or not lost or rescue == config.rescues:
            break
        # It may stand now where it fell, and the policy goes on.
        sample = start + len(better)
        batch.place(0, sample, better.states[-1], better.actions[-1])
        further, more = track(batch, actor, whole - len(better))
        visited = np.concatenate((better.states, further[1:]))
        taken = np.concatenate((better.actions, more))
    if law is None or len(law) - config.tail < FEWEST:
        return None
    periods = problem.periods + lead + len(taken)
    return Found(number, start, law.cut(len(law) - config.tail), before, periods)


def track(batch: TrackingBatch, actor: Actor, steps: int) -> tuple[Array, Array]:
    """Lets a policy track the plan of a batch's only robot, until it loses it.

    Returns the states (T + 1, 13 + 2 J) and the actions (T, J), at most ``steps``.
    """
    states, actions = [batch.states[0]], []
    for _ in range(steps):
        with torch.inference_mode(), single_thread():
            action = actor(torch.from_numpy(batch.observe())).numpy()
        _, lost, _ = batch.step(action)
        if lost[0]:
            break
        states.append(batch.states[0])
        actions.append(action[0].astype(np.float64))
    joints = len(batch.states[0]) // 2 - 6
    return np.array(states), np.array(actions).reshape(-1, joints)
