"""What legs say of the base's velocity and height while their toes are in contact."""

import torch
from torch import Tensor, nn

from loco_drake.models.legs import LEGS
from loco_drake.models.robots import Robot


class LegOdometry(nn.Module):
    """Kinematics of a robot's legs, for tensors.

    A toe that stands still on the ground tells the velocity of the base, and a toe on
    the ground its height. The toe is taken for a point: while it rolls, the velocity is
    off by its radius times its rate of turn.
    """

    standing: Tensor
    signs: Tensor
    p_BHip: Tensor
    offset: Tensor

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        for name, array in (
            ("standing", robot.leg_angles(robot.stand_joints)),
            ("signs", robot.joint_signs),
            ("p_BHip", robot.p_BHip),
            ("offset", robot.abduction_offset),
        ):
            value = torch.tensor(array, dtype=torch.float32)
            self.register_buffer(name, value, persistent=False)
        self._turned = not robot.hangs_at_zero
        self._lengths = robot.thigh_length, robot.calf_length

    def forward(
        self, gravity_B: Tensor, w_WB_B: Tensor, joints: Tensor, speeds: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Returns velocity and height of the base by each leg.

        Args:
            gravity_B: direction of gravity, shape (..., 3).
            w_WB_B: angular velocity, rad/s, shape (..., 3).
            joints: angles from the standing pose, rad, shape (..., 12).
            speeds: of the joints, rad/s, shape (..., 12).

        Returns:
            v_WB_H in m/s, shape (..., 4, 3), and height above the toe's centre in m,
            shape (..., 4).
        """
        if self._turned:
            joints, speeds = self.signs * joints, self.signs * speeds
        legs = (*joints.shape[:-1], len(LEGS), 3)
        a, b, c = (joints + self.standing).reshape(legs).unbind(-1)
        da, db, dc = speeds.reshape(legs).unbind(-1)
        (l1, l2), d = self._lengths, self.offset
        x1, z1 = -l1 * torch.sin(b), -l1 * torch.cos(b)
        x2, z2 = -l2 * torch.sin(b + c), -l2 * torch.cos(b + c)
        # In the plane of the leg, which the hip turns about x.
        x, z = x1 + x2, z1 + z2
        dx, dz = z * db + z2 * dc, -x * db - x2 * dc
        sine, cosine = torch.sin(a), torch.cos(a)
        y, up = cosine * d - sine * z, sine * d + cosine * z
        p_BF = self.p_BHip + torch.stack((x, y, up), dim=-1)
        v_BF = torch.stack((dx, -up * da - sine * dz, y * da + cosine * dz), dim=-1)
        turned = torch.linalg.cross(w_WB_B[..., None, :].expand_as(p_BF), p_BF)
        axes = _heading_axes(gravity_B)
        v_WB_H = (-(v_BF + turned)) @ axes
        return v_WB_H, -(p_BF @ axes)[..., 2]


def _heading_axes(gravity_B: Tensor) -> Tensor:
    """Returns R_BH, whose columns are the axes of H in B, shape (..., 3, 3)."""
    up = -gravity_B
    forward = torch.zeros_like(up)
    forward[..., 0] = 1.0
    x = nn.functional.normalize(forward - up[..., :1] * up, dim=-1)
    return torch.stack((x, torch.linalg.cross(up, x), up), dim=-1)
