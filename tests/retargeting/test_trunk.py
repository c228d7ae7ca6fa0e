import numpy as np
import pytest

from loco_drake.motion.motion import FPS
from loco_drake.retargeting.correction import (
    FOLD_MARGIN,
    KNEE_CLEARANCE,
    raise_trunk,
    within_reach,
)
from loco_drake.retargeting.scaling import Targets


def standing(robot, height, ahead=0.0, frames=100):
    """Targets of a level trunk ``height`` m up, toes ``ahead`` m of their hips."""
    toes = robot.p_BHip + np.stack(
        (np.full(4, ahead), robot.abduction_offset, np.zeros(4)), axis=-1
    )
    toes[:, 2] = robot.foot_radius
    p_WB = np.tile([0.0, 0.0, height], (frames, 1))
    zero = np.zeros(frames)
    return Targets(p_WB, zero, zero, np.tile(toes, (frames, 1, 1)))


def knee_heights(robot, targets):
    """Heights of the knees of a level trunk: the thigh hangs down by l1 cos b."""
    thighs = robot.leg_joints(targets.p_BF)[:, 1::3]
    hips = robot.leg_joints(targets.p_BF)[:, 0::3]
    down = robot.thigh_length * np.cos(thighs) * np.cos(hips)
    side = robot.abduction_offset * np.sin(hips)
    return targets.p_WB[:, 2:] - down + side


def test_folded_leg_is_as_long_as_the_law_of_cosines_has_it(robot):
    """Go2: calf at -2.7227 rad, twice .213 m: 2 * .213 * cos(2.7227 / 2)."""
    length = 2 * robot.thigh_length * np.cos(robot.joint_lower[2] / 2)
    assert robot.folded_length == pytest.approx(length)


def test_usual_stance_is_left_alone(robot):
    targets = standing(robot, robot.stand_height)
    assert raise_trunk(targets, robot, FPS) is targets


def test_trunk_that_crouches_too_low_is_raised_to_where_legs_fold(robot):
    raised = raise_trunk(standing(robot, 0.08, ahead=-0.05), robot, FPS)
    lowest = robot.foot_radius + FOLD_MARGIN * robot.folded_length
    assert (raised.p_WB[:, 2] >= lowest - 0.002).all()
    assert raised.p_WB[:, 2].max() < lowest + 0.03


def test_trunk_is_raised_until_knees_clear_the_ground(robot):
    """Feet 10 cm ahead of hips at .15 m: the knees would be in the ground."""
    targets = standing(robot, 0.15, ahead=0.10)
    assert knee_heights(robot, targets).max() < 0.0
    raised = raise_trunk(targets, robot, FPS)
    knees = knee_heights(robot, raised)
    assert knees.min() >= KNEE_CLEARANCE - 0.002
    assert knees.min() < KNEE_CLEARANCE + 0.02
    np.testing.assert_array_equal(raised.p_WF, targets.p_WF)


def test_trunk_rises_and_sinks_gently_around_a_short_dip(robot):
    """A dip of .2 s: no lift half a second away, no acceleration beyond 20 m/s^2."""
    targets = standing(robot, robot.stand_height)
    dip = np.exp(-(((np.arange(100) - 50) / 5) ** 2))
    targets.p_WB[:, 2] -= dip * (robot.stand_height - 0.08)
    raised = raise_trunk(targets, robot, FPS)
    lift = raised.p_WB[:, 2] - targets.p_WB[:, 2]
    assert lift.max() > 0.03
    assert (lift[:25] == 0).all()
    assert (lift[75:] == 0).all()
    assert np.abs(np.diff(lift, 2)).max() * FPS**2 < 20


def test_toe_too_near_to_its_hip_is_moved_down_and_the_path_has_no_jump(robot):
    """A toe that swings through its own hip: the leg stays as long as when folded."""
    targets = standing(robot, robot.stand_height, frames=41)
    along = np.linspace(-0.15, 0.15, 41)
    targets.p_WF[:, 2, 0] = robot.p_BHip[2, 0] + along
    targets.p_WF[:, 2, 2] = robot.stand_height - 0.01
    reached = within_reach(targets, robot)
    p_VF = (reached.p_BF - robot.p_BHip)[:, 2]
    p_VF[:, 1] -= robot.abduction_offset[2]
    lengths = np.linalg.norm(p_VF, axis=-1)
    assert lengths.min() > robot.folded_length - 1e-6
    np.testing.assert_allclose(p_VF[:, 0], along, atol=1e-6)
    steps = np.linalg.norm(np.diff(reached.p_WF[:, 2], axis=0), axis=-1)
    assert steps.max() < 0.05
    np.testing.assert_allclose(reached.p_WF[:, 0], targets.p_WF[:, 0], atol=1e-12)
