import numpy as np
import pytest
from pydrake.multibody.optimization import Toppra
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint, SpatialInertia, UnitInertia
from pydrake.trajectories import PiecewisePolynomial
from scipy.interpolate import CubicSpline

from loco_drake.control.plan import PLAN_DT
from loco_drake.control.retiming import PathLimits, path_limits, retime
from loco_drake.models.robots import get_robot

TIMES = np.arange(151) * PLAN_DT
MARGIN = 0.5  # s of waypoints before and after what is timed


def swing(amplitude, frequency, burst=True):
    """Two joints that swing, in a burst in the middle unless told otherwise."""
    window = np.exp(-(((TIMES - 1.5) / 0.25) ** 2)) if burst else np.ones_like(TIMES)
    phase = 2 * np.pi * frequency * TIMES
    return amplitude * window[:, None] * np.stack((np.sin(phase), np.cos(phase)), 1)


def limits(speed, acceleration):
    return PathLimits(np.full(2, speed), np.tile([-acceleration, acceleration], (2, 1)))


def timed(joints, limit, start_rate=1.0):
    return retime(
        TIMES, joints, limit, start=MARGIN, end=2.5, commit=2.5, start_rate=start_rate
    )


def test_a_feasible_plan_keeps_its_timing_exactly():
    clock = timed(swing(0.3, 2.0), limits(10.0, 100.0))
    np.testing.assert_allclose(clock.path_time, MARGIN + PLAN_DT * np.arange(101))
    np.testing.assert_array_equal(clock.rate, 1.0)


@pytest.mark.parametrize("limit", [limits(2.0, 1e4), limits(1e4, 40.0), limits(3, 40)])
def test_an_infeasible_plan_keeps_the_limits_and_is_never_faster(limit):
    joints = swing(0.5, 2.0)
    clock = timed(joints, limit)
    spline = CubicSpline(TIMES, joints)
    # 4 s are far beyond what is needed, so something must be slower, nothing faster.
    assert len(clock.path_time) > 105
    assert clock.rate.max() <= 1.0
    assert np.diff(clock.path_time).max() <= PLAN_DT * (1 + 1e-9)
    speed = spline(clock.path_time, 1) * clock.rate[:, None]
    # Between grid points, which are 10 ms apart, the solver does not look.
    assert np.abs(speed).max() <= limit.speed[0] * 1.01
    # Finite differences of what is played, which know nothing of the solver.
    played = spline(clock.path_time)
    acceleration = np.diff(played, n=2, axis=0) / PLAN_DT**2
    assert np.abs(acceleration).max() <= limit.acceleration[0, 1] * 1.02
    # It is slow only where it must be.
    assert clock.rate[0] == pytest.approx(1.0, abs=1e-3)
    assert clock.rate[-1] == pytest.approx(1.0, abs=1e-3)


def test_drakes_own_toppra_finds_the_same_duration():
    """Same path, same limits, time as one more coordinate limited to speed 1."""
    joints = swing(0.5, 2.0)
    limit = limits(3.0, 40.0)
    grid = np.linspace(MARGIN, 2.5, 201)
    spline = CubicSpline(TIMES, joints)
    path = PiecewisePolynomial.CubicHermite(
        grid,
        np.vstack((spline(grid).T, grid)),
        np.vstack((spline(grid, 1).T, np.ones_like(grid))),
    )
    toppra = Toppra(path, _three_sliders(), grid)
    toppra.AddJointVelocityLimit([-3, -3, 0], [3, 3, 1])
    toppra.AddJointAccelerationLimit([-40, -40, -2], [40, 40, 2])
    theirs = toppra.SolvePathParameterization(1.0, 1.0)
    clock = timed(joints, limit)
    duration = (len(clock.path_time) - 1) * PLAN_DT
    # Ours is a multiple of PLAN_DT that stops short of the end by less than one.
    begin, end = theirs.start_time(), theirs.end_time()
    assert duration == pytest.approx(end - begin, abs=1.5 * PLAN_DT)
    assert duration > 2.2
    at = begin + PLAN_DT * np.arange(len(clock.path_time))
    path_time = np.array([theirs.value(min(t, end))[0, 0] for t in at])
    np.testing.assert_allclose(clock.path_time, path_time, atol=5e-3)


def _three_sliders():
    plant = MultibodyPlant(0.0)
    parent = plant.world_body()
    inertia = SpatialInertia(1.0, np.zeros(3), UnitInertia.SolidSphere(0.1))
    for i in range(3):
        body = plant.AddRigidBody(f"body{i}", inertia)
        plant.AddJoint(
            PrismaticJoint(
                f"joint{i}", parent.body_frame(), body.body_frame(), np.eye(3)[i]
            )
        )
        parent = body
    plant.Finalize()
    return plant


def test_a_plan_that_starts_beyond_its_limits_starts_slower():
    joints = swing(0.5, 2.0, burst=False)  # at 6 rad/s at all times
    clock = timed(joints, limits(3.0, 1e4))
    assert clock.rate[0] <= 0.51
    assert len(clock.path_time) - 1 == pytest.approx(2 * 100, abs=12)


def test_it_goes_on_from_the_rate_it_is_given():
    clock = timed(swing(0.3, 2.0), limits(10.0, 100.0), start_rate=0.5)
    assert clock.rate[0] == pytest.approx(0.5)
    assert clock.rate[-1] == pytest.approx(1.0)
    # From 1/2 to 1 at the 2 per s that the clock's own limit allows: .25 s, in which
    # it falls behind by a quarter of that.
    late = PLAN_DT * (len(clock.path_time) - 1) - (2.5 - MARGIN)
    assert late == pytest.approx(0.25 / 4, abs=PLAN_DT)


def test_limits_come_from_effort_and_inertia():
    """Go2's calf: 35.55 Nm on its leg's and rotor's inertia, worked by hand."""
    robot = get_robot("go2")
    inertia = robot.reflected_inertia[2] + 0.154 * (0.115**2 + 0.00548**2)
    inertia += 0.0011 + 0.04 * 0.213**2  # about the calf's own centre; the foot
    limit = path_limits(robot)
    assert limit.acceleration[2, 1] == pytest.approx(35.55 / inertia, rel=0.02)
    np.testing.assert_array_equal(
        limit.acceleration[:12, 0], -limit.acceleration[:12, 1]
    )
    np.testing.assert_array_equal(limit.speed[:12], robot.joint_speed_limits)


def test_a_hop_is_slowed_until_it_falls_like_any_body():
    """A hop whose flight falls with 1.96 g must last sqrt(1.96) = 1.4 times as long."""
    limit = PathLimits(np.array([np.inf]), np.array([[-9.81, np.inf]]))
    period, share, height = 0.4, 0.5, 0.5 * 1.96 * 9.81 * 0.1**2
    phase = TIMES / period % 1.0
    flight = height * (1 - ((phase - share / 2) / (share / 2)) ** 2)
    stance = height * (((phase - 1 + share / 2) / (share / 2)) ** 2 - 1)
    z = np.where(phase < share, flight, stance)[:, None]
    clock = timed(z, limit)
    played = CubicSpline(TIMES, z)(clock.path_time)[:, 0]
    fall = np.diff(played, n=2) / PLAN_DT**2
    assert fall.min() >= -9.81 * 1.1  # samples and corners of the spline
    airborne = CubicSpline(TIMES, z)(clock.path_time, 2)[:, 0] < -15
    assert clock.rate[airborne].mean() == pytest.approx(1 / 1.4, abs=0.06)
    # Pushing off may be as hard as it likes, and is slowed by what the clock needs.
    assert fall.max() > 12.0
    assert clock.rate.max() > 0.9
