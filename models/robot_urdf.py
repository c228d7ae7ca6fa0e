"""The URDF of 13 rigid bodies with motors, feet and shapes, ready for Drake."""

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from pydrake.math import RigidTransform

from loco_drake.common.arrays import Array

from .rigid_model import Body, Hinge, RigidModel
from .xml_text import add_element, value_text


class Motors(NamedTuple):
    """What drives and limits the joints, each of shape (J,)."""

    lower: Array  # rad
    upper: Array  # rad
    speed: Array  # rad/s
    effort: Array  # N m
    rotor_inertia: Array  # at the joint, kg m^2
    kp: Array  # N m/rad
    kd: Array  # N m s/rad


class Shapes(NamedTuple):
    """What is seen, and touches the ground."""

    trunk_size: Array  # of the box, centred at the trunk's frame, m, shape (3,)
    foot_radius: float  # of feet and knees, m
    knees: Array  # origins of the last joints in the links before them, m, (4, 3)
    foot_friction: float
    stiffness: float  # of a contact, N/m
    dissipation: float  # s/m
    # Lines that stand for the links, from and to in the link's frame, m, (12, 2, 3).
    sticks: Array


_BODY_FRICTION = 0.5  # of trunk and knees, as of Go2 and A1
COLORS = {"trunk": "0.3 0.32 0.36", "L": "0.85 0.6 0.25", "R": "0.4 0.55 0.75"}
FOOT_COLOR = "0.1 0.1 0.1"


def write_urdf(
    name: str, model: RigidModel, feet: Sequence[str], motors: Motors, shapes: Shapes
) -> str:
    """Returns a URDF of the robot ``name`` whose foot frames are called ``feet``."""
    root = ET.Element("robot", {"name": name, "xmlns:drake": "http://drake.mit.edu"})
    trunk, *links = model.bodies
    element = _link(root, trunk)
    box = {"box": {"size": shapes.trunk_size}}
    add_visual(element, box, COLORS["trunk"], np.zeros(3))
    contact = {"stiffness": shapes.stiffness, "dissipation": shapes.dissipation}
    rubbing = {**contact, "friction": _BODY_FRICTION}
    add_collision(element, "trunk", box, np.zeros(3), **rubbing)
    sphere = {"sphere": {"radius": shapes.foot_radius}}
    for k, (hinge, body) in enumerate(zip(model.hinges, links, strict=True)):
        leg, part = divmod(k, 3)
        parent = trunk.name if part == 0 else links[k - 1].name
        _joint(root, hinge, parent, body.name, motors, k)
        element = _link(root, body)
        start, end = shapes.sticks[k]
        add_stick(element, start, end, shapes.foot_radius, COLORS["LR"[leg % 2]])
        if part == 1:
            knee = shapes.knees[leg]
            add_collision(element, f"knee{leg}", sphere, knee, **rubbing)
        if part == 2:
            p_foot = model.feet[leg].translation()
            add_visual(element, sphere, FOOT_COLOR, p_foot)
            friction = shapes.foot_friction
            add_collision(
                element, f"toe{leg}", sphere, p_foot, friction=friction, **contact
            )
            pose = _pose(model.feet[leg])
            add_element(root, "frame", name=feet[leg], link=body.name, **pose)
    for k, hinge in enumerate(model.hinges):
        add_transmission(root, hinge.name, motors, k)
    group = add_element(root, "drake:collision_filter_group", name="robot")
    for body in model.bodies:
        add_element(group, "drake:member", link=body.name)
    add_element(group, "drake:ignored_collision_filter_group", name="robot")
    ET.indent(root)
    return f"{ET.tostring(root, encoding='unicode')}\n"


def _link(root: ET.Element, body: Body) -> ET.Element:
    link = add_element(root, "link", name=body.name)
    inertial = add_element(link, "inertial")
    add_element(inertial, "origin", xyz=body.p_com)
    add_element(inertial, "mass", value=body.mass)
    places = {"xx": (0, 0), "xy": (0, 1), "xz": (0, 2), "yy": (1, 1)}
    places |= {"yz": (1, 2), "zz": (2, 2)}
    moments = {f"i{key}": body.inertia[place] for key, place in places.items()}
    add_element(inertial, "inertia", **moments)
    return link


def _joint(
    root: ET.Element, hinge: Hinge, parent: str, child: str, motors: Motors, k: int
) -> None:
    joint = add_element(root, "joint", name=hinge.name, type="revolute")
    add_element(joint, "parent", link=parent)
    add_element(joint, "child", link=child)
    add_element(joint, "origin", **_pose(hinge.X_PJ))
    add_element(joint, "axis", xyz=hinge.axis)
    add_limits(joint, motors, k)


def add_limits(joint: ET.Element, motors: Motors, k: int) -> None:
    """Adds the limits of a joint, which is number ``k`` of ``motors``."""
    add_element(
        joint,
        "limit",
        lower=motors.lower[k],
        upper=motors.upper[k],
        effort=motors.effort[k],
        velocity=motors.speed[k],
    )


def add_transmission(root: ET.Element, joint: str, motors: Motors, k: int) -> None:
    """Adds the motor of a joint, which is number ``k`` of ``motors``."""
    element = add_element(root, "transmission", name=f"{joint}_transmission")
    kind = add_element(element, "type")
    kind.text = "transmission_interface/SimpleTransmission"
    add_element(element, "joint", name=joint)
    actuator = add_element(element, "actuator", name=joint.removesuffix("_joint"))
    add_element(actuator, "drake:rotor_inertia", value=motors.rotor_inertia[k])
    add_element(actuator, "drake:gear_ratio", value=1)
    gains = {"p": motors.kp[k], "d": motors.kd[k]}
    add_element(actuator, "drake:controller_gains", **gains)


def add_collision(
    link: ET.Element,
    name: str,
    shape: dict[str, dict[str, Any]],
    at: Array,
    *,
    friction: float,
    stiffness: float,
    dissipation: float,
) -> None:
    """Adds a shape that touches: Coulomb's friction, N/m and s/m of its contacts."""
    collision = add_element(link, "collision", name=name)
    _shape(collision, shape, at)
    properties = add_element(collision, "drake:proximity_properties")
    for key, value in (
        ("point_contact_stiffness", stiffness),
        ("hunt_crossley_dissipation", dissipation),
        # Of "sap" only; Drake's own would let feet sink in.
        ("relaxation_time", 1e-3),
        ("mu_static", friction),
        ("mu_dynamic", friction),
    ):
        add_element(properties, f"drake:{key}", value=value)


def add_visual(
    link: ET.Element, shape: dict[str, dict[str, Any]], color: str, at: Array
) -> ET.Element:
    """Adds a shape that is seen, at a place in the link's frame, m; returns it."""
    visual = add_element(link, "visual")
    _shape(visual, shape, at)
    material = add_element(visual, "material")
    add_element(material, "color", rgba=f"{color} 1")
    return visual


def add_stick(
    link: ET.Element, start: Array, end: Array, radius: float, color: str
) -> None:
    """Adds a rod that is seen, between two places in the link's frame, m."""
    way = end - start
    length = float(np.linalg.norm(way))
    if length < radius:
        add_visual(link, {"sphere": {"radius": 0.8 * radius}}, color, start)
        return
    pitch = np.arctan2(np.hypot(way[0], way[1]), way[2])
    rpy = np.array([0.0, pitch, np.arctan2(way[1], way[0])])
    rod = {"cylinder": {"radius": 0.8 * radius, "length": length}}
    visual = add_visual(link, rod, color, (start + end) / 2)
    (origin,) = visual.iterfind("origin")
    origin.set("rpy", value_text(rpy))


def _shape(parent: ET.Element, shape: dict[str, dict[str, Any]], at: Array) -> None:
    add_element(parent, "origin", xyz=at)
    ((kind, sizes),) = shape.items()
    add_element(add_element(parent, "geometry"), kind, **sizes)


def _pose(X: RigidTransform) -> dict[str, Any]:
    return {"xyz": X.translation(), "rpy": X.rotation().ToRollPitchYaw().vector()}
