"""A plan recorded without a robot is the one that a robot tracks."""

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.control.action import set_points
from loco_drake.evaluation.tracking import Recorder
from loco_drake.systems.plan_recorder import PlanRecorder
from loco_drake.systems.scenario import (
    ExternalAction,
    GeneratedReference,
    PlanReference,
    Scenario,
)


def rollout(scenario, duration, **episode):
    """The record of a robot whose set-points are the plan's alone."""
    recorder = Recorder(scenario)
    recorder.diagram.GetInputPort("action").FixValue(recorder.context, np.zeros(12))
    recorder.start(**episode)
    return recorder.run(duration)[0]


def assert_tracked(robot, plan, record):
    """Where the robot is sent is in the plan, to the last bit; in a second at least."""
    count = len(record.state)
    assert count > 51
    samples = [plan.index(k * 0.02) for k in range(count)]
    np.testing.assert_array_equal(record.plan_state, plan.state[samples])
    np.testing.assert_array_equal(record.path_time, plan.path_time[samples])
    sent = set_points(robot, plan)[samples[1:]]
    np.testing.assert_array_equal(record.desired_joints[1:], sent)


def test_of_generated_motion_episode_by_episode(go2):
    scenario = Scenario(
        reference=GeneratedReference(gait="dog-trot"), policy=ExternalAction()
    )
    plans = PlanRecorder(scenario)
    for gait, seed in (("horse-walk", 1), ("dog-trot", 0)):
        plan = plans.record(2.0, gait=gait, seed=seed)
        assert plan.end_time > 2.5
        assert plan.start_time == 0.0
        record = rollout(scenario, 2.0, gait=gait, seed=seed)
        assert_tracked(go2, plan, record)


def test_of_a_plan_up_to_its_end(go2, trot):
    scenario = Scenario(reference=PlanReference(), policy=ExternalAction())
    plan = PlanRecorder(scenario).record(trot.end_time, plan=trot)
    assert trot.end_time <= plan.end_time < trot.end_time + 0.5
    np.testing.assert_allclose(plan.q[-1], trot.q[-1], atol=1e-12)
    assert_tracked(go2, plan, rollout(scenario, trot.end_time, plan=trot))


def test_what_the_reference_does_not_take_is_refused(trot):
    scenario = Scenario(reference=PlanReference())
    with pytest.raises(InputError, match="takes no seed"):
        PlanRecorder(scenario).record(1.0, seed=3)
