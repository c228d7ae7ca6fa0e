"""A robot with three joints a leg, as numbers, and its kinematics in closed form."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.tree import ModelInstanceIndex

from loco_drake.common.arrays import Array, Integers

from .parsing import AddUrdf
from .quadruped import Quadruped
from .simulated import SimulatedRobot

ROBOTS = ("go2", "a1")  # that are shipped
LEAST_PAYLOAD = -3.0  # kg, of theirs; bounds hold down to this payload


@dataclass(frozen=True, eq=False, kw_only=True)
class Robot(Quadruped, SimulatedRobot):
    """A quadruped with three joints per leg, all read from its Drake model.

    Every leg has a hip (about x, abduction), a thigh and a calf (both about y), in this
    order. Their *leg angles* a, b, c are those of a leg that hangs down straight at
    zero, turned about +x and +y:

        [a, b, c] = joint_signs * joints + joint_zeros

    of that leg; of Go2 and A1 they are the joints themselves. With the hip joint's axis
    through p_BHip, links of length ``l1`` and ``l2``, and the toe at an offset ``d`` to
    the side,

        p_BF = p_BHip + Rx(a) [-l1 sin b - l2 sin(b + c), d, -l1 cos b - l2 cos(b + c)]

    from which the kinematics follow in closed form.
    """

    url: str = ""  # the model, package://...; see ConfigureParser
    model: str = ""  # text of the model's URDF; "" if it has a url
    # Y in m from the hip joint's axis to the plane in which the toe moves at zero
    # abduction, that of the thigh joint of Go2 and A1; positive on the left, shape
    # (4,).
    abduction_offset: Array
    thigh_length: float  # thigh joint to calf joint, in the plane of the leg, m
    calf_length: float  # calf joint to the centre of the toe sphere, in it, m
    joint_signs: Array  # 1 or -1 of each joint, shape (12,)
    joint_zeros: Array  # leg angles where the joints are at zero, rad, shape (12,)
    # Sign of the calf's leg angle: -1 where the knee points backward, 1 where it points
    # forward, shape (4,).
    knee_signs: Array
    knee_offset: (
        Array  # y in m of the calf joints from the plane of the toe, shape (4,)
    )
    # What all joints can lose at once while the mass matrix stays positive definite in
    # every pose, also with ``least_payload``, kg m^2.
    removable_inertia: float
    least_payload: float  # mass added to the trunk at least, kg

    @property
    def p_BV(self) -> Array:
        """Beside the thigh joints, in the toes' planes at zero abduction, m, (4, 3)."""
        return self.p_BHip + self.abduction_offset[:, None] * np.array([0.0, 1.0, 0.0])

    @property
    def folded_length(self) -> float:
        """Distance of the toe from the thigh joint with the calf at its limit, m."""
        l1, l2 = self.thigh_length, self.calf_length
        folded = np.abs(self._calf_limits).max(axis=0).min()
        square = l1**2 + l2**2 + 2 * l1 * l2 * np.cos(folded)
        return float(np.sqrt(square))

    def AddModel(self, parser: Parser, *, visual: bool = False) -> ModelInstanceIndex:
        """Adds the model, by default without its meshes, to the parser's plant."""
        return AddUrdf(parser, url=self.url, model=self.model, visual=visual)

    @property
    def contact_joints(self) -> Integers:
        """Those of each leg, shape (4, 3)."""
        return np.arange(len(self.joint_names)).reshape(4, -1)

    def contact_points(self, joints: Array) -> Array:
        """Returns the toes in B, m, shape (..., 4, 3)."""
        return self.toe_positions(joints)

    def contact_jacobians(self, joints: Array) -> Array:
        """Returns d p_BF / d joints of each toe, m/rad, (..., 4, 3, 3)."""
        return self.toe_jacobians(joints)

    def leg_angles(self, joints: Array) -> Array:
        """Returns the leg angles of joints, both in rad, shape (..., 12)."""
        if self.hangs_at_zero:
            return joints
        return self.joint_signs * joints + self.joint_zeros

    def joints_of(self, leg_angles: Array) -> Array:
        """Returns the joints at leg angles, both in rad, shape (..., 12).

        Of turns by whole circles it selects the one that is nearest to the stance.
        """
        if self.hangs_at_zero:
            return leg_angles
        joints = self.joint_signs * (leg_angles - self.joint_zeros)
        turn = 2 * np.pi
        return joints - turn * np.round((joints - self.stand_joints) / turn)

    def backward_angles(self, joints: Array) -> Array:
        """Returns angles of the legs if knees pointed backward, toes as they are.

        They are leg angles in rad, shape (..., 12): the same for robots of all builds.
        """
        return self._turn_knees(self.leg_angles(joints))

    def joints_of_backward(self, angles: Array) -> Array:
        """Returns the joints at :meth:`backward_angles`, both in rad, (..., 12)."""
        return self.joints_of(self._turn_knees(angles))

    def toe_positions(self, joints: Array) -> Array:
        """Returns p_BF in m, shape (..., 4, 3)."""
        return self._ends(joints, self.calf_length, self.abduction_offset)

    def knee_positions(self, joints: Array) -> Array:
        """Returns the origins of the last joints in B, m, shape (..., 4, 3)."""
        return self._ends(joints, 0.0, self.abduction_offset + self.knee_offset)

    def toe_jacobians(self, joints: Array) -> Array:
        """Returns d p_BF / d joints, m/rad, shape (..., 4, 3, n)."""
        a, b, c = _by_joint(self.leg_angles(joints))
        x2 = -self.calf_length * np.sin(b + c)
        z2 = -self.calf_length * np.cos(b + c)
        x = -self.thigh_length * np.sin(b) + x2
        z = -self.thigh_length * np.cos(b) + z2
        sin_a, cos_a = np.sin(a), np.cos(a)
        d = self.abduction_offset
        J = np.zeros((*a.shape, 3, 3))
        J[..., 1, 0] = -sin_a * d - cos_a * z
        J[..., 2, 0] = cos_a * d - sin_a * z
        # Turning about y by +db moves (x, z) by (z, -x) db.
        J[..., 0, 1] = z
        J[..., 1, 1] = sin_a * x
        J[..., 2, 1] = -cos_a * x
        J[..., 0, 2] = z2
        J[..., 1, 2] = sin_a * x2
        J[..., 2, 2] = -cos_a * x2
        return J if self.hangs_at_zero else J * self.joint_signs.reshape(4, 1, 3)

    def leg_joints(self, p_BF: Array) -> Array:
        """Returns joints (..., 12) in rad that put the toes at ``p_BF`` (..., 4, 3).

        Selects the solution with the foot below the hip's axis in the plane of the leg
        and the knee bent as this robot is built, see ``knee_signs``. A target out of
        the calf's range is clamped: the leg points at it with its largest or smallest
        length. Hip and thigh are not clamped; of Go2 and A1 they are within (-pi, pi].
        """
        x, y, z = np.moveaxis(p_BF - self.p_BHip, -1, 0)
        d, l1, l2 = self.abduction_offset, self.thigh_length, self.calf_length
        # Within the plane of the leg the toe is at (x, height).
        height = -np.sqrt(np.maximum(y * y + z * z - d * d, 0.0))
        a = np.arctan2(z, y) - np.arctan2(height, d)
        cos_c = (x * x + height * height - l1 * l1 - l2 * l2) / (2 * l1 * l2)
        c = self.knee_signs * np.arccos(np.minimum(np.maximum(cos_c, -1.0), 1.0))
        lower, upper = self._calf_limits
        c = np.minimum(np.maximum(c, lower), upper)
        b = np.arctan2(-x, -height) - np.arctan2(l2 * np.sin(c), l1 + l2 * np.cos(c))
        angles = np.stack((_wrap(a), _wrap(b), c), axis=-1)
        return self.joints_of(angles.reshape(*angles.shape[:-2], 12))

    def nearest_joints(self, p_BF: Array) -> Array:
        """Returns :meth:`leg_joints` clipped to the joint limits."""
        return np.clip(self.leg_joints(p_BF), self.joint_lower, self.joint_upper)

    def reachable_toes(self, p_BF: Array) -> Array:
        """Returns toe positions within the joint limits near ``p_BF``.

        A toe that is nearer to its hip than the leg folds is moved down the trunk's z
        axis. A leg that is too short points at its target.
        """
        x, y, z = np.moveaxis(p_BF - self.p_BHip, -1, 0)
        # In the plane of the leg, whose distance from the hip's axis is the offset.
        square = 1.001 * self.folded_length**2 + self.abduction_offset**2
        drop = np.sqrt(np.maximum(square - x**2 - y**2, 0.0))
        lowered = p_BF.copy()
        lowered[..., 2] = np.minimum(p_BF[..., 2], self.p_BHip[:, 2] - drop)
        folds = x**2 + y**2 + z**2 < square
        goal = np.where(folds[..., None], lowered, p_BF)
        return super().reachable_toes(goal)

    @cached_property
    def hangs_at_zero(self) -> bool:
        """Whether joints are leg angles."""
        return bool((self.joint_signs == 1).all() and not self.joint_zeros.any())

    @cached_property
    def _calf_limits(self) -> tuple[Array, Array]:
        """Bounds of the calves' leg angles on the side of the knee, rad, (4,) each."""
        limits = self.joint_lower, self.joint_upper
        ends = np.sort([self.leg_angles(x)[2::3] for x in limits], axis=0)
        backward = self.knee_signs < 0
        least, most = np.where(backward, -np.pi, 0.0), np.where(backward, 0.0, np.pi)
        return np.maximum(ends[0], least), np.minimum(ends[1], most)

    def _turn_knees(self, angles: Array) -> Array:
        """Returns leg angles with the knees that point forward on the other side."""
        if (self.knee_signs < 0).all():
            return angles
        a, b, c = _by_joint(angles)
        l1, l2 = self.thigh_length, self.calf_length
        turned = b + 2 * np.arctan2(l2 * np.sin(c), l1 + l2 * np.cos(c))
        forward = self.knee_signs > 0
        legs = (a, np.where(forward, turned, b), np.where(forward, -c, c))
        return np.stack(legs, axis=-1).reshape(angles.shape)

    def _ends(self, joints: Array, calf_length: float, d: Array) -> Array:
        """Returns points (..., 4, 3) in B at this distance below the calf joints."""
        a, b, c = _by_joint(self.leg_angles(joints))
        x = -self.thigh_length * np.sin(b) - calf_length * np.sin(b + c)
        z = -self.thigh_length * np.cos(b) - calf_length * np.cos(b + c)
        sin_a, cos_a = np.sin(a), np.cos(a)
        p_B = np.empty((*a.shape, 3))
        p_B[..., 0] = x
        p_B[..., 1] = cos_a * d - sin_a * z
        p_B[..., 2] = sin_a * d + cos_a * z
        p_B += self.p_BHip
        return p_B


def _by_joint(angles: Array) -> tuple[Array, Array, Array]:
    """Returns the hips', thighs' and calves' angles, each of shape (..., 4)."""
    return angles[..., 0::3], angles[..., 1::3], angles[..., 2::3]


def _wrap(angle: Array) -> Array:
    """Returns ``angle`` in rad, within (-pi, pi]; it must be within (-3 pi, 3 pi)."""
    turns = (angle <= -np.pi).astype(np.float64) - (angle > np.pi)
    return angle + 2 * np.pi * turns
