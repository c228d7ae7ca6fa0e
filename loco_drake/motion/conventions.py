"""Checks by measurement whether a motion follows the conventions of Motion.

A wrong unit, order or frame contradicts the rest of the data: velocities are
derivatives of positions, feet stand still on the ground in stance, and joints stay
within the limits of the robot. A contradiction is refused with its reason; nothing is
guessed. Motion that this project writes is within a tenth of each bound, except that
joint speeds reach a fifth.
"""

from dataclasses import replace
from itertools import permutations
from typing import Any

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError, quoted
from loco_drake.common.rotations import (
    angular_velocity,
    quat_conjugate,
    quat_continuous,
    quat_rotate,
)
from loco_drake.models.legs import LEGS, MIRROR_JOINT_SIGNS, MIRROR_POLAR
from loco_drake.models.robots import ROBOTS, Robot, get_robot, known_robot
from loco_drake.motion.motion import Motion
from loco_drake.motion.quality import toe_trajectories

MIN_FRAMES = 3  # needed for velocities
MAX_DISTANCE = 1e4  # m from the world's origin
MAX_BASE_SPEED = 10.0  # m/s
MAX_TURNING = 30.0  # rad/s
MAX_JOINT_SPEED = 5.0  # times the joint's limit; the smoother slows down excess
JOINT_MARGIN = 0.2  # rad beyond the limits
GROUND_MARGIN = 0.1  # stand heights from the lowest sole to the ground
STANCE_SPEED = 0.01  # m/s of toes in stance; above, other conventions are tried
MAX_UNKNOWN_JOINT_SPEED = 200.0  # rad/s, for a robot with unknown limits

_INTEGRALS = {
    "base_velocity": "base_position, in m/s in the world's frame",
    "base_angular_velocity": "base_quaternion, in rad/s in the world's frame",
    "joint_velocities": "joint_positions, in rad/s",
}
_XYZW = [3, 0, 1, 2]
_DOUBT = 0.2  # of what is rounding
_TINY = 1e-9
_SLOW = 0.1  # m/s or rad/s; slower is standing
_ALIKE = 0.01  # of the highest velocity
_MOST_LATE = 10  # frames that velocities may be found to lag; up to 2 are a filter's


def in_robot_order(motion: Motion) -> Motion:
    """Returns the motion with its joints in the order of its robot.

    Motions of robots that this process does not know are left as they are.

    Raises:
        InputError: if its joints are not those of the robot.
    """
    if (robot := known_robot(motion.robot)) is None:
        return motion
    names = robot.joint_names
    if motion.joint_names == names:
        return motion
    if sorted(motion.joint_names) != sorted(names):
        foreign = [name for name in motion.joint_names if name not in names]
        raise InputError(
            f"The joints of {motion.robot} are {', '.join(names)}, each once"
            + (f", not {quoted(foreign[0])}." if foreign else ".")
        )
    order = [motion.joint_names.index(name) for name in names]
    reordered = f"reordered from {', '.join(motion.joint_names)}"
    return replace(
        motion,
        joint_names=names,
        joint_positions=motion.joint_positions[:, order],
        joint_velocities=motion.joint_velocities[:, order],
        provenance={**motion.provenance, "joints": reordered},
    )


def check_conventions(motion: Motion) -> None:
    """Raises InputError, with the reason, where the data contradict each other.

    Feet, limits and joint speeds are checked of robots that this process knows.
    """
    if len(motion) < MIN_FRAMES:
        raise InputError(f"It needs at least {MIN_FRAMES} frames, not {len(motion)}.")
    if not 1 <= motion.fps <= 1000:
        raise InputError(f"Its rate must be 1 to 1000 frames/s, not {motion.fps:g}.")
    if (far := np.abs(motion.base_position).max()) > MAX_DISTANCE:
        raise InputError(
            f"Its base is {far:.3g} m from the origin, which must be in metres."
        )
    robot = known_robot(motion.robot)
    if robot is not None:
        _check_joints(motion, robot)
    _check_speeds(
        robot,
        np.diff(motion.base_position, axis=0) * motion.fps,
        angular_velocity(quat_continuous(motion.base_quaternion), 1 / motion.fps),
        np.diff(motion.joint_positions, axis=0) * motion.fps,
    )
    _check_velocities(motion)
    given = motion.base_velocity, motion.base_angular_velocity, motion.joint_velocities
    _check_speeds(robot, *given)
    if robot is not None:
        _check_feet(motion, robot)


def _check_joints(motion: Motion, robot: Robot) -> None:
    def beyond(joints: Array) -> Array:
        return np.maximum(robot.joint_lower - joints, joints - robot.joint_upper)

    excess = beyond(motion.joint_positions)
    frame, joint = np.unravel_index(excess.argmax(), excess.shape)
    if excess[frame, joint] > JOINT_MARGIN:
        degrees = beyond(np.radians(motion.joint_positions)).max() <= JOINT_MARGIN
        raise InputError(
            f"{robot.joint_names[joint]} is at "
            f"{motion.joint_positions[frame, joint]:.4g} rad, but its limits are "
            f"{robot.joint_lower[joint]:.3g} and {robot.joint_upper[joint]:.3g}"
            + ("; the joints seem to be in degrees." if degrees else ".")
        )


def _check_speeds(
    robot: Robot | None, base: Array, turning: Array, joints: Array
) -> None:
    """Raises InputError if velocities (N, 3), (N, 3) or (N, J) are implausible."""
    most: float | Array = MAX_UNKNOWN_JOINT_SPEED
    if robot is not None:
        most = MAX_JOINT_SPEED * robot.joint_speed_limits
    for what, unit, values, bound in (
        ("Its base moves", "m/s", base, MAX_BASE_SPEED),
        ("Its base turns", "rad/s", turning, MAX_TURNING),
        ("A joint of it moves", "rad/s", joints, most),
    ):
        if (np.abs(values) > bound).any():
            raise InputError(
                f"{what} at {np.abs(values).max():.3g} {unit}, but no more than "
                f"{np.max(bound):.3g} {unit} is plausible; check units and rate."
            )


def _check_velocities(motion: Motion) -> None:
    """Compares velocities with central differences, without the first and last frame.

    No deviation may reach half of the highest speed, nor half of the RMS speed. Smaller
    deviations are refused if another convention explains most of them.
    """
    fps, q = motion.fps, quat_continuous(motion.base_quaternion)
    xyzw = quat_continuous(motion.base_quaternion[:, _XYZW])
    turning = angular_velocity(q, 1 / fps)[1:-1]
    base = np.gradient(motion.base_position, 1 / fps, axis=0)[1:-1]
    joints = np.gradient(motion.joint_positions, 1 / fps, axis=0)[1:-1]
    to_trunk = quat_conjugate(q)[1:-1]
    others = {"in the trunk's frame": quat_rotate(to_trunk, base)}
    factor = _rms(motion.base_velocity[1:-1]) / max(_rms(base), _TINY)
    # Differences of what is fast are a little too small, which is no other rate.
    if factor > _TINY and abs(np.log(factor)) > 0.15:
        others[f"at {factor * fps:.3g} frames/s"] = factor * base
    _check_derivative(motion, "base_velocity", base, others, 0.02)
    others = {
        "in the trunk's frame": quat_rotate(to_trunk, turning),
        "in degrees": np.degrees(turning),
        "with quaternions x, y, z, w": angular_velocity(xyzw, 1 / fps)[1:-1],
    }
    _check_derivative(motion, "base_angular_velocity", turning, others, 0.05)
    others = {"in degrees": np.degrees(joints)}
    _check_derivative(motion, "joint_velocities", joints, others, 0.1)


def _check_derivative(
    motion: Motion, name: str, true: Array, others: dict[str, Array], rounding: float
) -> None:
    """Compares one array with what it is by this and by other conventions."""
    given = getattr(motion, name)[1:-1]
    off, speed = _rms(given - true), _rms(true)
    far = np.abs(given - true).max() > 0.5 * np.abs(true).max() + 5 * rounding
    far = far or off > 0.5 * speed + rounding
    if not far and off <= _DOUBT * rounding:
        return  # whatever convention explains the rest
    others |= {"all zero": np.zeros_like(true), "in reverse": true[::-1]}
    most = min(_MOST_LATE, len(true) // 2)  # beyond, too little is compared
    for late in (k for k in range(-most, most + 1) if abs(k) > 2):
        moved = np.roll(true, late, axis=0)
        ends = slice(late) if late > 0 else slice(late, None)
        moved[ends] = given[ends]  # of which nothing is known
        others[f"{late} frames late"] = moved
    best = min(others, key=lambda how: _rms(given - others[how]))
    found = _rms(given - others[best]) < off / 4
    if far or found:
        raise InputError(
            f"The values of {name} are not the derivatives of {_INTEGRALS[name]} at "
            f"{motion.fps:g} frames/s" + (f"; they are {best}." if found else ".")
        )


def velocity_deviations(motion: Motion) -> dict[str, float]:
    """Returns how far velocities are from differences of the positions.

    Returns:
        the largest deviation as a fraction of the highest velocity, by array; only of
        those where it is above a hundredth. One-sided differences count at both ends.
    """
    rate, deviations = 1 / motion.fps, {}
    quaternion = quat_continuous(motion.base_quaternion)
    for name, true in (
        ("base_velocity", np.gradient(motion.base_position, rate, axis=0)),
        ("base_angular_velocity", angular_velocity(quaternion, rate)),
        ("joint_velocities", np.gradient(motion.joint_positions, rate, axis=0)),
    ):
        given, highest = getattr(motion, name), max(np.abs(true).max(), _SLOW)
        off = float(np.abs(given - true).max() / highest)
        if off > _ALIKE:
            deviations[name] = off
    return deviations


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))


def _check_feet(motion: Motion, robot: Robot) -> None:
    x, y = motion.base_quaternion[:, 1], motion.base_quaternion[:, 2]
    if (cos := np.median(1 - 2 * (x * x + y * y))) < 0.5:
        raise InputError(
            f"Its trunk's z axis is {np.degrees(np.arccos(cos)):.0f} degrees from the "
            "world's: quaternions must be w, x, y, z, and z up."
        )
    slip = stance_speed(motion, robot)
    if slip > STANCE_SPEED:
        for name in ROBOTS:
            if stance_speed(motion, get_robot(name)) < slip / 4:
                raise InputError(f"Its feet move as those of {name}, not {robot.name}.")
        readings = _other_readings(motion)
        speeds = {how: stance_speed(m, robot) for how, m in readings.items()}
        best = min(speeds, key=lambda how: speeds[how])
        if speeds[best] < slip / 4:
            raise InputError(
                f"Its standing feet move at {slip:.2g} m/s, but at only "
                f"{speeds[best]:.2g} m/s {best}."
            )
    soles = toe_trajectories(motion, robot)[..., 2] - robot.foot_radius
    lowest, margin = soles.min(), GROUND_MARGIN * robot.stand_height
    # Less than half a second may be flight.
    if not -margin < lowest < margin + (motion.duration < 0.5) * robot.stand_height:
        raise InputError(
            f"Its lowest foot is {abs(lowest):.3f} m "
            f"{'above' if lowest > 0 else 'below'} the ground, which is at z = 0."
        )
    base = np.linalg.norm(motion.base_velocity, axis=1).mean()
    if slip > 0.3 + 0.5 * base:
        raise InputError(
            f"Its feet move at {slip:.2g} m/s while contacts say that they stand, "
            f"and its base at {base:.2g} m/s."
        )
    down, up = soles[motion.contacts], soles[~motion.contacts]
    if len(down) and len(up) and down.mean() > up.mean() + 0.01:
        raise InputError(
            f"Its feet are {down.mean():.3f} m above the ground where contacts "
            f"say that they stand, {up.mean():.3f} m where they do not."
        )


def stance_speed(motion: Motion, robot: Robot) -> float:
    """Returns the median speed in m/s of toes in contact; 0 if there are none."""
    p_WF = toe_trajectories(motion, robot)
    speeds = np.linalg.norm(np.diff(p_WF, axis=0), axis=-1) * motion.fps
    standing = speeds[motion.contacts[1:] & motion.contacts[:-1]]
    return float(np.median(standing)) if len(standing) else 0.0


def _other_readings(motion: Motion) -> dict[str, Motion]:
    """Returns the motion as read under other conventions."""
    q, joints = motion.base_quaternion, motion.joint_positions
    readings: dict[str, dict[str, Any]] = {
        "with quaternions x, y, z, w": {"base_quaternion": q[:, _XYZW]},
        "with inverse quaternions": {"base_quaternion": quat_conjugate(q)},
        "with hips of the other sign": {"joint_positions": joints * MIRROR_JOINT_SIGNS},
        "with y to the other side": {
            "base_position": motion.base_position * MIRROR_POLAR
        },
    }
    per_leg = joints.reshape(len(motion), 4, -1)
    for order in list(permutations(range(4)))[1:]:
        # Leg k of the robot is at order[k] in the file.
        names = ", ".join(LEGS[order.index(k)] for k in range(4))
        legs = {"joint_positions": per_leg[:, order].reshape(len(motion), -1)}
        contacts = {"contacts": motion.contacts[:, order]}
        readings |= {
            f"with legs in the order {names}": legs,
            f"with contacts in the order {names}": contacts,
            f"with legs and contacts in the order {names}": legs | contacts,
        }
    return {how: replace(motion, **read) for how, read in readings.items()}
