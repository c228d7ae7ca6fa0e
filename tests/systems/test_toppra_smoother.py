from dataclasses import replace

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from loco_drake.control.plan import PLAN_DT, plan_from_motion
from loco_drake.control.retiming import PathLimits, path_limits, smooth_plan
from loco_drake.systems.control import PlanPlayer
from loco_drake.systems.toppra_smoother import ToppraSmoother
from tests.synthetic_motion import synthetic_motion


def tight(robot, share):
    """Limits of the joints below what the plan asks for."""
    own = path_limits(robot)
    acceleration = own.acceleration.copy()
    acceleration[:12] *= share
    return PathLimits(own.speed, acceleration)


def build(robot, plan, limits):
    builder = DiagramBuilder()
    player = builder.AddNamedSystem("player", PlanPlayer(robot, plan))
    smoother = builder.AddNamedSystem("smoother", ToppraSmoother(robot, limits=limits))
    builder.Connect(player.GetOutputPort("plan"), smoother.GetInputPort("plan"))
    builder.ExportOutput(smoother.GetOutputPort("plan"), "plan")
    builder.ExportOutput(smoother.GetOutputPort("path_time"), "path_time")
    return builder.Build()


def test_a_plan_within_the_limits_passes_unchanged(go2, trot):
    smooth = smooth_plan(go2, trot, path_limits(go2))
    np.testing.assert_allclose(smooth.q, trot.q, atol=1e-12)
    np.testing.assert_allclose(smooth.v, trot.v, atol=1e-12)
    np.testing.assert_array_equal(smooth.contacts, trot.contacts)
    np.testing.assert_allclose(smooth.path_time, trot.path_time, atol=1e-12)


def test_what_is_played_keeps_the_limits_and_the_path(go2, trot):
    limits = tight(go2, 0.08)
    raw = np.abs(np.diff(trot.q[:, 7:], n=2, axis=0)).max(axis=0) / PLAN_DT**2
    limit = limits.acceleration[:12, 1]
    assert (raw > 1.3 * limit).any()
    smooth = smooth_plan(go2, trot, limits)
    played = np.abs(np.diff(smooth.q[:, 7:], n=2, axis=0)).max(axis=0) / PLAN_DT**2
    assert (played <= 1.1 * limit).all()
    assert len(smooth) > 1.05 * len(trot)
    assert np.diff(smooth.path_time).max() <= PLAN_DT * (1 + 1e-9)
    # The same feet, later: the toes of the raw plan at the time that has passed.
    k = np.rint(smooth.path_time / PLAN_DT).astype(int)
    np.testing.assert_array_equal(smooth.contacts, trot.contacts[k])
    at = np.stack(
        [np.interp(smooth.path_time, trot.path_time, x) for x in trot.q[:, 7:].T], 1
    )
    np.testing.assert_allclose(smooth.q[:, 7:], at, atol=0.03)


def test_joints_stay_within_their_limits_between_samples(go2, trot):
    """The calves rest at their limits, which a spline of the samples overshoots."""
    limit = np.quantile(trot.q[:, 9::3], 0.8)
    upper = np.where(np.arange(12) % 3 == 2, limit, go2.joint_upper)
    q = trot.q.copy()
    q[:, 7:] = np.minimum(q[:, 7:], upper)
    robot, plan = replace(go2, joint_upper=upper), replace(trot, q=q)
    smooth = smooth_plan(robot, plan, tight(robot, 0.08))
    off = np.abs(smooth.path_time / PLAN_DT - np.rint(smooth.path_time / PLAN_DT))
    assert (off > 0.1).mean() > 0.5  # most of what is played lies between samples
    joints = smooth.q[:, 7:]
    assert (joints <= upper + 1e-8).all()
    assert (joints >= go2.joint_lower - 1e-8).all()
    # As often at the limit as before.
    at_limit, before = ((a[:, 2::3] > limit - 1e-8).mean() for a in (joints, q[:, 7:]))
    assert at_limit > 0.3 * before


def test_a_clock_that_was_slowed_returns_to_the_samples_of_the_plan(go2):
    """One burst of the calves is slowed; what comes after it is the plan again."""
    trot = plan_from_motion(go2, synthetic_motion("dog-trot", 8.0, 0.5))
    q = trot.q.copy()
    q[95:105, 9::3] += 0.3 * np.sin(np.pi * np.arange(10) / 5)[:, None]
    burst = replace(trot, q=q)
    limits = path_limits(go2)
    quiet = np.abs(np.diff(trot.q[:, 9], n=2)).max() / PLAN_DT**2
    acceleration = limits.acceleration.copy()
    acceleration[:12] = np.array([-3.0, 3.0]) * quiet
    smooth = smooth_plan(go2, burst, PathLimits(limits.speed, acceleration))
    index = smooth.path_time / PLAN_DT
    off = np.abs(index - np.rint(index))
    slow = np.diff(index) < 1 - 1e-9
    assert off[100:140].max() > 0.05  # it was slowed
    assert np.flatnonzero(slow).max() < 260  # and has waited within two chunks
    assert off[260:].max() < 1e-9
    k = np.rint(index[260:]).astype(int)
    np.testing.assert_allclose(smooth.q[260:], burst.q[k], atol=1e-9)
    assert len(smooth) <= len(burst) + 20


def test_no_foot_is_below_the_ground_between_samples(go2, trot):
    smooth = smooth_plan(go2, trot, tight(go2, 0.08))
    ground = min(go2.foot_radius, trot.p_WF[..., 2].min())
    assert smooth.p_WF[..., 2].min() > ground - 1e-6


def test_velocities_are_those_of_what_is_played(go2, trot):
    smooth = smooth_plan(go2, trot, tight(go2, 0.08))
    differences = np.gradient(smooth.q[:, 4:], PLAN_DT, axis=0)[1:-1]
    error = smooth.v[1:-1, 3:] - differences
    assert np.sqrt(np.mean(error**2)) < 0.1 * np.sqrt(np.mean(differences**2))


@pytest.mark.parametrize("share", [1.0, 0.08])
def test_the_system_plays_what_smoothing_at_once_gives(go2, trot, share):
    limits = tight(go2, share)
    whole = smooth_plan(go2, trot, limits)
    diagram = build(go2, trot, limits)
    simulator = Simulator(diagram)
    context = simulator.get_context()
    for time in (0.0, 0.5, 1.7, 3.0):
        simulator.AdvanceTo(time)
        plan = diagram.GetOutputPort("plan").Eval(context)
        assert plan.start_time <= time
        assert plan.end_time >= time + 0.9  # it looks ahead
        k, n = plan.index(time), whole.index(time)
        np.testing.assert_array_equal(plan.q[k : k + 40], whole.q[n : n + 40])
        used = diagram.GetOutputPort("path_time").Eval(context)[0]
        assert used == plan.path_time[-1]


def test_what_was_committed_never_changes(go2, trot):
    diagram = build(go2, trot, tight(go2, 0.08))
    simulator = Simulator(diagram)
    simulator.Initialize()
    context = simulator.get_context()
    seen = {}
    for step in range(30):
        simulator.AdvanceTo(0.1 * step)
        plan = diagram.GetOutputPort("plan").Eval(context)
        for k in range(len(plan)):
            n = round(plan.start_time / PLAN_DT) + k
            q = seen.setdefault(n, plan.q[k])
            np.testing.assert_array_equal(q, plan.q[k])
    assert len(seen) > 180
