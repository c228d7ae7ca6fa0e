"""The picture of a humanoid."""

import numpy as np
from pydrake.math import RigidTransform

from loco_drake.datasets.human import read_human
from loco_drake.models.biped_file import read_biped
from loco_drake.motion.motion import FPS
from loco_drake.retargeting.biped import retarget_biped
from loco_drake.retargeting.scaling import RetargetConfig, resample
from loco_drake.viewing.source_clip import source_clip
from loco_drake.viewing.stage import Stage
from loco_drake.viewing.takes import Scene, Take
from tests.synthetic_human import HIGH, march, write_person


def test_a_humanoid_is_where_its_kinematics_says_and_stands_on_the_floor():
    g1 = read_biped("g1")
    random = np.random.default_rng(0)
    joints = random.uniform(g1.joint_lower, g1.joint_upper)
    q = np.concatenate(([1.0, 0, 0, 0, 0, 0, g1.stand_height], joints))
    scene = Scene((Take("", g1, 50.0, q[None]),))
    stage = Stage([scene])
    stage.set_up(scene, 0.0)
    plant = stage._plant
    context = stage._plant_context
    for k, name in enumerate(g1.joint_names):
        expected = q[4:7] + g1.joint_origins(joints)[k]
        body = plant.GetJointByName(name).child_body()
        placed = body.EvalPoseInWorld(context).translation()
        np.testing.assert_allclose(placed, expected, atol=1e-9)
    # Soles that can be seen end where they stand.
    foot = plant.GetBodyByName(g1.foot_frames[0])
    (sole,) = plant.GetVisualGeometriesForBody(foot)
    inspector = stage.query_object.inspector()
    X_FG = RigidTransform(inspector.GetPoseInFrame(sole))
    bottom = X_FG.translation()[2] - inspector.GetShape(sole).height() / 2
    np.testing.assert_allclose(bottom, g1.heel[2] - g1.foot_radius, atol=1e-9)


def test_the_person_is_shown_beside_in_its_size_and_time(tmp_path):
    path = write_person(tmp_path / "human_pybullet", march(0.8, speed=0.5))
    g1 = read_biped("g1")
    clip = read_human(path, cycles=2)
    config = RetargetConfig(stance_height=HIGH)
    motion, _ = retarget_biped(clip, g1, config=config)
    shown = resample(source_clip(motion, tmp_path), FPS)
    assert len(shown) == len(motion) == 79
    hips = motion.base_position + g1.p_BHip.mean(axis=0)
    np.testing.assert_allclose(shown.hip[:, :2], hips[:, :2], atol=0.02)
    assert (shown.withers[:, 2] > shown.hip[:, 2] + 0.3).all()
