"""The simulated G1 against the manufacturer's URDF, and files that cannot be."""

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from loco_drake.common.errors import InputError
from loco_drake.models import humanoids
from loco_drake.models.biped_file import read_biped, read_biped_file
from loco_drake.models.legs import MIRROR_POLAR
from loco_drake.models.plant import AddRobotPlant, PlantConfig, plant_damping
from loco_drake.models.robots import get_simulated, robot_settings
from loco_drake.models.standing import stand
from tests.humanoid_motion import mirror_joints
from tests.models.test_biped import FILE


@pytest.fixture(scope="module")
def g1():
    return get_simulated("g1")


@pytest.fixture(scope="module")
def urdf():
    return ET.parse(read_biped_file("g1")[1]).getroot()


@pytest.fixture(scope="module")
def poses(g1):
    random = np.random.default_rng(0)
    return random.uniform(g1.joint_lower, g1.joint_upper, (3, 29))


def test_masses_and_inertias_are_those_of_the_urdf(g1, urdf, poses):
    """The mass matrix in any pose is the manufacturer's, and the rotors'."""
    masses = [float(mass.get("value")) for mass in urdf.iter("mass")]
    assert g1.mass == pytest.approx(sum(masses), rel=1e-12)
    text = ET.tostring(urdf, encoding="unicode")
    text = re.sub(r"<(visual|collision)>.*?</\1>", "", text, flags=re.DOTALL)
    vendor = MultibodyPlant(time_step=0.0)
    Parser(vendor).AddModelsFromString(text, "urdf")
    vendor.Finalize()
    plant, _, _ = AddRobotPlant(DiagramBuilder(), g1, PlantConfig())
    theirs, ours = vendor.CreateDefaultContext(), plant.CreateDefaultContext()
    for name, angle in zip(g1.joint_names, poses[0], strict=True):
        vendor.GetJointByName(name).set_angle(theirs, angle)
        plant.GetJointByName(name).set_angle(ours, angle)
    order = [vendor.GetJointByName(n).velocity_start() for n in g1.joint_names]
    order = [*range(6), *order]
    M = vendor.CalcMassMatrix(theirs)[np.ix_(order, order)]
    M[6:, 6:] += np.diag(g1.reflected_inertia)
    np.testing.assert_allclose(plant.CalcMassMatrix(ours), M, atol=1e-9)
    np.testing.assert_array_equal(plant.GetPositions(ours)[7:], poses[0])


def test_motors_are_those_of_the_urdf_and_damped_by_the_stance(g1, urdf):
    efforts = {
        joint.get("name"): float(joint.find("limit").get("effort"))
        for joint in urdf.iterfind("joint")
        if joint.find("limit") is not None
    }
    assert g1.effort_limits.tolist() == [efforts[name] for name in g1.joint_names]
    np.testing.assert_allclose(0.25 * g1.kp, g1.effort_limits)
    np.testing.assert_allclose(g1.kd**2, 4 * g1.kp * g1.joint_inertia)
    assert plant_damping(g1, PlantConfig()).min() > 0
    with pytest.raises(InputError, match=r"must be at most 0\.0146\d* s for g1"):
        plant_damping(g1, PlantConfig(time_step=0.02))


def test_the_points_that_it_stands_on_are_the_ends_of_its_soles(g1, poses):
    points = g1.contact_points(poses)
    np.testing.assert_allclose(points, read_biped("g1").sole_ends(poses), atol=1e-12)
    J, step = g1.contact_jacobians(poses), 1e-6
    for joint in range(29):
        moved = poses.copy()
        moved[:, joint] += step
        slope = (g1.sole_ends(moved) - points) / step
        for point, joints in enumerate(g1.contact_joints):
            mine = J[:, point, :, joints == joint]
            mine = mine[0] if len(mine) else np.zeros((3, 3))
            np.testing.assert_allclose(slope[:, point], mine, atol=1e-5)


def test_the_mirror_image_of_a_pose_is_that_pose_mirrored(g1, poses):
    order, signs = g1.mirror_joints, g1.mirror_joint_signs
    np.testing.assert_array_equal(order[order], np.arange(29))
    np.testing.assert_array_equal(signs[order] * signs, 1.0)
    images = poses[:, order] * signs
    np.testing.assert_array_equal(images, mirror_joints(poses))
    points = g1.contact_points(poses)[:, [1, 0, 3, 2]] * MIRROR_POLAR
    np.testing.assert_allclose(g1.contact_points(images), points, atol=1e-4)
    # Hands as well.
    origins = g1.joint_origins(poses)[:, order] * MIRROR_POLAR
    np.testing.assert_allclose(g1.joint_origins(images), origins, atol=3e-3)


def test_it_stands(g1):
    stood = stand(g1, 10.0)
    assert stood.stands
    assert abs(stood.sunk) < 0.005


def test_its_numbers_have_sources():
    settings = {setting.what: setting for setting in robot_settings(FILE)}
    assert settings["mass"].value == "33.34 kg"
    assert settings["kp"].source == "the torque limit at 0.25 rad"


def test_no_such_robot():
    with pytest.raises(InputError, match=r"Unknown robot 'g2'.*go2, a1, g1, or"):
        get_simulated("g2")


def _joint(root):
    return next(j for j in root.iterfind("joint") if j.get("name") == "left_knee_joint")


def _mass(root):
    links = root.iterfind("link")
    return next(x for x in links if x.get("name") == "left_knee_link").find(".//mass")


def _add_root(root):
    ET.SubElement(root, "link", name="above")
    joint = ET.SubElement(root, "joint", name="above", type="fixed")
    ET.SubElement(joint, "parent", link="above")
    ET.SubElement(joint, "child", link="pelvis")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda root: _joint(root).remove(_joint(root).find("limit")), "no torque"),
        (lambda root: _joint(root).find("axis").set("xyz", "1 0 0"), "own mirror"),
        (lambda root: _mass(root).set("value", "9"), "the inertia about"),
        (_add_root, "root of the URDF, not pelvis"),
    ],
)
def test_robots_that_cannot_be_simulated_are_refused(monkeypatch, change, reason):
    read = humanoids.read_xml

    def changed(path):
        root = read(path)
        change(root)
        return root

    monkeypatch.setattr(humanoids, "read_xml", changed)
    with pytest.raises(InputError, match=reason):
        humanoids.read_humanoid.__wrapped__("g1")


def test_a_motor_that_gives_too_much_is_refused(tmp_path):
    text = FILE.read_text() + "simulation: {give: 30}\n"
    path = tmp_path / "soft.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"simulation\.give must be"):
        get_simulated(str(path))
