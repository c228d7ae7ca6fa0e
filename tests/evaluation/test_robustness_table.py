"""Success curves of real simulations, and their aggregation by hand."""

from dataclasses import replace

import pytest
import torch

from loco_drake.control.actor import Actor, ActorConfig
from loco_drake.control.actor_file import save_actor
from loco_drake.evaluation.disturbances import DURATION, Disturbance
from loco_drake.evaluation.robustness_table import (
    Course,
    Outcome,
    figures,
    run_courses,
    summarize,
)
from loco_drake.evaluation.tracking_table import Trial, run_trials
from loco_drake.systems.scenario import GeneratedReference, Scenario, TrainedPolicy

SCENARIO = Scenario(reference=GeneratedReference(gait="horse-walk", duration=DURATION))
COURSE = Course("horse-walk", 0, ("latency",))


def outcome(kind="", level=0.0, success=True, recovery=None, **place):
    disturbance = Disturbance(kind, level, **place)
    return Outcome(disturbance, success, not success, 90.0, recovery)


def pushes(level, successes, of=10, recovery=None):
    return [
        outcome("push", level, k < successes, recovery, way="left", phase=50)
        for k in range(of)
    ]


def test_figures_by_hand():
    """All at 8, .9 at 16, .5 at 24, none at 32 N s: .8 at 18 N s."""
    outcomes = [
        outcome(),
        *pushes(8, 10, recovery=0.2),
        *pushes(16, 9, recovery=0.4),
        *pushes(24, 5, recovery=0.8),
        *pushes(32, 0),
    ]
    others = [
        outcome("push", level, way=way, phase=0)
        for level in (8, 16, 24, 32)
        for way in ("forward", "back", "right")
    ]
    found = figures([*outcomes, *others], ["push"])
    of_left = found["curves"]["push_left"]
    assert of_left["levels"] == [0.0, 8.0, 16.0, 24.0, 32.0]
    assert of_left["success"] == pytest.approx([1.0, 1.0, 0.9, 0.5, 0.0])
    assert of_left["falls"] == pytest.approx([0.0, 0.0, 0.1, 0.5, 1.0])
    assert of_left["episodes"] == [1, 10, 10, 10, 10]
    assert of_left["level_80_percent"] == pytest.approx(18.0)
    assert of_left["recovery_s"] == [None, 0.2, 0.4, 0.8, None]
    assert found["success"]["push_left"] == pytest.approx(0.6)
    assert found["success"]["undisturbed"] == 1.0
    assert found["curves"]["push"]["episodes"] == [1, 13, 13, 13, 13]
    assert found["impulse_80_percent_ns"] == found["curves"]["push"]["level_80_percent"]
    assert found["recovery_s"] == pytest.approx(0.4)  # of ten, ten and ten
    assert found["episodes"] == 53


def test_without_pushes_their_figures_are_null():
    outcomes = [outcome(), *(outcome("payload", v) for v in (2, 4, 8))]
    found = figures(outcomes, ["payload"])
    assert found["impulse_80_percent_ns"] is found["recovery_s"] is None
    assert list(found["curves"]) == ["payload"]
    assert found["curves"]["payload"]["level_80_percent_beyond"]


def test_undisturbed_it_is_what_evaluate_tracking_simulates():
    """The same return to the last bit; and the same outcomes again."""
    (first,) = run_courses(SCENARIO, [COURSE])
    (again,) = run_courses(SCENARIO, [COURSE])
    assert first == again
    calm, *late = first
    (episode,) = run_trials(SCENARIO, [Trial("horse-walk", 0, DURATION)])
    assert calm.normalized_return == episode.figures["normalized_return"]
    assert calm.success
    assert [o.disturbance.level for o in late] == [0.01, 0.02, 0.04]
    returns = [calm.normalized_return, *(o.normalized_return for o in late)]
    assert returns[1] < returns[0]
    assert returns[3] < returns[1]


def test_a_robot_whose_policy_sleeps_scores_badly(tmp_path):
    """Feed-forward alone walks; it does not gallop."""
    gait = "dog-gallop"
    actor = Actor(ActorConfig(robot="go2", labels=[gait]))
    with torch.no_grad():
        for weights in actor.parameters():
            weights.zero_()
    save_actor(actor, tmp_path / "asleep.safetensors")
    policy = TrainedPolicy(weights=tmp_path / "asleep.safetensors")
    reference = GeneratedReference(gait=gait, duration=DURATION)
    asleep = Scenario(reference=reference, policy=policy)
    course = replace(COURSE, label=gait)
    whole = summarize([course], run_courses(asleep, [course]))["all"]
    assert whole["success"]["undisturbed"] == 0.0
    assert whole["success"]["latency"] == 0.0
    assert whole["undisturbed_return"] < 60
