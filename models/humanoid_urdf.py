"""The URDF of a humanoid with motors and soles, ready for Drake."""

import xml.etree.ElementTree as ET

import numpy as np

from loco_drake.common.arrays import Array

from .biped import Biped
from .robot_urdf import (
    COLORS,
    FOOT_COLOR,
    Motors,
    add_collision,
    add_limits,
    add_stick,
    add_transmission,
    add_visual,
)
from .urdf import strip_urdf
from .xml_text import add_element

_BONE = 0.05  # radius of what is seen, standing heights
_SIDES = {"left": "L", "middle": "trunk", "right": "R"}


def write_humanoid(
    root: ET.Element,
    robot: Biped,
    motors: Motors,
    *,
    friction: float,
    stiffness: float,
    dissipation: float,
) -> str:
    """Returns a manufacturer's URDF, ``root``, with motors and soles; changes it.

    Links keep their inertias, and joints that are not the robot's do not move. Only the
    eight spheres of the soles touch the ground, each with the stiffness in N/m and the
    dissipation in s/m.
    """
    strip_urdf(root, robot.joint_names, inertial=True)
    root.attrib |= {"name": robot.name, "xmlns:drake": "http://drake.mit.edu"}
    joints = {str(joint.get("name")): joint for joint in root.iterfind("joint")}
    links = {str(link.get("name")): link for link in root.iterfind("link")}
    for k, name in enumerate(robot.joint_names):
        # Drake's order of positions follows that of the file.
        root.remove(joints[name])
        root.append(joints[name])
        joints[name].set("type", "revolute")
        add_limits(joints[name], motors, k)
        add_transmission(root, name, motors, k)
        _add_bone(links, joints[name], robot, COLORS[_SIDES[robot.side(k)]])
    sphere = {"sphere": {"radius": robot.foot_radius}}
    contact = {"friction": friction, "stiffness": stiffness, "dissipation": dissipation}
    for frame in robot.foot_frames:
        for name, end in (("toe", robot.toe), ("heel", robot.heel)):
            for sign in (1.0, -1.0):
                at = end + np.array([0.0, sign * robot.sole_half_width, 0.0])
                label = f"{frame}_{name}{'L' if sign > 0 else 'R'}"
                add_collision(links[frame], label, sphere, at, **contact)
        _add_sole(links[frame], robot)
    group = add_element(root, "drake:collision_filter_group", name="robot")
    for link in links:
        add_element(group, "drake:member", link=link)
    add_element(group, "drake:ignored_collision_filter_group", name="robot")
    ET.indent(root)
    return f"{ET.tostring(root, encoding='unicode')}\n"


def _add_bone(
    links: dict[str, ET.Element], joint: ET.Element, robot: Biped, color: str
) -> None:
    """Adds a rod from the origin of the link before a joint to the joint."""
    parent, origin = joint.find("parent"), joint.find("origin")
    if parent is None or origin is None:
        return
    end = np.array([float(x) for x in origin.get("xyz", "0 0 0").split()])
    link = links[str(parent.get("link"))]
    add_stick(link, np.zeros(3), end, _BONE * robot.stand_height, color)


def _add_sole(link: ET.Element, robot: Biped) -> None:
    flat: Array = np.array(
        [robot.sole_length, 2 * robot.sole_half_width, 2 * robot.foot_radius]
    )
    add_visual(link, {"box": {"size": flat}}, FOOT_COLOR, robot.sole_middle)
