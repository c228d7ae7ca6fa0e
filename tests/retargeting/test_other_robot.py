"""The documentation's example: recordings retargeted to a robot that is only a file.

Toes are told by Drake's plant, not by the kinematics that retargeting used.
"""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from loco_drake.common.rotations import yaw_of
from loco_drake.models.robots import load_robot
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.motion.motion import FPS
from loco_drake.motion.quality import stance_slip_median
from loco_drake.retargeting.inverse_kinematics import LegSolver
from loco_drake.retargeting.retarget import retarget_clip
from loco_drake.retargeting.scaling import Variant, load_config
from tests.robot_files import FOREIGN, SOLO8, write_robot
from tests.synthetic import GAITS, STANCE_HEIGHT, make_dog


@pytest.fixture(scope="module")
def solo8():
    return load_robot(str(SOLO8))


@pytest.fixture(scope="module")
def solver(solo8):
    return LegSolver(solo8, FPS)


def dog_clip(gait, turn=0.0):
    """A made dog; with ``turn`` its path bends to the left, rad/s."""
    dog = make_dog(gait)
    points = [dog.withers, dog.hip, *dog.toes.swapaxes(0, 1)]
    if turn:
        # The plane is bent so that x runs along a circle: what stands still stays so.
        radius = GAITS[gait].speed / turn
        points = [bent(p, radius) for p in points]
    withers, hip, *toes = points
    return KeypointClip("dog", gait, 60.0, withers, hip, np.stack(toes, axis=1), {})


def bent(points, radius):
    angle, side = points[:, 0] / radius, radius - points[:, 1]
    x, y = side * np.sin(angle), radius - side * np.cos(angle)
    return np.stack((x, y, points[:, 2]), axis=-1)


def plant_toes(motion, robot):
    """Centres of the toes in the world, by Drake, shape (T, 4, 3)."""
    plant = MultibodyPlant(0.0)
    robot.AddModel(Parser(plant))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    feet = [plant.GetFrameByName(foot) for foot in robot.foot_frames]
    toes = []
    for k in range(len(motion)):
        pose = (*motion.base_quaternion[k], *motion.base_position[k])
        (floating,) = plant.GetFloatingBaseBodies()
        body = plant.get_body(floating)
        positions = plant.GetPositions(context)
        start = body.floating_positions_start()
        positions[start : start + 7] = pose
        for name, angle in zip(
            motion.joint_names, motion.joint_positions[k], strict=True
        ):
            positions[plant.GetJointByName(name).position_start()] = angle
        plant.SetPositions(context, positions)
        toes.append([foot.CalcPoseInWorld(context).translation() for foot in feet])
    return np.array(toes)


@pytest.mark.parametrize("gait", ["pace", "trot", "gallop"])
def test_a_dog_that_runs_straight_becomes_a_solo8_on_still_feet(solo8, solver, gait):
    """At scaled speed and height; a Motion of 8 joints, feet in their planes."""
    motion, report = retarget_clip(dog_clip(gait), solo8, solver=solver)
    assert (motion.robot, motion.joint_positions.shape) == ("solo8", (200, 8))
    assert motion.joint_names == solo8.joint_names
    toes = plant_toes(motion, solo8)
    assert stance_slip_median(toes, 0.016, FPS) <= 0.002
    assert toes[..., 2].min() >= 0.016 - 1e-4
    planes = np.broadcast_to([0.15005, -0.15005, 0.15005, -0.15005], (200, 4))
    np.testing.assert_allclose(toes[..., 1], planes, atol=1e-4)
    assert report.joint_limit_violations == 0
    assert report.joint_speed_ratio_max < 1.0
    assert report.toe_error_rmse_m < 1e-4
    assert (motion.joint_positions[:, [1, 3]] < 0).all()  # front knees
    assert (motion.joint_positions[:, [5, 7]] > 0).all()  # rear ones
    scale = solo8.stand_height / STANCE_HEIGHT
    speed = scale * GAITS[gait].speed
    np.testing.assert_allclose(motion.base_velocity[:, 0], speed, atol=0.01)
    np.testing.assert_allclose(
        motion.base_position[:, 2], solo8.stand_height, rtol=0.02
    )


def test_toes_lie_where_the_formula_puts_them(solo8, solver):
    """Along the way: the dog's, scaled; hips .05 and -.11 heights off the trunk."""
    motion, _ = retarget_clip(dog_clip("pace"), solo8, solver=solver)
    dog = make_dog("pace")
    scale = solo8.stand_height / STANCE_HEIGHT
    along = (dog.withers - dog.hip)[0]
    along = along / np.linalg.norm(along) * STANCE_HEIGHT
    toes = plant_toes(motion, solo8)
    frames = np.arange(0, len(motion) - 5, 5)  # each fifth of 50 Hz is sixth of 60 Hz
    for leg in range(4):
        point = dog.withers + 0.05 * along if leg < 2 else dog.hip - 0.11 * along
        middle = scale * (dog.withers + dog.hip) / 2
        expected = middle + scale * (dog.toes[:, leg] - point)
        expected = expected[:, 0] + (0.19 if leg < 2 else -0.19)
        off = toes[frames, leg, 0] - expected[frames * 6 // 5]
        assert np.median(np.abs(off)) < 0.006


def test_on_a_bend_feet_slip_to_the_side_and_that_is_said(solo8, solver):
    """A hip .19 m off the trunk's middle goes .19 * .5 m/s to the side at .5 rad/s."""
    turn = 0.5
    motion, report = retarget_clip(dog_clip("pace", turn), solo8, solver=solver)
    toes = plant_toes(motion, solo8)
    low = toes[..., 2] < 0.016 + 0.002
    stance = low[1:] & low[:-1]
    velocity = np.diff(toes[..., :2], axis=0) * FPS
    yaw = yaw_of(motion.base_quaternion)[1:, None]
    ahead = np.stack((np.cos(yaw), np.sin(yaw)), axis=-1)
    aside = np.stack((-np.sin(yaw), np.cos(yaw)), axis=-1)
    along = np.abs((velocity * ahead).sum(axis=-1))[stance]
    across = np.abs((velocity * aside).sum(axis=-1))[stance]
    assert np.median(across) == pytest.approx(0.19 * turn, rel=0.15)
    assert np.median(along) < 0.02
    assert report.stance_slip_median_mps == pytest.approx(np.median(across), rel=0.1)
    assert report.penetration_max_m <= 0.002
    assert report.toe_error_rmse_m < 1e-4
    # What the toes lack to the side is a correction of the formula, not an error.
    straight = retarget_clip(dog_clip("pace"), solo8, solver=solver)[1]
    assert report.correction_rmse_m > straight.correction_rmse_m + 0.002


def test_mirrored_and_in_its_own_time(solo8, solver):
    """Legs change sides; joints about y keep their signs."""
    clip = dog_clip("gallop")
    variant = Variant(mirror=True, froude=True)
    motion, report = retarget_clip(clip, solo8, solver=solver, variant=variant)
    one, _ = retarget_clip(clip, solo8, solver=solver, variant=Variant(froude=True))
    assert report.time_scale == pytest.approx(
        np.sqrt(solo8.stand_height / STANCE_HEIGHT), rel=1e-4
    )
    swapped = one.joint_positions[:, [2, 3, 0, 1, 6, 7, 4, 5]]
    np.testing.assert_allclose(motion.joint_positions, swapped, atol=1e-3)


@pytest.mark.parametrize("name", FOREIGN)
def test_twelve_joints_of_any_urdf_keep_all_guarantees(tmp_path, name):
    """ANYmal's knees point at each other; Laikago's URDF has the right legs first."""
    robot = load_robot(str(write_robot(tmp_path / f"{name}.yaml", name)))
    motion, report = retarget_clip(dog_clip("trot", turn=0.3), robot)
    toes = plant_toes(motion, robot)
    assert stance_slip_median(toes, robot.foot_radius, FPS) <= 0.005
    assert report.penetration_max_m <= 0.002
    assert report.joint_limit_violations == 0
    assert report.joint_speed_ratio_max <= 1.0
    assert report.toe_error_rmse_m < 1e-3


def test_low_trunk_is_raised_where_knees_would_touch_the_ground(solo8, solver):
    """A dog that creeps .14 m up is .076 m at Solo8's size: knees would be lower."""
    clip = dog_clip("pace")
    drop = np.array([0.0, 0.0, 0.3])
    low = replace(clip, withers=clip.withers - drop, hip=clip.hip - drop)
    config = replace(load_config("dog"), stance_height=STANCE_HEIGHT)
    motion, report = retarget_clip(low, solo8, solver=solver, config=config)
    assert report.trunk_correction_rmse_m > 0.02
    knees = solo8.knee_positions(motion.joint_positions)[..., 2]
    heights = motion.base_position[:, 2:] + knees
    assert heights.min() > 0.02
