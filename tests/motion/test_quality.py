from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from loco_drake.models.robots import get_robot
from loco_drake.motion import quality
from loco_drake.motion.gaits import GaitLabel
from loco_drake.motion.motion import make_motion

RADIUS = 0.022


@pytest.fixture(scope="module")
def robot():
    return get_robot("go2")


def by_hand():
    """Five frames of four toes at 50 Hz, lowest points given in m.

    FL stands and slides by 1 mm a frame in x; FR hovers at 9.9 mm and slides by 3, 4 mm
    in x, y; RL hovers at 10.1 mm, which is no stance; RR touches in single frames only.
    """
    p_WF = np.zeros((5, 4, 3))
    p_WF[..., 2] = RADIUS
    p_WF[:, 0, 0] = 0.001 * np.arange(5)
    p_WF[:, 1, :2] = np.arange(5)[:, None] * [0.003, 0.004]
    p_WF[:, 1, 2] += 0.0099
    p_WF[:, 2, 0] = np.arange(5)
    p_WF[:, 2, 2] += 0.0101
    p_WF[:, 3, 0] = np.arange(5)
    p_WF[:, 3, 2] += [0.0, 0.05, 0.0, 0.05, 0.0]
    return p_WF


def test_slip_by_hand():
    """Four steps of .05 m/s (FL) and four of .25 m/s (FR): the median is .15 m/s."""
    speeds = quality.stance_slip_speeds(by_hand(), RADIUS, 50.0)
    np.testing.assert_allclose(np.sort(speeds), [0.05] * 4 + [0.25] * 4)
    assert quality.stance_slip_median(by_hand(), RADIUS, 50.0) == pytest.approx(0.15)


def test_slip_of_a_clip_in_the_air_is_none_rather_than_zero():
    airborne = by_hand() + np.array([0, 0, 0.1])
    assert quality.stance_slip_median(airborne, RADIUS, 50.0) is None


def test_sunk_feet_count_as_stance():
    sunk = by_hand() - [0, 0, 0.05]
    assert len(quality.stance_slip_speeds(sunk, RADIUS, 50.0)) == 4 * 4


def test_penetration_by_hand():
    p_WF = by_hand()
    assert quality.penetration_max(p_WF, RADIUS) == 0.0
    p_WF[3, 2, 2] = RADIUS - 0.004
    assert quality.penetration_max(p_WF, RADIUS) == pytest.approx(0.004)


def test_joint_limits_and_speeds_by_hand(robot):
    """Two angles are beyond their limits; one moves .301 rad in 20 ms: half 30.1."""
    joints = np.repeat(robot.stand_joints[None], 4, axis=0)
    assert quality.joint_limit_violations(joints, robot) == 0
    assert quality.joint_speed_ratio_max(joints, robot, 50.0) == 0.0
    joints[2:, 1] += 0.301
    assert quality.joint_speed_ratio_max(joints, robot, 50.0) == pytest.approx(0.5)
    joints[1, 0], joints[3, 11] = robot.joint_upper[0] + 0.01, -3.0
    assert quality.joint_limit_violations(joints, robot) == 2


def test_distance_rmse_by_hand():
    """Distances 5 and 0: the root of 25 / 2."""
    a = np.array([[3.0, 4.0, 0.0], [1.0, 1.0, 1.0]])
    b = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
    assert quality.distance_rmse(a, b) == pytest.approx(np.sqrt(12.5))


def test_toes_of_a_turned_and_pitched_robot(robot):
    """In the usual stance a toe is right below its thigh joint, seen from the trunk."""
    R_WB = Rotation.from_euler("ZYX", [0.7, 0.2, 0.0])
    motion = make_motion(
        robot=robot.name,
        label=GaitLabel("dog", "trot"),
        joint_names=robot.joint_names,
        base_position=np.tile([1.0, 2.0, 0.5], (3, 1)),
        base_quaternion=np.tile(R_WB.as_quat(scalar_first=True), (3, 1)),
        joint_positions=np.tile(robot.stand_joints, (3, 1)),
        contacts=np.zeros((3, 4), dtype=bool),
        provenance={},
    )
    p_WF = quality.toe_trajectories(motion, robot)
    drop = robot.stand_height - robot.foot_radius
    for leg in range(4):
        p_BF = robot.p_BHip[leg] + [0, robot.abduction_offset[leg], -drop]
        expected = motion.base_position[1] + R_WB.apply(p_BF)
        np.testing.assert_allclose(p_WF[1, leg], expected, atol=1e-3)


def test_bad_motion_scores_badly(robot):
    """A robot dragged along on stiff legs skates at its trunk's speed, and sinks."""
    frames = 50
    along = 0.5 * np.arange(frames) / 50.0
    height = np.full(frames, robot.stand_height - 0.01)
    still = make_motion(
        robot=robot.name,
        label=GaitLabel("dog", "trot"),
        joint_names=robot.joint_names,
        base_position=np.stack((0 * along, 0 * along, height + 0.01), axis=-1),
        base_quaternion=np.tile([1.0, 0, 0, 0], (frames, 1)),
        joint_positions=np.tile(robot.stand_joints, (frames, 1)),
        contacts=np.ones((frames, 4), dtype=bool),
        provenance={},
    )
    dragged = replace(
        still, base_position=np.stack((along, 0 * along, height), axis=-1)
    )
    scores = []
    for motion in (still, dragged):
        p_WF = quality.toe_trajectories(motion, robot)
        slip = quality.stance_slip_median(p_WF, robot.foot_radius, 50.0)
        scores.append((slip, quality.penetration_max(p_WF, robot.foot_radius)))
    np.testing.assert_allclose(scores, [(0.0, 0.0), (0.5, 0.01)], atol=1e-9)
