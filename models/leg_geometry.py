"""Legs of three joints, hip about x, thigh and calf about y, in closed form."""

from dataclasses import dataclass

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError

from .chains import ChainRobot
from .legs import LEGS, MIRROR_JOINT_SIGNS, MIRROR_JOINTS, MIRROR_LEGS, MIRROR_POLAR

# An axis is where it should be if it is off by less than this angle, rad.
_OFF_AXIS = 0.05
# Lengths, in m, and angles, in rad, that differ by less are the same.
_SAME = 1e-3
# Smaller angles of the URDF's zero are rounding, rad.
_ROUNDING = 1e-6
_STRAIGHT = 0.05  # rad; a knee that is bent by less points nowhere
_AXES = {"hip": "x, forward", "thigh": "y, to the left", "calf": "y, to the left"}


@dataclass(frozen=True)
class LegGeometry:
    """Fields of :class:`.robot.Robot`, which explains them."""

    p_BHip: Array
    abduction_offset: Array
    thigh_length: float
    calf_length: float
    joint_signs: Array
    joint_zeros: Array
    knee_signs: Array
    knee_offset: Array


def leg_geometry(chain: ChainRobot) -> LegGeometry:
    """Returns the legs of a robot in closed form.

    Raises:
        InputError: unless each leg has a hip that turns about x and a thigh and a calf
            that turn about y, left legs mirror right ones, and links are as long in all
            legs.
    """
    count = len(chain.joint_names) // len(LEGS)
    if count != 3:
        raise InputError(
            f"To be simulated a robot must have three joints in each leg, hip about x, "
            f"thigh and calf about y, not {count}; retargeting takes any legs."
        )
    signs, rolls = _turns(chain)
    # In the plane of each leg, from the hip's axis, where all joints are at zero.
    start = chain.origins[:, 0]
    thigh, calf, toe = (
        _rolled(-rolls, point - start)
        for point in (chain.origins[:, 1], chain.origins[:, 2], chain.toes)
    )
    if np.abs(thigh[:, 2]).max() > _SAME:
        raise InputError(
            "To be simulated, thighs must turn about axes beside those of the hips, "
            f"but they are {np.abs(thigh[:, 2]).max():.3g} m above or below them."
        )
    p_BHip = start + thigh * np.array([1.0, 0.0, 0.0])
    thigh_lengths, pitch = _polar(calf - thigh)
    calf_lengths, end = _polar(toe - calf)
    for name, lengths in (("thigh", thigh_lengths), ("calf", calf_lengths)):
        if np.ptp(lengths) > _SAME or lengths.min() < 10 * _SAME:
            raise InputError(
                f"To be simulated, the {name} must be as long in all legs, not "
                f"{', '.join(f'{length:.4g}' for length in lengths)} m."
            )
    zeros = np.stack((rolls, pitch, _wrapped(end - pitch)), axis=-1).ravel()
    zeros[np.abs(zeros) < _ROUNDING] = 0.0
    stand = _wrapped(signs * chain.stand_joints + zeros)[2::3]
    if np.abs(stand).min() < _STRAIGHT:
        raise InputError("To be simulated, the stance must bend each knee.")
    found = LegGeometry(
        p_BHip=p_BHip,
        abduction_offset=toe[:, 1],
        thigh_length=float(thigh_lengths.mean()),
        calf_length=float(calf_lengths.mean()),
        joint_signs=signs,
        joint_zeros=zeros,
        knee_signs=np.sign(stand),
        knee_offset=calf[:, 1] - toe[:, 1],
    )
    _check_mirrored(found, chain)
    return found


def _turns(chain: ChainRobot) -> tuple[Array, Array]:
    """Returns the joints' signs, (12,), and the legs' rolls at zero, rad, (4,)."""
    hip, thigh, calf = np.moveaxis(chain.axes, 1, 0)
    forward = np.sign(hip[:, 0])
    across = np.sign(thigh[:, 1])
    rolls = np.arctan2(across * thigh[:, 2], across * thigh[:, 1])
    # The axis about which thigh and calf turn.
    left = np.stack((np.zeros(4), np.cos(rolls), np.sin(rolls)), axis=-1)
    last = np.sign((calf * left).sum(axis=-1))
    signs = np.stack((forward, across, last), axis=-1)
    wanted = np.stack((np.tile([1.0, 0.0, 0.0], (4, 1)), left, left), axis=1)
    off = np.linalg.norm(np.cross(chain.axes, wanted), axis=-1)
    worst = np.unravel_index(off.argmax(), off.shape)
    if off[worst] > _OFF_AXIS or not signs.all():
        joint = chain.joint_names[int(3 * worst[0] + worst[1])]
        part = tuple(_AXES)[worst[1]]
        axis = ", ".join(f"{value:.2g}" for value in chain.axes[worst])
        raise InputError(
            f"To be simulated, a leg's {part} must turn about {_AXES[part]}, but where "
            f"all joints are at zero {joint} turns about ({axis}); retargeting takes "
            "any legs."
        )
    return signs.ravel(), rolls


def _check_mirrored(legs: LegGeometry, chain: ChainRobot) -> None:
    """Raises InputError unless left legs are mirror images of right ones."""
    names = chain.joint_names
    turned = legs.joint_signs != legs.joint_signs[MIRROR_JOINTS]
    if turned.any():
        k = int(turned.argmax())
        raise InputError(
            f"To be simulated, left and right joints must turn about the same axis, "
            f"but {names[k]} and {names[MIRROR_JOINTS[k]]} turn about opposite ones: "
            "in a copy of the URDF, reverse axis and limits of one of them."
        )
    for what, own, unit in (
        ("hips", legs.p_BHip - legs.p_BHip[MIRROR_LEGS] * MIRROR_POLAR, "m"),
        ("feet", legs.abduction_offset + legs.abduction_offset[MIRROR_LEGS], "m"),
        (
            "joints at zero",
            legs.joint_zeros - legs.joint_zeros[MIRROR_JOINTS] * MIRROR_JOINT_SIGNS,
            "rad",
        ),
        (
            "joints of the stance",
            chain.stand_joints - chain.stand_joints[MIRROR_JOINTS] * MIRROR_JOINT_SIGNS,
            "rad",
        ),
    ):
        if np.abs(own).max() > _SAME:
            raise InputError(
                "To be simulated, a robot must be its own mirror image, but its "
                f"{what} are off by {np.abs(own).max():.3g} {unit}."
            )


def _rolled(roll: Array, points: Array) -> Array:
    """Returns points (4, 3) turned about x by angles (4,)."""
    x, y, z = points.T
    return np.stack(
        (
            x,
            np.cos(roll) * y - np.sin(roll) * z,
            np.sin(roll) * y + np.cos(roll) * z,
        ),
        axis=-1,
    )


def _polar(links: Array) -> tuple[Array, Array]:
    """Returns lengths in the plane of the leg, m, and angles from hanging down, rad."""
    x, _, z = links.T
    return np.hypot(x, z), np.arctan2(-x, -z)


def _wrapped(angle: Array) -> Array:
    return np.angle(np.exp(1j * angle))
