import numpy as np
import pytest
from pydrake.solvers import SnoptSolver

from loco_drake.datasets.registry import read_clip
from loco_drake.retargeting.inverse_kinematics import LegSolver
from loco_drake.retargeting.retarget import retarget_clip
from tests.synthetic import write_dog_recording

FPS = 50.0


def swinging_joints(robot, frames=60, amplitude=0.3):
    beat = 2 * np.pi * 1.5 * np.arange(frames)[:, None] / FPS + np.arange(12)
    return robot.stand_joints + amplitude * np.sin(beat)


def test_joints_are_those_that_the_toes_came_from(robot, solver):
    """Forward, then inverse: the same joints, also from a start far away."""
    joints = swinging_joints(robot)
    found = solver.solve(robot.toe_positions(joints)).joints
    np.testing.assert_allclose(found, joints, atol=3e-4)


def test_target_out_of_reach_is_approached_within_the_limits(robot, solver):
    """A foot asked for .2 m below the longest leg: the leg stretches straight down."""
    p_BF = robot.toe_positions(robot.stand_joints)[None].repeat(30, axis=0)
    p_BF[:, 1, 2] = -0.6
    p_BF[:, 1, 0] = robot.p_BHip[1, 0]
    found = solver.solve(p_BF).joints
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
    found = solver.solve(robot.toe_positions(joints)).joints
    speeds = np.abs(np.diff(found, axis=0)) * FPS
    assert (speeds <= robot.joint_speed_limits).all()
    np.testing.assert_allclose(found[9], joints[9], atol=1e-3)
    np.testing.assert_allclose(found[-1], joints[-1], atol=1e-3)


def test_frames_without_a_solution_are_said_and_get_the_nearest_joints(robot):
    """A solver that may not iterate: the robot's closed form takes its place."""
    solver = LegSolver(robot, FPS)
    joints = swinging_joints(robot)
    p_BF = robot.toe_positions(joints)
    assert solver.solve(p_BF).solved.all()
    solver.options.SetOption(SnoptSolver.id(), "Major iterations limit", 0)
    found, solved = solver.solve(p_BF)
    assert not solved[1:].any()
    np.testing.assert_allclose(found, joints, atol=1e-6)


def test_motion_of_frames_without_a_solution_is_warned_of(robot, tmp_path):
    write_dog_recording(tmp_path / "dog.txt", "pace", seconds=1.0)
    clip = read_clip("dog", tmp_path / "dog.txt", gait="pace")
    solver = LegSolver(robot, FPS)
    solver.options.SetOption(SnoptSolver.id(), "Major iterations limit", 0)
    _, report = retarget_clip(clip, robot, solver=solver)
    assert report.unsolved_frames > 40
    expected = f"frames without a solution {report.unsolved_frames}, not at most 0"
    assert expected in report.warnings
