"""Differentiable momentum of several robots in one batch, for training.

A rigid body of mass m whose second moments of mass along the principal axes through its
centre are s_i moves like four points of m / 4 each, at the alternate corners of a box
of plus and minus sqrt(s_i / m): mass, centre and inertia are the same. Points need no
angular velocities.
"""

from collections.abc import Sequence
from itertools import chain

import numpy as np
import torch
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from torch import Tensor

from loco_drake.common.arrays import Array
from loco_drake.common.gravity import GRAVITY
from loco_drake.generation import features as ft
from loco_drake.generation.tokenizer_score import over_ground
from loco_drake.models.robots import Robot, get_robot
from loco_drake.motion.motion import FPS

# Alternate corners of a box, (4, 3).
_CORNERS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
_POINTS = len(_CORNERS)  # of a body
_ROUNDING = 1e-9  # m
REGULARIZATION = 0.1  # of the forces in PointMasses.unexplained
_DOWN = (0.0, 0.0, 1.0)


class PointMasses:
    """Robots as points, named in order."""

    def __init__(
        self, names: Sequence[str], device: torch.device | str = "cpu"
    ) -> None:
        robots = [get_robot(name) for name in names]
        bodies = [_bodies(robot) for robot in robots]

        def table(values: list[Array]) -> Tensor:
            array = np.array(values)
            return torch.tensor(array, dtype=torch.float32, device=device)

        self._hips = table([r.p_BHip for r in robots])
        self._offset = table([r.abduction_offset for r in robots])
        self._thigh = table([np.array(r.thigh_length) for r in robots])
        self._calf = table([np.array(r.calf_length) for r in robots])
        forward = np.array([r.knee_signs > 0 for r in robots])
        self._forward = torch.tensor(forward, device=device)
        self._any_forward = bool(forward.any())
        self._height = table([np.array(r.stand_height) for r in robots])
        # Of the feet, in standing heights.
        radii = [np.array([r.foot_radius / r.stand_height]) for r in robots]
        self._radius = table(radii)
        self._trunk = table([points[0] for points, _ in bodies])  # (R, 4, 3)
        # Of hips, thighs and calves in their frames, (R, 3, 4, 4, 3).
        legs = [
            points[1:].reshape(4, 3, _POINTS, 3).swapaxes(0, 1) for points, _ in bodies
        ]
        self._legs = table(legs)
        # Shares of the robot's mass, in the order of :meth:`positions`.
        shares = []
        for _, masses in bodies:
            order = [masses[:1], masses[1:].reshape(4, 3).T.ravel()]
            shares.append(np.repeat(np.concatenate(order), _POINTS) / _POINTS)
        self._shares = table([share / share.sum() for share in shares])

    def positions(self, features: Tensor, robot: Tensor) -> Tensor:
        """Returns the points as :meth:`.Toes.positions` does toes, (B, T, 52, 3)."""
        joints = features[..., ft.JOINTS]
        hip, thigh, calf = joints.reshape(*joints.shape[:-1], 4, 3).unbind(-1)
        if self._any_forward:
            thigh, calf = self._turn_knees(thigh, calf, robot)
        zero = torch.zeros_like(hip)
        # Origins of the frames in the frame of the hip, which turns about x.
        p_thigh = torch.stack((zero, zero + self._offset[robot][:, None], zero), dim=-1)
        l1 = self._thigh[robot, None, None]
        down = torch.stack((-l1 * thigh.sin(), zero, -l1 * thigh.cos()), dim=-1)
        links = self._legs[robot][:, None]  # (B, 1, 3, 4, 4, 3)
        parts = (
            links[:, :, 0].expand(-1, hip.shape[1], -1, -1, -1),
            p_thigh[..., None, :] + _about_y(links[:, :, 1], thigh[..., None]),
            (p_thigh + down)[..., None, :]
            + _about_y(links[:, :, 2], (thigh + calf)[..., None]),
        )
        in_hip = torch.stack(parts, dim=2)  # (B, T, 3, 4, 4, 3)
        p_B = _about_x(in_hip, hip[:, :, None, :, None])
        p_B = p_B + self._hips[robot][:, None, None, :, None]
        trunk = self._trunk[robot][:, None].expand(-1, hip.shape[1], -1, -1)
        points = torch.cat((trunk, p_B.flatten(2, 4)), dim=2)
        roll, pitch = features[..., None, ft.ROLL_PITCH].unbind(-1)  # (B, T, 1)
        points = _about_y(_about_x(points, roll), pitch)
        height = features[..., ft.HEIGHT] * self._height[robot, None, None]
        lift = torch.cat(
            (torch.zeros_like(height), torch.zeros_like(height), height), -1
        )
        return points + lift[:, :, None]

    def _turn_knees(
        self, thigh: Tensor, calf: Tensor, robot: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Returns the legs as they are of those whose knees point forward."""
        l1, l2 = self._thigh[robot, None, None], self._calf[robot, None, None]
        turned = thigh + 2 * torch.atan2(l2 * calf.sin(), l1 + l2 * calf.cos())
        forward = self._forward[robot][:, None]
        return torch.where(forward, turned, thigh), torch.where(forward, -calf, calf)

    def wrench(self, features: Tensor, robot: Tensor) -> Tensor:
        """Returns [L' / (m g h), c'' / g] at the frames 1 to T - 2, (B, T - 2, 6).

        c is the centre of mass, L the angular momentum about it, m and h mass and
        standing height, as in :mod:`loco_drake.motion.momentum`.
        """
        return self._wrench(features, self.positions(features, robot), robot)

    def unexplained(
        self, output: Tensor, target: Tensor, toes: Tensor, robot: Tensor
    ) -> Tensor:
        """Returns what forces of the feet do not explain of the error of the wrench.

        That is the least |e - G f|^2 + REGULARIZATION |f|^2 of all forces f of the feet
        that stand in the target, where e is the error of :meth:`wrench` and G f the
        wrench of forces in units of the weight. In flight it is |e|^2.

        Args:
            output: features, shape (B, T, SIZE).
            target: features, whose contacts count, (B, T, SIZE).
            toes: of the target, from :meth:`.Toes.positions`, (B, T, 4, 3).
            robot: indices, (B,).

        Returns:
            At the frames 1 to T - 2, shape (B, T - 2).
        """
        points = self.positions(target, robot)
        com = (self._shares[robot][:, None, :, None] * points).sum(dim=2)
        # To the soles, in standing heights.
        arms = (toes - com[:, :, None]) / self._height[robot, None, None, None]
        down = torch.tensor(_DOWN, device=arms.device)
        arms = arms[:, 1:-1] - self._radius[robot][:, None, None] * down
        x, y, z = arms.unbind(-1)  # (B, T - 2, 4)
        zero = torch.zeros_like(x)
        force = torch.eye(3, device=x.device).expand(*x.shape, 3, 3)
        rows = torch.stack((zero, -z, y, z, zero, -x, -y, x, zero), dim=-1)
        moment = rows.reshape(*x.shape, 3, 3)
        grasp = torch.cat((moment, force), dim=-2)  # (B, T - 2, 4, 6, 3)
        grasp = grasp * target[:, 1:-1, ft.CONTACTS, None, None]
        spread = torch.einsum("btlij,btlkj->btik", grasp, grasp) / REGULARIZATION
        weight = torch.linalg.inv(torch.eye(6, device=x.device) + spread)
        wanted = self._wrench(target, points, robot)
        error = self.wrench(output, robot) - wanted
        return torch.einsum("bti,btij,btj->bt", error, weight, error)

    def _wrench(self, features: Tensor, points: Tensor, robot: Tensor) -> Tensor:
        height = self._height[robot]
        v = over_ground(features, points, height)  # (B, T - 1, 52, 3)
        middle = (points[:, 1:] + points[:, :-1]) / 2
        share = self._shares[robot][:, None, :, None]
        com, v_com = (share * middle).sum(2), (share * v).sum(2)
        angular = (
            share * torch.linalg.cross(middle - com[:, :, None], v - v_com[:, :, None])
        ).sum(2)
        rate = features[:, 1:, ft.YAW_RATE]
        rate = (rate[:, 1:] + rate[:, :-1]) / 2
        scaled = (angular / (GRAVITY * height[:, None, None]), v_com / GRAVITY)
        return torch.cat([_change(value, rate) for value in scaled], dim=-1)


def _change(value: Tensor, rate: Tensor) -> Tensor:
    """Returns the time derivative of vectors in H, (B, T - 1, 3), as H turns."""
    x, y, _ = ((value[:, 1:] + value[:, :-1]) / 2).unbind(-1)
    turn = rate[..., 0]
    turning = torch.stack((-turn * y, turn * x, torch.zeros_like(x)), dim=-1)
    return (value[:, 1:] - value[:, :-1]) * FPS + turning


def _about_x(p: Tensor, angle: Tensor) -> Tensor:
    """Turns points (..., 3) by angles that broadcast over them."""
    x, y, z = p.unbind(-1)
    s, c = angle.sin(), angle.cos()
    left, up = c * y - s * z, s * y + c * z
    return torch.stack((x.expand_as(left), left, up), dim=-1)


def _about_y(p: Tensor, angle: Tensor) -> Tensor:
    """Turns points (..., 3) by angles that broadcast over them."""
    x, y, z = p.unbind(-1)
    s, c = angle.sin(), angle.cos()
    forward, up = c * x + s * z, c * z - s * x
    return torch.stack((forward, y.expand_as(up), up), dim=-1)


def _bodies(robot: Robot) -> tuple[Array, Array]:
    """Returns the points of trunk and links in their frames, and masses.

    The links are in the order of the joints: points (13, 4, 3) in m, masses (13,).
    Whatever is welded to a link, such as a foot, is part of it. A link's frame is that
    of a leg that hangs down straight, in the plane of the toe, axes along those of B.
    """
    plant = MultibodyPlant(time_step=0.0)
    model = robot.AddModel(Parser(plant))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    straight = -robot.joint_signs * robot.joint_zeros
    plant.SetPositions(context, model, [1.0, *[0.0] * 6, *straight])
    down = robot.thigh_length * np.array([0.0, 0.0, 1.0])
    legs = zip(robot.p_BHip, robot.p_BV, robot.p_BV - down, strict=True)
    origins = [np.zeros(3), *chain.from_iterable(legs)]
    frames = [plant.GetUniqueFloatingBaseBodyOrThrow(model).body_frame()] + [
        plant.GetJointByName(name, model).frame_on_child() for name in robot.joint_names
    ]
    points, masses = [], []
    for frame, origin in zip(frames, origins, strict=True):
        welded = plant.GetBodiesWeldedTo(frame.body())
        inertia = plant.CalcSpatialInertia(
            context, frame, [body.index() for body in welded]
        )
        mass = inertia.get_mass()
        centre = inertia.get_com()
        unit = inertia.Shift(centre).CalcRotationalInertia().CopyToFullMatrix3()
        moments, axes = np.linalg.eigh(unit)
        second = np.maximum(moments.sum() / 2 - moments, 0.0)
        corners = centre + _CORNERS * np.sqrt(second / mass) @ axes.T
        X_BL = frame.CalcPoseInWorld(context)
        shift = X_BL.translation() - origin
        shift[np.abs(shift) < _ROUNDING] = 0.0
        points.append(corners @ X_BL.rotation().matrix().T + shift)
        masses.append(mass)
    return np.array(points), np.array(masses)
