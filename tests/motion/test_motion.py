import json
from dataclasses import replace

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.common.rotations import quat_rotate
from loco_drake.models.robots import get_robot
from loco_drake.motion.motion import UNITS, make_motion
from loco_drake.motion.motion_file import load_motion, save_motion
from tests.synthetic_motion import synthetic_motion


@pytest.fixture
def motion():
    return synthetic_motion("dog-pace", 1.0, 0.6, 0.3)


def test_a_saved_motion_comes_back(motion, tmp_path):
    save_motion(motion, tmp_path / "pace.npz")
    again = load_motion(tmp_path / "pace.npz")
    for name in UNITS:
        np.testing.assert_array_equal(getattr(again, name), getattr(motion, name))
    assert (again.robot, again.fps, str(again.label)) == ("go2", 50.0, "dog-pace")
    assert again.joint_names == motion.joint_names
    assert again.provenance == motion.provenance


def test_the_file_describes_itself(motion, tmp_path):
    save_motion(motion, tmp_path / "pace.npz")
    with np.load(tmp_path / "pace.npz") as archive:
        header = json.loads(str(archive["header"]))
    assert header["schema_version"] == 1
    assert header["fps"] == 50.0
    assert header["units"]["base_position"] == "m, p_WB"
    assert header["joint_names"][:3] == [
        "FL_hip_joint",
        "FL_thigh_joint",
        "FL_calf_joint",
    ]


def test_velocities_are_differences(motion):
    np.testing.assert_allclose(
        motion.joint_velocities[5],
        (motion.joint_positions[6] - motion.joint_positions[4]) * 25,
    )
    np.testing.assert_allclose(motion.base_angular_velocity[10:-10, 2], 0.3, atol=1e-2)


def test_mirroring_reflects_every_toe_in_the_plane_y_0(motion):
    robot = get_robot("go2")

    def toes(m):
        p_BF = robot.toe_positions(m.joint_positions)
        return m.base_position[:, None] + quat_rotate(m.base_quaternion[:, None], p_BF)

    mirror = motion.mirrored()
    reflected = toes(motion)[:, [1, 0, 3, 2]] * [1, -1, 1]
    np.testing.assert_allclose(toes(mirror), reflected, atol=1e-12)
    np.testing.assert_array_equal(mirror.contacts, motion.contacts[:, [1, 0, 3, 2]])
    again = make_motion(
        robot="go2",
        label=mirror.label,
        joint_names=mirror.joint_names,
        base_position=mirror.base_position,
        base_quaternion=mirror.base_quaternion,
        joint_positions=mirror.joint_positions,
        contacts=mirror.contacts,
        provenance={},
    )
    for name in ("base_velocity", "base_angular_velocity", "joint_velocities"):
        np.testing.assert_allclose(getattr(mirror, name), getattr(again, name))
    twice = mirror.mirrored()
    np.testing.assert_array_equal(twice.joint_positions, motion.joint_positions)


def test_only_three_joints_a_leg_can_be_mirrored(motion):
    eight = replace(
        motion,
        joint_names=motion.joint_names[:8],
        joint_positions=motion.joint_positions[:, :8],
        joint_velocities=motion.joint_velocities[:, :8],
    )
    with pytest.raises(InputError, match="Only motion of 12 joints, as of go2 and a1"):
        eight.mirrored()


def test_slices(motion):
    part = motion.slice(10, 30)
    assert len(part) == 20
    assert part.duration == pytest.approx(0.38)
    np.testing.assert_array_equal(part.contacts, motion.contacts[10:30])


def nan(values):
    values = values.copy()
    values[3, 0] = np.nan
    return values


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: {"fps": 0.0}, "rate above 0"),
        (lambda m: {"fps": float("nan")}, "rate above 0"),
        (lambda m: {"joint_positions": nan(m.joint_positions)}, "NaN"),
        (lambda m: {"base_velocity": m.base_velocity[:-1]}, "must have shape"),
        (lambda m: {"joint_names": m.joint_names[:-1]}, "must have shape"),
        (lambda m: {"base_quaternion": 2 * m.base_quaternion}, "unit quaternions"),
        (lambda m: {"contacts": m.contacts.astype(float)}, "must be bool"),
    ],
)
def test_unsound_motions_are_refused(motion, change, message):
    with pytest.raises(InputError, match=message):
        replace(motion, **change(motion))


def write(path, motion, **changes):
    """Writes a Motion file past the checks; a change to None leaves a part out."""
    header = {
        "schema_version": 1,
        "robot": "go2",
        "source": "dog",
        "gait": "pace",
        "fps": 50.0,
        "joint_names": list(motion.joint_names),
    }
    arrays = {name: getattr(motion, name) for name in UNITS}
    for name, value in changes.items():
        part = arrays if name in arrays else header
        if value is None:
            del part[name]
        else:
            part[name] = value
    np.savez(path, header=json.dumps(header), **arrays)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"schema_version": 2}, "schema 2; this version reads up to 1"),
        ({"fps": None}, "lacks fps"),
        ({"contacts": None}, "lacks contacts"),
        ({"fps": "fast"}, "damaged Motion header"),
        ({"joint_names": 12}, "damaged Motion header"),
        ({"fps": -1.0}, "rate above 0"),
        ({"joint_names": ["knee"]}, "must have shape"),
    ],
)
def test_unsound_files_are_refused(motion, tmp_path, changes, message):
    path = tmp_path / "x.npz"
    write(path, motion, **changes)
    with pytest.raises(InputError, match=message):
        load_motion(path)


@pytest.mark.parametrize("content", [b"", b"hello", b"PK\x03\x04 broken"])
def test_other_files_are_not_motions(tmp_path, content):
    path = tmp_path / "x.npz"
    path.write_bytes(content)
    with pytest.raises(InputError, match="not a Motion file"):
        load_motion(path)


def test_a_truncated_file_is_refused(motion, tmp_path):
    path = tmp_path / "x.npz"
    save_motion(motion, path)
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(InputError, match="not a Motion file"):
        load_motion(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match="no Motion file"):
        load_motion(tmp_path / "none.npz")


def test_a_failed_write_leaves_nothing(motion, tmp_path, monkeypatch):
    def fail(*args, **kwargs):
        raise OSError("disk full")

    monkeypatch.setattr(np, "savez_compressed", fail)
    with pytest.raises(OSError, match="disk full"):
        save_motion(motion, tmp_path / "x.npz")
    assert list(tmp_path.iterdir()) == []
