"""How much a policy survives, label by label: success curves and their summaries.

The plan of each label and seed is recorded once, and tracked under every disturbance.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from loco_drake.control.plan import PLAN_DT
from loco_drake.engine.executor import Executor
from loco_drake.engine.local import LOCAL
from loco_drake.evaluation.disturbances import (
    DURATION,
    KINDS,
    Disturbance,
    curve_names,
    disturbances,
    domain_of,
    push_sample,
)
from loco_drake.evaluation.robustness import (
    recovery_band,
    recovery_time,
    succeeded,
    success_threshold,
)
from loco_drake.evaluation.tracking import Recorder, normalized_return
from loco_drake.systems.plan_recorder import PlanRecorder
from loco_drake.systems.scenario import Disturbances, PlanReference, Scenario
from loco_drake.tracking.randomization import PUSH_DURATION

_PUSH_SAMPLES = round(PUSH_DURATION / PLAN_DT)


@dataclass(frozen=True)
class Course:
    """A label and seed, whose plan is tracked under each disturbance of some kinds."""

    label: str
    seed: int
    kinds: tuple[str, ...]


@dataclass(frozen=True)
class Outcome:
    """How one episode went."""

    disturbance: Disturbance
    success: bool
    fell: bool
    normalized_return: float
    recovery: float | None  # from a push, s; None if there was none, or never


class _Runner:
    """Runs one course after the other in one diagram."""

    def __init__(self, scenario: Scenario) -> None:
        self._plans = PlanRecorder(scenario)
        played = replace(
            scenario,
            reference=PlanReference(),
            steering=None,
            smoother=None,
            disturbances=Disturbances(actuation=True, pushes=True, terrain=True),
        )
        self._recorder = Recorder(played)

    def __call__(self, course: Course) -> list[Outcome]:
        plan = self._plans.record(DURATION, gait=course.label, seed=course.seed)
        band = None
        outcomes = []
        for disturbance in (Disturbance(), *disturbances(course.kinds, course.seed)):
            self._recorder.start(plan=plan, domain=domain_of(plan, disturbance))
            rollout, _ = self._recorder.run(DURATION)
            success, recovery = succeeded(rollout), None
            if not disturbance.kind and success:
                band = recovery_band(rollout)
            if disturbance.kind == "push" and success and band is not None:
                end = push_sample(plan, disturbance.phase) + _PUSH_SAMPLES
                recovery = recovery_time(rollout, end, band)
            value = normalized_return(rollout)
            outcomes.append(
                Outcome(disturbance, success, rollout.fell, value, recovery)
            )
        return outcomes


def run_courses(
    scenario: Scenario, courses: Sequence[Course], executor: Executor = LOCAL
) -> Iterator[list[Outcome]]:
    """Yields the outcomes of each course, in order.

    Args:
        scenario: with a generated reference and a policy.
        courses: what to run.
        executor: runs them.
    """
    return executor.map(partial(_Runner, scenario), courses)


def summarize(
    courses: Sequence[Course], outcomes: Iterable[list[Outcome]]
) -> dict[str, Any]:
    """Returns ``{"labels": {LABEL: figures}, "all": figures}``."""
    by_label: dict[str, list[Outcome]] = {}
    for course, own in zip(courses, outcomes, strict=True):
        by_label.setdefault(course.label, []).extend(own)
    kinds = courses[0].kinds
    every = [outcome for own in by_label.values() for outcome in own]
    return {
        "labels": {label: figures(own, kinds) for label, own in by_label.items()},
        "all": figures(every, kinds),
    }


def figures(outcomes: Sequence[Outcome], kinds: Sequence[str]) -> dict[str, Any]:
    """Returns the figures of the outcomes of some courses of the same kinds.

    ``success`` is the mean of each curve over its levels but the undisturbed one,
    ``recovery_s`` the median over all pushes that the robot recovered from. What was
    not asked for is null.
    """
    calm = [o for o in outcomes if not o.disturbance.kind]
    curves = {name: _curve(outcomes, calm, name) for name in curve_names(kinds)}
    push = curves.get("push", {"level_80_percent_interval": [None, None]})
    return {
        "impulse_80_percent_ns": push.get("level_80_percent"),
        "impulse_80_percent_interval_ns": push["level_80_percent_interval"],
        "impulse_80_percent_beyond": push.get("level_80_percent_beyond"),
        "recovery_s": _median(o.recovery for o in outcomes),
        "success": {
            "undisturbed": float(np.mean([o.success for o in calm])),
            **{name: float(np.mean(c["success"][1:])) for name, c in curves.items()},
        },
        "undisturbed_return": float(np.mean([o.normalized_return for o in calm])),
        "episodes": len(outcomes),
        "curves": curves,
    }


def _curve(
    outcomes: Sequence[Outcome], calm: Sequence[Outcome], name: str
) -> dict[str, Any]:
    kind = KINDS[name.split("_")[0]]
    own = [o for o in outcomes if name in o.disturbance.curves]
    at = [calm] + [[o for o in own if o.disturbance.level == v] for v in kind.levels]
    levels = [kind.nominal, *kind.levels]
    won = [sum(o.success for o in part) for part in at]
    counts = [len(part) for part in at]
    threshold = success_threshold(levels, won, counts)
    curve: dict[str, Any] = {
        "levels": [float(level) for level in levels],
        "success": [float(np.mean([o.success for o in part])) for part in at],
        "falls": [float(np.mean([o.fell for o in part])) for part in at],
        "episodes": counts,
        "level_80_percent": threshold.level,
        "level_80_percent_interval": [threshold.low, threshold.high],
        "level_80_percent_beyond": threshold.beyond,
    }
    if name.startswith("push"):
        curve["recovery_s"] = [_median(o.recovery for o in part) for part in at]
    return curve


def _median(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else None
