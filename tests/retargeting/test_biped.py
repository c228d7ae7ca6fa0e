"""Human motion on a humanoid: the formula, what corrects it, and the result."""

from dataclasses import replace

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets.human import read_human
from loco_drake.evaluation.humanoid import biped_fidelity
from loco_drake.models.biped_file import read_biped
from loco_drake.motion.motion import FPS
from loco_drake.motion.motion_file import load_motion, save_motion
from loco_drake.motion.quality import toe_trajectories
from loco_drake.retargeting.biped import BipedSolver, retarget_biped
from loco_drake.retargeting.biped_correction import lower_pelvis, plant_soles
from loco_drake.retargeting.biped_scaling import direction, scale_to_biped
from loco_drake.retargeting.scaling import RetargetConfig, Variant
from tests.synthetic_human import HIGH, march, write_person


@pytest.fixture(scope="module")
def g1():
    return read_biped("g1")


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    return read_human(
        write_person(tmp_path_factory.mktemp("person"), march(2.4, speed=0.6))
    )


@pytest.fixture(scope="module")
def config():
    return RetargetConfig(stance_height=HIGH)


@pytest.fixture(scope="module")
def done(clip, g1, config):
    """The march on the G1."""
    return retarget_biped(clip, g1, config=config, solver=BipedSolver(g1, FPS))


def test_the_formula_keeps_directions_and_scales_lengths(clip, g1, config):
    targets = scale_to_biped(clip, HIGH, g1, config)
    alpha = g1.hip_height / HIGH
    hips = targets.p_WB + g1.p_BHip.mean(axis=0)
    np.testing.assert_allclose(hips, alpha * clip.middle, atol=1e-9)
    np.testing.assert_allclose(targets.q_WB, [[1, 0, 0, 0]] * len(clip), atol=1e-9)
    soles = clip.legs[:, :, 3:].mean(axis=2)
    away = targets.p_WS - (targets.p_WB[:, None] + g1.p_BV)
    np.testing.assert_allclose(
        away[..., :2], alpha * (soles - clip.hips)[..., :2], atol=1e-9
    )
    # The lowest end of each sole, over the ground.
    lowest = targets.foot_points(g1)[..., 2].min(axis=-1) - g1.foot_radius
    np.testing.assert_allclose(
        lowest, alpha * clip.legs[:, :, 3:, 2].min(axis=2).clip(0), atol=1e-9
    )
    bones = np.diff(clip.arms, axis=2)
    left, right = targets.p_BUpper[:, [0, 3, 5]], targets.p_BUpper[:, [1, 4, 6]]
    placed = np.diff(np.stack((left, right), axis=1), axis=2)
    np.testing.assert_allclose(np.linalg.norm(placed, axis=-1), [g1.arm_lengths] * 73)
    cosine = (placed * bones).sum(axis=-1)
    cosine /= np.linalg.norm(placed, axis=-1) * np.linalg.norm(bones, axis=-1)
    np.testing.assert_allclose(cosine, 1.0, atol=1e-9)


def test_virtual_hips_move_the_soles(clip, g1, config):
    usual = scale_to_biped(clip, HIGH, g1, config)
    other = replace(config, front_hip=0.1, hip_spread=0.05)
    moved = scale_to_biped(clip, HIGH, g1, other).p_WS - usual.p_WS
    expected = g1.hip_height * np.array([[-0.1, -0.05, 0], [-0.1, 0.05, 0]])
    np.testing.assert_allclose(moved, [expected] * len(clip), atol=1e-9)


def test_a_person_who_turns_takes_the_robot_along(clip, g1, config):
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    turned = replace(
        clip,
        spine=clip.spine @ turn.T,
        legs=clip.legs @ turn.T,
        arms=clip.arms @ turn.T,
    )
    a, b = (scale_to_biped(c, HIGH, g1, config) for c in (clip, turned))
    np.testing.assert_allclose(b.p_WB, a.p_WB @ turn.T, atol=1e-9)
    np.testing.assert_allclose(b.p_WS, a.p_WS @ turn.T, atol=1e-9)
    np.testing.assert_allclose(b.p_BUpper, a.p_BUpper, atol=1e-9)
    np.testing.assert_allclose(b.yaw - a.yaw, np.pi / 2, atol=1e-9)


def test_the_end_that_is_down_stands_while_a_sole_rolls(g1):
    """From the heel over the whole sole to the toe, the formula's foot gliding on."""
    t = np.linspace(-1, 1, 60)
    pitch = np.stack((-0.4 * t**3, np.zeros(60)), axis=-1)
    yaw = np.full((60, 2), 0.1)
    down = np.ones((60, 2), dtype=bool)
    down[:10, 0] = down[50:, 0] = False
    p_WS = np.zeros((60, 2, 3))
    p_WS[:, :, 0] = 0.2 * t[:, None]
    p_WS[..., 2] = g1.foot_radius
    p_WS[:10, 0, 2] = p_WS[50:, 0, 2] = 0.05
    planted = plant_soles(p_WS, yaw, pitch, down, g1, 7.0)
    half = g1.sole_length / 2 * direction(yaw, pitch)
    heel, toe = (planted - half)[:, 0], (planted + half)[:, 0]
    np.testing.assert_allclose(np.ptp(heel[10:30], axis=0), 0, atol=1e-6)
    np.testing.assert_allclose(np.ptp(toe[30:50], axis=0), 0, atol=1e-6)
    assert np.ptp(toe[10:30, 2]) > 0.015
    lowest = np.minimum(heel, toe)[:, 2]
    np.testing.assert_allclose(lowest[10:50], g1.foot_radius, atol=1e-6)
    assert lowest.min() > g1.foot_radius - 1e-6
    # The foot's path has no corner where the end changes.
    assert np.abs(np.diff(planted[10:50, 0], n=2, axis=0)).max() < 0.002


def test_the_pelvis_is_lowered_where_legs_are_too_short(clip, g1, config):
    targets = scale_to_biped(clip, HIGH, g1, config)
    wide = targets.p_WS.copy()
    wide[30:40, 0, 0] += 0.3
    low = lower_pelvis(replace(targets, p_WS=wide), g1)
    drop = targets.p_WB - low.p_WB
    assert (drop[:, :2] == 0).all()
    assert drop[35, 2] > 0.05 > drop[0, 2] >= 0
    away = np.linalg.norm(low.p_WB[:, None] + g1.p_BReach - low.ankles(g1), axis=-1)
    # Where both feet are on the ground, or one is far away.
    assert away[30:40, 0].max() < g1.leg_reach


def test_feet_stand_still_on_the_ground_within_the_limits(done, g1):
    motion, report = done
    assert report.frames == len(motion) == 121
    assert report.stance_slip_median_mps < 1e-3
    assert report.penetration_max_m < 1e-4
    assert report.toe_error_rmse_m < 1e-4
    assert report.joint_limit_violations == report.unsolved_frames == 0
    assert report.joint_limit_margin_rad > -1e-6
    assert report.joint_speed_ratio_max < 1
    assert report.on_feet_share == 1
    assert report.warnings == ()
    p_WF = toe_trajectories(motion, g1)
    assert p_WF.shape == (121, 8, 3)
    # Toes, and heels, of the left foot are where contacts say.
    down = motion.contacts[:, 0]
    assert p_WF[down, :2, 2].max() < 0.02 < p_WF[~down, :2, 2].max()


def test_the_chest_is_over_the_pelvis_and_arms_swing(done, g1):
    motion, report = done
    waist = motion.joint_positions[:, g1.leg_joints : g1.leg_joints + 3]
    np.testing.assert_allclose(waist, 0, atol=0.02)
    assert report.arm_error_rmse_m < 0.02
    left, right = (g1.joint_names.index(f"{s}_shoulder_pitch_joint") for s in SIDES)
    swing = motion.joint_positions[:, [left, right]]
    assert np.ptp(swing, axis=0).min() > 0.3
    assert np.corrcoef(swing.T)[0, 1] < -0.9


SIDES = ("left", "right")


def test_a_mirrored_person_moves_the_mirrored_robot(clip, g1, config, done):
    mirrored, report = retarget_biped(
        clip, g1, config=config, variant=Variant(mirror=True)
    )
    assert report.mirrored
    assert mirrored.provenance["mirrored"] == "left-right"
    motion, _ = done
    left = toe_trajectories(motion, g1)[:, [0, 1, 4, 5]]
    right = toe_trajectories(mirrored, g1)[:, [3, 2, 7, 6]] * np.array([1, -1, 1])
    np.testing.assert_allclose(left, right, atol=2e-3)


def test_the_rhythm_is_the_persons(clip, done, g1):
    motion, _ = done
    rhythm = biped_fidelity(clip, motion, g1)
    assert rhythm.stride_period_error < 0.02
    assert rhythm.phase_lag_error < 0.05


def test_dynamic_similarity_takes_less_time(clip, g1, config):
    motion, report = retarget_biped(
        clip, g1, config=config, variant=Variant(froude=True)
    )
    assert report.time_scale == pytest.approx((g1.hip_height / HIGH) ** 0.5)
    assert len(motion) == int(121 * report.time_scale)


def test_its_file_can_be_read_again(done, tmp_path):
    motion, _ = done
    save_motion(motion, tmp_path / "a.npz")
    again = load_motion(tmp_path / "a.npz")
    assert again.robot == "g1"
    np.testing.assert_array_equal(again.contacts, motion.contacts)


def test_a_clip_of_three_frames_is_refused(clip, g1, config):
    short = replace(clip, spine=clip.spine[:3], legs=clip.legs[:3], arms=clip.arms[:3])
    with pytest.raises(InputError, match="at least 4 frames, not 3"):
        retarget_biped(short, g1, config=config)


def test_the_walk_of_a_person(real_data, g1):
    path = real_data / "human_pybullet" / "humanoid3d_walk.txt"
    if not path.is_file():
        pytest.skip("loco-drake data fetch --source human has not been run")
    clip = read_human(path, cycles=3)
    motion, report = retarget_biped(clip, g1)
    assert report.warnings == ()
    assert report.stance_slip_median_mps < 1e-3
    assert report.penetration_max_m < 1e-3
    rhythm = biped_fidelity(clip, motion, g1)
    assert rhythm.stride_period_error < 0.05
