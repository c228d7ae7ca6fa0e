"""Human motion: its files, its tree, and what is measured of them."""

import json

import numpy as np
import pytest
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from loco_drake.common.errors import InputError
from loco_drake.common.rotations import quat_rotate
from loco_drake.datasets.human import UNIT, pose, read_human, repeated
from loco_drake.datasets.human_file import read_capture, read_skeleton
from tests.synthetic_human import (
    HIGH,
    HIP,
    about,
    march,
    skeleton_text,
    turned_over,
    write_person,
)


def test_points_are_where_drake_puts_them(tmp_path):
    """With any rotations; what the URDF calls spherical Drake calls a ball."""
    random = np.random.default_rng(0)
    frames = march(seconds=0.3)
    frames[:, 4:] = random.normal(size=frames[:, 4:].shape)
    at = [4, 8, 12, 16, 21, 25, 30, 35, 39]
    for k in at:
        frames[:, k : k + 4] /= np.linalg.norm(frames[:, k : k + 4], axis=1)[:, None]
    path = write_person(tmp_path, frames)
    capture = read_capture(path)
    points = pose(read_skeleton(tmp_path / "humanoid.urdf"), capture)

    plant = MultibodyPlant(time_step=0.0)
    text = skeleton_text("ball").replace(
        "<robot ", '<robot xmlns:drake="http://drake.mit.edu" '
    )
    Parser(plant).AddModelsFromString(text, "urdf")
    plant.Finalize()
    context = plant.CreateDefaultContext()
    for k in range(len(frames)):
        R = RotationMatrix(Quaternion(capture.rotations["root"][k]))
        plant.SetFreeBodyPose(
            context, plant.GetBodyByName("root"), RigidTransform(R, np.zeros(3))
        )
        for name, q in capture.rotations.items():
            if name == "root":
                continue
            joint = plant.GetJointByName(name)
            R = RotationMatrix(Quaternion(q[k]))
            if joint.num_positions() == 3:
                joint.set_angles(context, RollPitchYaw(R).vector())
            else:
                angle = 2 * np.arctan2(q[k, 3], q[k, 0])
                joint.set_angle(context, angle)
        for name, placed in points.items():
            if name.endswith(("heel", "toe")):
                body = plant.GetBodyByName(f"{name.split('_')[0]}_ankle")
                x = 0.2 + (-0.35 if name.endswith("heel") else 0.35)
                p = body.EvalPoseInWorld(context) @ np.array([x, -0.2, 0.0])
            else:
                p = plant.GetBodyByName(name).EvalPoseInWorld(context).translation()
            expected = capture.root[k] + UNIT * p
            np.testing.assert_allclose(placed[k], expected, atol=1e-12)


def test_a_person_stands_on_the_ground_and_faces_along_x(tmp_path):
    clip = read_human(write_person(tmp_path))
    assert (clip.source, clip.gait, clip.fps) == ("human", "march", 30.0)
    np.testing.assert_allclose(clip.middle[0, :2], 0.0, atol=1e-9)
    np.testing.assert_allclose(clip.forward[0], [1, 0, 0], atol=1e-9)
    np.testing.assert_allclose(clip.hips[:, :, 1], [[0.25 * HIP, -0.25 * HIP]] * 61)
    # Toes ahead of heels, and at most one foot in the air.
    assert (clip.toes[:, :2, 0] > clip.toes[:, 2:, 0]).all()
    assert np.abs(clip.toes[..., 2].min(axis=1)).max() < 0.01
    assert clip.toes[..., 2].max() > 0.09
    assert clip.middle[0, 2] == pytest.approx(HIGH, abs=1e-6)
    assert clip.spine[0, 2, 2] > clip.spine[0, 1, 2] > clip.middle[0, 2]
    assert clip.provenance["file"] == "humanoid3d_march.txt"


def test_the_skeleton_is_found_where_the_package_has_it(tmp_path):
    path = write_person(tmp_path / "data" / "motions")
    (tmp_path / "humanoid").mkdir()
    (path.parent / "humanoid.urdf").rename(tmp_path / "humanoid" / "humanoid.urdf")
    assert len(read_human(path, gait="walk")) == 61


def test_another_axis_up_is_turned(tmp_path):
    usual = read_human(write_person(tmp_path / "a"))
    turned = read_human(write_person(tmp_path / "b", turned_over(march())))
    assert "turned upright" in turned.provenance["up"]
    assert "up" not in usual.provenance
    for part in ("spine", "legs", "arms"):
        np.testing.assert_allclose(
            getattr(turned, part), getattr(usual, part), atol=1e-9
        )


def test_a_mirrored_skeleton_is_named_anew(tmp_path):
    clip = read_human(write_person(tmp_path, skeleton=skeleton_text(left=1.0)))
    assert clip.provenance["swapped"] == "left and right exchanged"
    assert (clip.hips[:, 0, 1] > clip.hips[:, 1, 1]).all()


def test_quaternions_in_another_order_are_refused(tmp_path):
    frames = march(speed=0.6)
    at = [4, 8, 12, 16, 21, 25, 30, 35, 39]
    for k in at:
        frames[:, k : k + 4] = frames[:, [k + 1, k + 2, k + 3, k]]
    with pytest.raises(InputError, match="quaternions are x, y, z, w"):
        read_human(write_person(tmp_path, frames))


def test_inverse_quaternions_are_refused(tmp_path):
    """Of a person who does not walk along an axis of the world."""
    frames = march(speed=0.6)
    turn = about(1, np.full(len(frames), 0.5))
    frames[:, 1:4] = quat_rotate(turn, frames[:, 1:4])
    frames[:, 4:8] = turn
    assert len(read_human(write_person(tmp_path / "a", frames))) == len(frames)
    for k in (4, 8, 12, 16, 21, 25, 30, 35, 39):
        frames[:, k + 1 : k + 4] *= -1
    with pytest.raises(InputError, match="if its quaternions are inverse"):
        read_human(write_person(tmp_path / "b", frames))


def test_a_skeleton_of_another_size_is_refused(tmp_path):
    text = skeleton_text().replace("-1.6", "-1.1")
    with pytest.raises(InputError, match="its skeleton is of another size"):
        read_human(write_person(tmp_path, skeleton=text))


def test_knees_that_bend_forward_are_refused(tmp_path):
    frames = march()
    for knee in (20, 34):
        frames[:, knee] *= -1
        frames[:, knee - 1] *= -1  # the hip's angle about z
        frames[:, knee + 4] *= -1
    with pytest.raises(InputError, match="its knees bend forward"):
        read_human(write_person(tmp_path, frames))


def test_what_ends_as_it_begins_can_be_repeated(tmp_path):
    """The march of 2.4 s is three steps of each foot."""
    path = write_person(tmp_path, march(2.4))
    clip = read_human(path, cycles=3)
    assert clip.provenance["cycles"] == "3, closed by 0 degrees"
    assert len(clip) == 3 * 72
    np.testing.assert_allclose(clip.legs[:72], clip.legs[72:144], atol=1e-6)
    # Half a step more, and it does not.
    path = write_person(tmp_path / "b", march(2.2, lift=0.3))
    assert "cycles" not in read_human(path, cycles=3).provenance
    path = write_person(tmp_path / "c", march(2.4), loop="none")
    assert "cycles" not in read_human(path, cycles=3).provenance


def test_a_cycle_goes_on_from_where_it_ended_and_keeps_bones(tmp_path):
    frames = march(2.4, speed=0.5)
    frames[-5:, 20] -= 0.1  # of the right knee
    capture = repeated(read_capture(write_person(tmp_path, frames)), 2)
    np.testing.assert_allclose(np.diff(capture.root[:, 0]), 0.5 / 30, atol=1e-9)
    points = pose(read_skeleton(tmp_path / "humanoid.urdf"), capture)
    bone = np.linalg.norm(points["right_knee"] - points["right_ankle"], axis=-1)
    np.testing.assert_allclose(bone, 0.4, atol=1e-9)


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (lambda path: path.write_text("{"), "must be JSON with Frames"),
        (lambda path: path.write_text("[1]"), "must be JSON with Frames"),
        (lambda path: _frames(path, [[1, 2], [3]]), "must be JSON with Frames"),
        (lambda path: _frames(path, march()[:, :-1]), "44 numbers"),
        (lambda path: _frames(path, march()[:3]), "at least 4 frames, not 3"),
        (lambda path: _frames(path, march() * np.nan), "NaN or infinity"),
        (lambda path: _frames(path, march() * 0.1), "unit quaternions"),
        (lambda path: _frames(path, march() * _NO_TIME), "frame 0 has no duration"),
        (lambda path: (path.parent / "humanoid.urdf").unlink(), "humanoid.urdf is not"),
        (lambda path: path.unlink(), "No such file"),
        (
            lambda path: (path.parent / "humanoid.urdf").write_text("<robot/>"),
            "not the URDF of a person",
        ),
    ],
)
def test_damaged_files_are_refused_by_name(tmp_path, damage, reason):
    path = write_person(tmp_path)
    damage(path)
    with pytest.raises(InputError, match=reason) as refused:
        read_human(path)
    assert str(tmp_path) in str(refused.value)


_NO_TIME = np.ones(44)
_NO_TIME[0] = 0.0


def _frames(path, frames):
    path.write_text(json.dumps({"Frames": [list(frame) for frame in frames]}))
