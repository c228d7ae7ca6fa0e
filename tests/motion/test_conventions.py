"""Motion in another convention is refused, with the reason; sound motion is not."""

from dataclasses import replace

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.common.rotations import (
    angular_velocity,
    quat_conjugate,
    quat_multiply,
    quat_rotate,
    yaw_quat,
)
from loco_drake.motion.conventions import check_conventions, in_robot_order
from loco_drake.motion.motion_file import load_motion, save_motion
from tests.synthetic_motion import synthetic_motion


@pytest.fixture(scope="module")
def motion():
    """It heads elsewhere than along x, so that the trunk's frame is not the world's."""
    straight, turn = synthetic_motion("dog-trot", 2.0, 0.8), yaw_quat(np.array(0.9))
    return replace(
        straight,
        base_position=quat_rotate(turn, straight.base_position),
        base_quaternion=quat_multiply(turn, straight.base_quaternion),
        base_velocity=quat_rotate(turn, straight.base_velocity),
        base_angular_velocity=quat_rotate(turn, straight.base_angular_velocity),
    )


@pytest.mark.parametrize("name", ["go2", "a1"])
@pytest.mark.parametrize("label", ["dog-trot", "dog-pace"])
def test_sound_motion_passes_as_it_is(name, label, tmp_path):
    for speed, turn in ((0.0, 0.0), (0.8, 0.0), (0.5, -0.8)):
        motion = synthetic_motion(label, 1.0, speed, turn, name=name)
        for part in (motion, motion.mirrored(), motion.slice(7, 10)):
            check_conventions(part)
            assert in_robot_order(part) is part
            save_motion(part, tmp_path / "a.npz")
            again = load_motion(tmp_path / "a.npz")
            np.testing.assert_array_equal(again.joint_positions, part.joint_positions)
            assert again.provenance == part.provenance


def test_velocities_by_other_means_pass(motion):
    """Backward differences, rounded, and with some noise."""
    random = np.random.default_rng(0)
    changed = {}
    for name, of in (
        ("base_velocity", motion.base_position),
        ("joint_velocities", motion.joint_positions),
    ):
        backward = np.diff(of, axis=0, prepend=of[:1]) * motion.fps
        noise = 0.02 * random.normal(size=of.shape)
        changed[name] = (backward + noise).astype(np.float32).astype(float)
    check_conventions(replace(motion, **changed))


def test_joints_in_another_order_are_put_in_the_robots(motion, tmp_path, capsys):
    """With their velocities, and it is said on stderr and in the provenance."""
    order = [3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8]
    names = tuple(motion.joint_names[k] for k in order)
    other = replace(
        motion,
        joint_names=names,
        joint_positions=motion.joint_positions[:, order],
        joint_velocities=motion.joint_velocities[:, order],
    )
    save_motion(other, tmp_path / "a.npz")
    again = load_motion(tmp_path / "a.npz")
    assert again.joint_names == motion.joint_names
    np.testing.assert_array_equal(again.joint_positions, motion.joint_positions)
    np.testing.assert_array_equal(again.joint_velocities, motion.joint_velocities)
    said = f"reordered from {', '.join(names)}"
    assert said.startswith("reordered from FR_hip_joint, FR_thigh_joint, ")
    assert again.provenance["joints"] == said
    assert capsys.readouterr().err == f"{tmp_path / 'a.npz'}: joints {said}.\n"
    save_motion(again, tmp_path / "b.npz")
    load_motion(tmp_path / "b.npz")
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda names: ("nose", *names[1:]), "not 'nose'"),
        (lambda names: (names[1], *names[1:]), "FL_hip_joint, .*each once"),
        (lambda names: tuple(n.upper() for n in names), "not 'FL_HIP_JOINT'"),
    ],
)
def test_joints_of_another_robot_are_refused(motion, change, reason):
    with pytest.raises(InputError, match=rf"joints of go2 are .*{reason}"):
        in_robot_order(replace(motion, joint_names=change(motion.joint_names)))


def legs(motion, order, contacts):
    def permuted(values):
        return values.reshape(len(motion), 4, 3)[:, order].reshape(len(motion), 12)

    return {
        "joint_positions": permuted(motion.joint_positions),
        "joint_velocities": permuted(motion.joint_velocities),
        "contacts": motion.contacts[:, order] if contacts else motion.contacts,
    }


def joint_by_joint(values):
    return values.reshape(-1, 4, 3).transpose(0, 2, 1).reshape(-1, 12)


def at(values, frame, added):
    values = values.copy()
    values[frame] += added
    return values


Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])

WRONG = {
    "joints in degrees": (
        lambda m: {
            "joint_positions": np.degrees(m.joint_positions),
            "joint_velocities": np.degrees(m.joint_velocities),
        },
        "seem to be in degrees",
    ),
    "joints of another zero": (
        lambda m: {"joint_positions": m.joint_positions + 1.0},
        "its limits are",
    ),
    "joints joint by joint": (
        lambda m: {
            "joint_positions": joint_by_joint(m.joint_positions),
            "joint_velocities": joint_by_joint(m.joint_velocities),
        },
        "its limits are",
    ),
    "joint velocities in degrees": (
        lambda m: {"joint_velocities": np.degrees(m.joint_velocities)},
        "joint_velocities are not the derivatives .* they are in degrees",
    ),
    "turning in degrees": (
        lambda m: {"base_angular_velocity": np.degrees(m.base_angular_velocity)},
        "base_angular_velocity are not .* they are in degrees",
    ),
    "no velocities": (
        lambda m: {"base_velocity": 0 * m.base_velocity},
        "base_velocity are not .* they are all zero",
    ),
    "velocity in the trunk's frame": (
        lambda m: {
            "base_velocity": quat_rotate(
                quat_conjugate(m.base_quaternion), m.base_velocity
            )
        },
        "base_velocity are not .* they are in the trunk's frame",
    ),
    "velocities of other joints": (
        lambda m: {"joint_velocities": m.joint_velocities[:, ::-1]},
        "joint_velocities are not the derivatives",
    ),
    "one velocity far off": (
        lambda m: {"base_velocity": at(m.base_velocity, 20, 1e5)},
        "base_velocity are not the derivatives",
    ),
    "one position far off": (
        lambda m: {"joint_positions": at(m.joint_positions, 20, 0.4)},
        "joint_velocities are not the derivatives",
    ),
    "first velocity implausible": (
        lambda m: {"base_velocity": at(m.base_velocity, 0, 1e5)},
        r"base moves at 1e\+05 m/s",
    ),
    "a jump to another place": (
        lambda m: {"base_position": m.base_position + (np.arange(101) > 50)[:, None]},
        "base moves at .* no more than 10 m/s is plausible",
    ),
    "millimetres": (
        lambda m: {
            "base_position": 1000 * m.base_position,
            "base_velocity": 1000 * m.base_velocity,
        },
        "base moves at .* check units and rate",
    ),
    "far away": (
        lambda m: {"base_position": m.base_position + 1e8},
        "must be in metres",
    ),
    "x, y, z, w": (
        lambda m: {"base_quaternion": m.base_quaternion[:, [1, 2, 3, 0]]},
        "quaternions x, y, z, w",
    ),
    "x, y, z, w, and turning that goes with it": (
        lambda m: {
            "base_quaternion": m.base_quaternion[:, [1, 2, 3, 0]],
            "base_angular_velocity": angular_velocity(
                m.base_quaternion[:, [1, 2, 3, 0]], 0.02
            ),
        },
        "quaternions",
    ),
    "inverse quaternions": (
        lambda m: {"base_quaternion": quat_conjugate(m.base_quaternion)},
        "base_angular_velocity are not",
    ),
    "y up": (
        lambda m: {
            "base_position": m.base_position @ Y_UP,
            "base_velocity": m.base_velocity @ Y_UP,
        },
        "below the ground|standing feet",
    ),
    "floor below": (
        lambda m: {"base_position": m.base_position + np.array([0, 0, 0.05])},
        r"lowest foot is 0.0\d* m above the ground",
    ),
    "floor above": (
        lambda m: {"base_position": m.base_position - [0, 0, 0.05]},
        r"lowest foot is 0.0\d* m below the ground",
    ),
    "right legs first": (
        lambda m: legs(m, [1, 0, 3, 2], False),
        "with legs in the order FR, FL, RR, RL",
    ),
    "hind legs first, contacts too": (
        lambda m: legs(m, [2, 3, 0, 1], True),
        "standing feet move",
    ),
    "contacts the other way": (
        lambda m: {"contacts": ~m.contacts},
        "standing feet move .* contacts",
    ),
    "y to the other side": (
        lambda m: {
            "base_position": m.base_position * [1, -1, 1],
            "base_velocity": m.base_velocity * [1, -1, 1],
        },
        "standing feet move .* with y to the other side",
    ),
    "another robot": (lambda m: {"robot": "a1"}, "feet move as those of go2, not a1"),
    "another rate": (lambda m: {"fps": 60.0}, "they are at 50 frames/s"),
    "the period in s": (lambda m: {"fps": 0.02}, "1 to 1000 frames/s, not 0.02"),
    "the period in ms": (lambda m: {"fps": 20.0}, "they are at 50 frames/s"),
    "an endless rate": (lambda m: {"fps": 1e300}, "1 to 1000 frames/s"),
}


@pytest.mark.parametrize("how", WRONG)
def test_another_convention_is_refused_with_the_reason(motion, how, tmp_path):
    change, reason = WRONG[how]
    save_motion(replace(motion, **change(motion)), tmp_path / "a.npz")
    with pytest.raises(InputError, match=rf"a\.npz: .*({reason}).*\.$"):
        load_motion(tmp_path / "a.npz")


@pytest.mark.parametrize("frames", [1, 2])
def test_too_few_frames_to_tell_a_velocity_are_refused(motion, frames, tmp_path):
    save_motion(motion.slice(0, frames), tmp_path / "a.npz")
    with pytest.raises(InputError, match=f"at least 3 frames, not {frames}"):
        load_motion(tmp_path / "a.npz")


def test_motion_of_a_robot_that_is_not_known_is_judged_by_itself(motion, tmp_path):
    """Its joints and feet are not known here, its velocities are."""
    joints = motion.joint_positions[:, :8] + 2.0
    other = replace(
        motion,
        robot="solo8",
        joint_names=tuple("abcdefgh"),
        joint_positions=joints,
        joint_velocities=motion.joint_velocities[:, :8],
    )
    save_motion(other, tmp_path / "a.npz")
    again = load_motion(tmp_path / "a.npz")
    np.testing.assert_array_equal(again.joint_positions, joints)
    wrong = replace(other, base_velocity=0 * other.base_velocity)
    with pytest.raises(InputError, match="they are all zero"):
        check_conventions(wrong)
