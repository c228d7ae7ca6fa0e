import numpy as np
import pytest

FPS = 50.0


def swinging_joints(robot, frames=60, amplitude=0.3):
    beat = 2 * np.pi * 1.5 * np.arange(frames)[:, None] / FPS + np.arange(12)
    return robot.stand_joints + amplitude * np.sin(beat)


def test_joints_are_those_that_the_toes_came_from(robot, solver):
    """Forward, then inverse: the same joints, also from a start far away."""
    joints = swinging_joints(robot)
    found = solver.solve(robot.toe_positions(joints))
    np.testing.assert_allclose(found, joints, atol=3e-4)


def test_target_out_of_reach_is_approached_within_the_limits(robot, solver):
    """A foot asked for .2 m below the longest leg: the leg stretches straight down."""
    p_BF = robot.toe_positions(robot.stand_joints)[None].repeat(30, axis=0)
    p_BF[:, 1, 2] = -0.6
    p_BF[:, 1, 0] = robot.p_BHip[1, 0]
    found = solver.solve(p_BF)
    assert (found >= robot.joint_lower).all()
    assert (found <= robot.joint_upper).all()
    toes = robot.toe_positions(found)
    others = [0, 2, 3]
    np.testing.assert_allclose(toes[:, others], p_BF[:, others], atol=1e-3)
    assert found[-1, 5] == pytest.approx(robot.joint_upper[5], abs=1e-3)
    assert toes[-1, 1, 0] == pytest.approx(p_BF[0, 1, 0], abs=5e-3)


def test_jump_is_spread_over_as_many_frames_as_the_speed_limit_asks(robot, solver):
    """Toes jump to those of joints 1 rad away: no joint is faster than it may be."""
    joints = np.repeat(robot.stand_joints[None], 20, axis=0)
    joints[10:, 1::3] += 1.0
    found = solver.solve(robot.toe_positions(joints))
    speeds = np.abs(np.diff(found, axis=0)) * FPS
    assert (speeds <= robot.joint_speed_limits).all()
    np.testing.assert_allclose(found[9], joints[9], atol=1e-3)
    np.testing.assert_allclose(found[-1], joints[-1], atol=1e-3)
