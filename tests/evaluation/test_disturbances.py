"""The worlds of disturbances against what they are described as."""

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.common.rotations import yaw_quat
from loco_drake.control.plan import make_plan
from loco_drake.evaluation.disturbances import (
    KINDS,
    Disturbance,
    curve_names,
    disturbances,
    domain_of,
    push_sample,
)
from loco_drake.models.robots import get_robot

SAMPLES = 301
LANDINGS = (90, 130, 170)  # samples at which FL lands: 1.8, 2.6 and 3.4 s


@pytest.fixture
def plan():
    """Along the y axis at .5 m/s, heading there; FL lands every .8 s."""
    robot = get_robot("go2")
    q = np.zeros((SAMPLES, 19))
    q[:, :4] = yaw_quat(np.full(SAMPLES, np.pi / 2))
    q[:, 4] = 0.4 * 0.02 * np.arange(SAMPLES)
    q[:, 6] = robot.stand_height
    q[:, 7:] = robot.stand_joints
    contacts = np.ones((SAMPLES, 4), bool)
    for landing in LANDINGS:
        contacts[landing - 20 : landing, 0] = False
    return make_plan(
        robot,
        q=q,
        v=np.zeros((SAMPLES, 18)),
        contacts=contacts,
        labels=np.zeros(SAMPLES, dtype=np.int64),
    )


def test_a_push_begins_with_the_first_landing_after_2_s_or_half_a_stride_later(plan):
    assert push_sample(plan, 0) == 130
    assert push_sample(plan, 50) == 150
    assert push_sample(plan.slice(0, 120), 50) == 100  # no landing: at 2 s


@pytest.mark.parametrize(
    ("way", "direction"),
    [("forward", (0, 1)), ("back", (0, -1)), ("left", (-1, 0)), ("right", (1, 0))],
)
def test_a_push_has_its_impulse_and_its_direction_in_the_heading(plan, way, direction):
    """16 N s in .1 s are 160 N; the heading is y, its left -x."""
    (push,) = domain_of(plan, Disturbance("push", 16.0, way, 0)).pushes
    assert (push.start, push.duration) == (pytest.approx(2.6), 0.1)
    np.testing.assert_allclose(push.force_W[:2], 160.0 * np.array(direction), atol=1e-9)


@pytest.mark.parametrize(
    ("way", "rise"), [("up", (1, 0)), ("down", (-1, 0)), ("side", (0, 1))]
)
def test_slopes_rise_along_against_and_across_x(plan, way, rise):
    terrain = domain_of(plan, Disturbance("slope", 6.0, way)).terrain
    expected = np.tan(np.deg2rad(6.0)) * np.array(rise)
    np.testing.assert_allclose(terrain.gradient, expected, atol=1e-12)


def test_a_step_is_ahead_of_the_plan(plan):
    """At 1.5 s the plan is at .6 m: the step is at .9 m."""
    terrain = domain_of(plan, Disturbance("step", 0.03)).terrain
    assert terrain.step == 0.03
    assert terrain.step_x == pytest.approx(0.9)


def test_the_other_worlds_differ_in_one_number(plan):
    assert domain_of(plan, Disturbance("friction", 0.3)).friction == 0.3
    assert domain_of(plan, Disturbance("payload", 4.0)).payload == 4.0
    assert domain_of(plan, Disturbance("latency", 0.02)).latency == 0.02
    calm = domain_of(plan, Disturbance())
    assert calm.friction is calm.payload is calm.terrain is None
    assert calm.latency == 0.0
    assert calm.pushes == ()


def test_each_kind_is_tried_at_every_level_in_every_way():
    """Pushes: 4 levels, 4 ways, the two phases in turns; slopes: 3 levels, 3 ways."""
    pushes = [list(disturbances(["push"], seed)) for seed in (0, 1)]
    assert len(pushes[0]) == 16
    for one, other in zip(*pushes, strict=True):
        assert {one.phase, other.phase} == {0, 50}
    for part in ("level", "way"):
        halves = [getattr(p, part) for p in pushes[0] if p.phase == 50]
        assert sorted(halves) == sorted(2 * sorted(set(halves)))
    assert len(list(disturbances(["slope"]))) == 9
    every = list(disturbances(list(KINDS)))
    assert len(set(every)) == len(every)
    names = curve_names(list(KINDS))
    assert {name for d in every for name in d.curves} == set(names)
    assert names[0] == "push"
    assert "push_phase_50" in names
    assert "slope_up" in names


def test_an_unknown_kind_is_refused():
    with pytest.raises(InputError, match="choices are push, slope, step"):
        list(disturbances(["wind"]))
