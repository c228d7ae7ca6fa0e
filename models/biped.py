"""A robot on two legs with a waist and arms, as its URDF has it."""

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex

from loco_drake.common.arrays import Array

from .legged import LeggedRobot
from .urdf import strip_urdf

_SWEEP = 60  # samples of a joint's range
_SAME = 1e-3  # m


@dataclass(frozen=True, eq=False, kw_only=True)
class Biped(LeggedRobot):
    """A humanoid of which the kinematics are known, and nothing else.

    Joints are those of the left leg, the right leg, the waist, the left and the right
    arm, in a limb from the trunk outward. Left comes before right. B, the trunk, is the
    pelvis; C is the chest, above the waist. Each foot stands on four spheres, two at
    the heel and two at the toe.
    """

    model: str  # URDF text of links and joints alone
    leg_joints: int  # number of joints in both legs
    arm_joints: int  # number of joints in both arms
    foot_frames: tuple[str, ...]  # of left and right, with the soles' spheres
    heel: Array  # middle of the two spheres of a heel in a foot's frame, m, shape (3,)
    toe: Array  # that of a toe, shape (3,)
    sole_half_width: float  # y of the left spheres from there, m
    p_BHip: Array  # origins of the legs' first joints, m, shape (2, 3)
    chest_frame: str  # name of C
    # Frames of elbow and wrist of left and right.
    arm_frames: tuple[tuple[str, str], ...]
    # Names of the arms' second joints, about which they swing to the side.
    shoulder_joints: tuple[str, ...]

    def AddModel(self, parser: Parser) -> ModelInstanceIndex:
        """Adds links and joints to the parser's plant."""
        (instance,) = parser.AddModelsFromString(self.model, "urdf")
        return instance

    def AddLegs(self, parser: Parser) -> ModelInstanceIndex:
        """Adds the model with joints that move in the legs only."""
        return self._add(parser, self.joint_names[: self.leg_joints])

    def AddUpperBody(self, parser: Parser) -> ModelInstanceIndex:
        """Adds the model with joints that move in waist and arms only."""
        return self._add(parser, self.joint_names[self.leg_joints :])

    def side(self, joint: int) -> str:
        """Returns the side of the joint with this number: left, right or middle."""
        arms = len(self.joint_names) - self.arm_joints
        if self.leg_joints <= joint < arms:
            return "middle"
        first, count = (
            (0, self.leg_joints) if joint < self.leg_joints else (arms, self.arm_joints)
        )
        return "left" if joint < first + count // 2 else "right"

    @property
    def sole_length(self) -> float:
        """From heel to toe, m."""
        return float(np.linalg.norm(self.toe - self.heel))

    @property
    def sole_middle(self) -> Array:
        """Midway between heel and toe in a foot's frame, m, shape (3,)."""
        middle: Array = (self.heel + self.toe) / 2
        return middle

    @property
    def hip_height(self) -> float:
        """Of the middle between the hips over the ground in the stance, m."""
        return float(self.stand_height + self.p_BHip[:, 2].mean())

    @cached_property
    def p_BV(self) -> Array:
        """Above the middles of the soles in the stance, as high as hips, m, (2, 3)."""
        soles = self.sole_ends(self.stand_joints)
        p_BV: Array = (soles[:2] + soles[2:]) / 2
        p_BV[:, 2] = self.p_BHip[:, 2]
        return p_BV

    @cached_property
    def p_BReach(self) -> Array:
        """Where the legs swing fore and aft: hips beside the feet, m, shape (2, 3)."""
        feet = self._place(
            self.stand_joints, [(f, np.zeros(3)) for f in self.foot_frames]
        )
        return np.stack((self.p_BHip[:, 0], feet[:, 1], self.p_BHip[:, 2]), axis=-1)

    @cached_property
    def leg_reach(self) -> float:
        """Longest distance from there to a foot's frame with the leg straight, m."""
        frames = [(frame, np.zeros(3)) for frame in self.foot_frames]
        start = self._place(self.stand_joints, frames)
        longest = 0.0
        for k in range(self.leg_joints // 2):
            for angle in np.linspace(self.joint_lower[k], self.joint_upper[k], _SWEEP):
                joints = self.stand_joints.copy()
                joints[k] = angle
                foot = self._place(joints, frames)[0]
                if abs(foot[1] - start[0, 1]) < _SAME:
                    length = np.linalg.norm(foot - self.p_BReach[0])
                    longest = max(longest, float(length))
        return longest

    @cached_property
    def p_BChest(self) -> Array:
        """Origin of the chest's frame in the stance, m, shape (3,)."""
        p: Array = self._place(self.stand_joints, [(self.chest_frame, np.zeros(3))])[0]
        return p

    @cached_property
    def p_CShoulder(self) -> Array:
        """Shoulders in the chest's frame, which is parallel to B there, m, (2, 3)."""
        p_C: Array = self._shoulders - self.p_BChest
        return p_C

    @cached_property
    def arm_lengths(self) -> Array:
        """From shoulder to elbow, from there to the wrist, of both arms, m, (2, 2)."""
        frames = [(frame, np.zeros(3)) for arm in self.arm_frames for frame in arm]
        ends = self._place(self.stand_joints, frames).reshape(2, 2, 3)
        points = np.concatenate((self._shoulders[:, None], ends), axis=1)
        lengths: Array = np.linalg.norm(np.diff(points, axis=1), axis=-1)
        return lengths

    def toe_positions(self, joints: Array) -> Array:
        """Returns p_BF in m, the centres of the soles' spheres, (..., 8, 3).

        Those of toes come first, left before right.
        """
        aside = np.array([0.0, self.sole_half_width, 0.0])
        points = [
            (frame, end + sign * aside)
            for end in (self.toe, self.heel)
            for frame in self.foot_frames
            for sign in (1.0, -1.0)
        ]
        return self._place(joints, points)

    def sole_ends(self, joints: Array) -> Array:
        """Returns toes left and right and heels left and right in B, m, (..., 4, 3)."""
        points = [(f, end) for end in (self.toe, self.heel) for f in self.foot_frames]
        return self._place(joints, points)

    def joint_origins(self, joints: Array) -> Array:
        """Returns the origins of all joints in B, m, shape (..., J, 3)."""
        plant, _ = self._plant
        frames = [
            plant.GetJointByName(name).child_body().name() for name in self.joint_names
        ]
        return self._place(joints, [(frame, np.zeros(3)) for frame in frames])

    @cached_property
    def _shoulders(self) -> Array:
        plant, _ = self._plant
        links = [
            plant.GetJointByName(j).child_body().name() for j in self.shoulder_joints
        ]
        return self._place(self.stand_joints, [(link, np.zeros(3)) for link in links])

    @cached_property
    def _plant(self) -> tuple[MultibodyPlant, list[int]]:
        """The model with its trunk at the world, and where joints' positions are."""
        plant = MultibodyPlant(time_step=0.0)
        self.AddModel(Parser(plant))
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(self.trunk_frame))
        plant.Finalize()
        starts = [plant.GetJointByName(j).position_start() for j in self.joint_names]
        return plant, starts

    def _place(self, joints: Array, points: Sequence[tuple[str, Array]]) -> Array:
        """Returns points fixed in frames, named, in B, m, (..., N, 3)."""
        plant, order = self._plant
        context = plant.CreateDefaultContext()
        frames = [(plant.GetFrameByName(name), p) for name, p in points]
        world = plant.world_frame()
        q = np.empty(len(order))
        placed = np.empty((*joints.shape[:-1], len(points), 3))
        for index in np.ndindex(joints.shape[:-1]):
            q[order] = joints[index]
            plant.SetPositions(context, q)
            for n, (frame, p) in enumerate(frames):
                at = plant.CalcPointsPositions(context, frame, p, world)
                placed[(*index, n)] = at[:, 0]
        return placed

    def _add(self, parser: Parser, joints: Sequence[str]) -> ModelInstanceIndex:
        text = strip_urdf(ET.fromstring(self.model), joints)
        (instance,) = parser.AddModelsFromString(text, "urdf")
        return instance
