"""A robot of any URDF as 13 rigid bodies.

Links that fixed joints tie together are one body, their inertias combined. The bodies
are in the order of the joints: trunk, then hip, thigh and calf of FL, FR, RL, RR.
"""

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, RevoluteJoint
from pydrake.systems.framework import Context

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError

from .urdf import LegFile, read_xml, strip_urdf, unreadable

# Lightest body, of the robot's mass: an integrator cannot follow lighter ones.
_LEAST_SHARE = 1e-4


class Body(NamedTuple):
    """A rigid body, in the frame of its link."""

    name: str
    mass: float  # kg
    p_com: Array  # centre of mass, m, shape (3,)
    inertia: Array  # about the centre of mass, kg m^2, shape (3, 3)


class Hinge(NamedTuple):
    """A joint, of which the link beyond has the frame."""

    name: str
    X_PJ: RigidTransform  # its frame in that of the link before it
    axis: Array  # in its frame, shape (3,)


class RigidModel(NamedTuple):
    """Bodies and joints of a robot."""

    bodies: tuple[Body, ...]  # trunk and legs, 13
    hinges: tuple[Hinge, ...]  # 12
    feet: tuple[RigidTransform, ...]  # foot frames in the last links, 4
    efforts: Array  # limits of torque in the URDF, N m; nan where it has none, (12,)


def read_rigid_model(path: Path, trunk: str, legs: Sequence[LegFile]) -> RigidModel:
    """Returns the bodies of a robot whose legs :func:`.urdf.read_legs` has read.

    Raises:
        InputError: if a body has no mass, or an inertia that no body can have.
    """
    root = read_xml(path)
    names = [joint for leg in legs for joint in leg.joints]
    efforts = np.array([read_effort(root, name) for name in names])
    plant = MultibodyPlant(time_step=0.0)
    try:
        model = strip_urdf(root, names, inertial=True)
        Parser(plant).AddModelsFromString(model, "urdf")
        plant.Finalize()
    except (RuntimeError, ValueError) as error:
        raise unreadable(path, error) from None
    context = plant.CreateDefaultContext()
    joints: list[RevoluteJoint] = [plant.GetJointByName(name) for name in names]
    frames: list[Frame] = [plant.GetFrameByName(trunk)]
    frames += [joint.frame_on_child() for joint in joints]
    links = [trunk, *(joint.child_body().name() for joint in joints)]
    bodies = [
        _body(plant, context, frame, link)
        for frame, link in zip(frames, links, strict=True)
    ]
    total = sum(body.mass for body in bodies)
    for body in bodies:
        if body.mass < _LEAST_SHARE * total or total <= 0:
            raise InputError(
                f"To be simulated every link needs a mass, but {body.name} has "
                f"{body.mass:.3g} kg in {path.name}."
            )
    before = [frames[0] if k % 3 == 0 else frames[k] for k in range(len(joints))]
    hinges = [
        Hinge(
            joint.name(),
            joint.frame_on_parent().CalcPose(context, frame),
            joint.revolute_axis(),
        )
        for joint, frame in zip(joints, before, strict=True)
    ]
    feet = [
        plant.GetFrameByName(leg.foot).CalcPose(context, frames[3 * k + 3])
        for k, leg in enumerate(legs)
    ]
    return RigidModel(tuple(bodies), tuple(hinges), tuple(feet), efforts)


def _body(plant: MultibodyPlant, context: Context, frame: Frame, name: str) -> Body:
    """Returns what is welded to a frame as one body.

    Raises InputError if its inertia is not that of a body.
    """
    welded = [body.index() for body in plant.GetBodiesWeldedTo(frame.body())]
    # An inertia without mass has no centre.
    if sum(plant.get_body(k).default_mass() for k in welded) <= 0:
        return Body(name, 0.0, np.zeros(3), np.zeros((3, 3)))
    M = plant.CalcSpatialInertia(context, frame, welded)
    if not M.IsPhysicallyValid():
        raise InputError(
            f"Link {name}, with what is fixed to it, has an inertia that no body can "
            "have: of its principal moments each must be less than the other two "
            "together."
        )
    central = M.Shift(M.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
    return Body(name, M.get_mass(), M.get_com(), central)


def read_effort(root: ET.Element, joint: str) -> float:
    """Returns a joint's limit of torque, nan if there is none."""
    (element,) = (j for j in root.iterfind("joint") if j.get("name") == joint)
    limit = element.find("limit")
    try:
        return float("nan" if limit is None else limit.get("effort", "nan"))
    except ValueError:
        raise InputError(f"The effort limit of joint {joint} is no number.") from None
