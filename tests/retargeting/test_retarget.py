from dataclasses import replace

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.common.rotations import yaw_of
from loco_drake.datasets.registry import read_clip
from loco_drake.datasets.segments import read_segments, select_segments
from loco_drake.motion import quality
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.motion.motion import FPS
from loco_drake.retargeting.correction import within_reach
from loco_drake.retargeting.inverse_kinematics import LegSolver
from loco_drake.retargeting.retarget import retarget_clip
from loco_drake.retargeting.scaling import Targets, load_config
from tests.synthetic import GAITS, STANCE_HEIGHT, make_dog, write_dog_recording


def assert_good(report):
    """The numbers to reach of the design's section 6."""
    assert report.stance_slip_median_mps <= 0.03
    assert report.penetration_max_m <= 0.002
    assert report.joint_limit_violations == 0
    assert report.joint_speed_ratio_max <= 1.0
    assert report.toe_error_rmse_m <= 0.010
    assert report.correction_rmse_m <= 0.030
    assert report.warnings == ()


@pytest.mark.parametrize("gait", ["pace", "trot", "gallop"])
def test_made_dog_becomes_a_motion_within_all_limits(tmp_path, robot, solver, gait):
    """At the scaled speed, heading along +x, at the robot's own height."""
    write_dog_recording(tmp_path / "dog.txt", gait)
    clip = read_clip("dog", tmp_path / "dog.txt", gait=gait)
    motion, report = retarget_clip(clip, robot, solver=solver)
    assert_good(report)
    assert (motion.robot, motion.fps, str(motion.label)) == (
        robot.name,
        50.0,
        f"dog-{gait}",
    )
    # 240 frames at 60 Hz are 3.983 s: 200 steps of 20 ms, rounded down.
    assert len(motion) == report.frames == 200
    scale = robot.stand_height / STANCE_HEIGHT
    assert report.scale == pytest.approx(scale, rel=1e-4)
    speed = scale * GAITS[gait].speed
    np.testing.assert_allclose(motion.base_velocity[:, 0], speed, atol=0.01)
    np.testing.assert_allclose(motion.base_velocity[:, 1:], 0, atol=0.01)
    np.testing.assert_allclose(
        motion.base_position[:, 2], robot.stand_height, rtol=1e-3
    )
    np.testing.assert_allclose(yaw_of(motion.base_quaternion), 0, atol=1e-3)
    assert motion.provenance["file"] == "dog.txt"
    assert float(motion.provenance["correction_rmse_m"]) == pytest.approx(
        report.correction_rmse_m, rel=1e-5
    )


@pytest.mark.parametrize("gait", ["pace", "trot", "gallop"])
def test_toes_lie_where_the_formula_puts_them(tmp_path, robot, solver, gait):
    """The formula on the truth of the made dog, by hand: within the correction.

    Mid-stance the dog's toe is right under a point that lies half (front) or half plus
    3 cm (rear) of the trunk from its middle; the virtual hips are .05 and -.11 of the
    stance height off it, along the trunk.
    """
    write_dog_recording(tmp_path / "dog.txt", gait)
    motion, _ = retarget_clip(
        read_clip("dog", tmp_path / "dog.txt", gait=gait), robot, solver=solver
    )
    dog = make_dog(gait)
    scale = robot.stand_height / STANCE_HEIGHT
    along = (dog.withers - dog.hip)[0]
    along = along / np.linalg.norm(along) * STANCE_HEIGHT
    pitch = -np.arcsin(along[2] / STANCE_HEIGHT)
    R_WB = np.array(
        [
            [np.cos(pitch), 0, np.sin(pitch)],
            [0, 1, 0],
            [-np.sin(pitch), 0, np.cos(pitch)],
        ]
    )
    p_WF = quality.toe_trajectories(motion, robot)
    frames = np.arange(0, len(motion) - 5, 5)  # each fifth of 50 Hz is sixth of 60 Hz
    errors = []
    for leg in range(4):
        point = dog.withers + 0.05 * along if leg < 2 else dog.hip - 0.11 * along
        offset = scale * (dog.toes[:, leg] - point)
        p_BV = robot.p_BHip[leg] + np.array([0, robot.abduction_offset[leg], 0])
        expected = scale * (dog.withers + dog.hip) / 2 + R_WB @ p_BV + offset
        expected[:, 2] = robot.foot_radius + scale * dog.toes[:, leg, 2]
        errors.append(p_WF[frames, leg] - expected[frames * 6 // 5])
    distances = np.linalg.norm(errors, axis=-1)
    assert np.median(distances) < 0.006
    assert np.sqrt((distances**2).mean()) < 0.012


def test_feet_on_the_ground_are_those_of_the_dog(tmp_path, robot, solver):
    """Trot: diagonal pairs together, half a stride apart, at the dog's duty factor."""
    write_dog_recording(tmp_path / "dog.txt", "trot")
    clip = read_clip("dog", tmp_path / "dog.txt", gait="trot")
    motion, _ = retarget_clip(clip, robot, solver=solver)
    p_WF = quality.toe_trajectories(motion, robot)
    down = p_WF[..., 2] - robot.foot_radius < 1e-3
    assert (down == motion.contacts).mean() > 0.97
    assert (motion.contacts[:, 0] == motion.contacts[:, 3]).mean() > 0.97
    assert (motion.contacts[:, 1] == motion.contacts[:, 2]).mean() > 0.97
    shift = round(GAITS["trot"].period / 2 * FPS)
    assert (motion.contacts[shift:, 0] == motion.contacts[:-shift, 1]).mean() > 0.95
    duty = GAITS["trot"].duty
    assert duty <= motion.contacts.mean() <= duty + 6 / 60 / GAITS["trot"].period


def sliding(clip, contacts, speed):
    """The clip with toes that slide by ``speed`` m/s in stance, and swing back."""
    toes = clip.toes.copy()
    for leg in range(4):
        offset = 0.0
        for k in range(len(clip)):
            offset = offset + speed / clip.fps if contacts[k, leg] else 0.8 * offset
            toes[k, leg, 0] += offset
    return KeypointClip(
        clip.source, clip.gait, clip.fps, clip.withers, clip.hip, toes, provenance={}
    )


def test_sliding_recording_gives_still_feet_and_a_larger_correction(
    tmp_path, robot, solver
):
    dog = write_dog_recording(tmp_path / "dog.txt", "pace")
    clip = read_clip("dog", tmp_path / "dog.txt", gait="pace")
    _, still = retarget_clip(clip, robot, solver=solver)
    slid_clip = sliding(clip, dog.contacts, 0.15)
    _, slid = retarget_clip(slid_clip, robot, solver=solver)
    assert slid.stance_slip_median_mps <= 0.03
    assert slid.correction_rmse_m > 3 * still.correction_rmse_m


def test_targets_beyond_the_legs_are_moved_to_their_ends(robot):
    """A toe .2 m too low comes to lie on the same line at the leg's full length."""
    joints = np.tile(robot.stand_joints, (1, 1))
    drop = robot.stand_height - robot.foot_radius
    p_BF = robot.p_BHip + np.stack(
        (np.zeros(4), robot.abduction_offset, np.full(4, -drop)), axis=-1
    )
    p_BF[2, 2] -= 0.2
    ones = np.ones((len(joints), 1))
    targets = Targets(ones * 0, ones[:, 0] * 0, ones[:, 0] * 0, p_BF[None])
    moved = within_reach(targets, robot).p_WF[0]
    np.testing.assert_allclose(moved[[0, 1, 3]], p_BF[[0, 1, 3]], atol=1e-12)
    knee = robot.joint_upper[8]
    l1, l2 = robot.thigh_length, robot.calf_length
    length = np.sqrt(l1**2 + l2**2 + 2 * l1 * l2 * np.cos(knee))
    np.testing.assert_allclose(moved[2, :2], p_BF[2, :2], atol=1e-6)
    assert moved[2, 2] == pytest.approx(-length)


def test_giant_strides_stay_within_limits_at_the_price_of_correction(
    tmp_path, robot, solver
):
    """Toes that swing twice as far as a leg is long: 0 violations, and it is said."""
    write_dog_recording(tmp_path / "dog.txt", "pace")
    clip = read_clip("dog", tmp_path / "dog.txt", gait="pace")
    clip.toes[..., 0] += 0.6 * np.sin(2 * np.pi * np.arange(len(clip)) / 60)[:, None]
    motion, report = retarget_clip(clip, robot, solver=solver)
    assert report.joint_limit_violations == 0
    assert report.joint_speed_ratio_max <= 1.0
    assert report.correction_rmse_m > 0.03
    assert np.isfinite(motion.joint_positions).all()


def test_config_given_by_hand_is_used(tmp_path, robot, solver):
    """A trunk 3 cm lower than the scale has it."""
    write_dog_recording(tmp_path / "dog.txt", "pace")
    clip = read_clip("dog", tmp_path / "dog.txt", gait="pace")
    config = load_config("dog")
    config.base_height_offset = -0.03
    motion, _ = retarget_clip(clip, robot, config=config, solver=solver)
    height = robot.stand_height - 0.03
    np.testing.assert_allclose(motion.base_position[:, 2], height, rtol=1e-3)


def test_same_clip_gives_the_same_motion_whatever_was_solved_before(tmp_path, robot):
    write_dog_recording(tmp_path / "dog.txt", "pace", seconds=1.0)
    clip = read_clip("dog", tmp_path / "dog.txt", gait="pace")
    solver = LegSolver(robot, FPS)
    first, _ = retarget_clip(clip, robot, solver=solver)
    second, _ = retarget_clip(clip, robot, solver=solver)
    np.testing.assert_array_equal(first.joint_positions, second.joint_positions)


def test_clip_of_two_frames_is_refused(tmp_path, robot, solver):
    write_dog_recording(tmp_path / "dog.txt", "pace", seconds=1.0)
    clip = read_clip("dog", tmp_path / "dog.txt", gait="pace")
    clip = replace(clip, withers=clip.withers[:2], hip=clip.hip[:2], toes=clip.toes[:2])
    with pytest.raises(InputError, match="at least 4 frames"):
        retarget_clip(clip, robot, solver=solver)


def test_real_dog_meets_the_numbers_of_the_design(real_data, robot, solver):
    """Every pace, trot and gallop of segments.csv."""
    segments = read_segments(real_data)
    chosen = select_segments(segments, "dog", ["pace", "trot", "gallop"])
    for segment in chosen:
        _, report = retarget_clip(segment.read(), robot, solver=solver)
        assert_good(report)
