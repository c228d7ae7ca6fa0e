import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from loco_drake.common.errors import InputError
from loco_drake.models.robots import ROBOTS, AddRobotModel, ConfigureParser, get_robot

NAMES = [
    f"{leg}_{joint}"
    for leg in ("FL", "FR", "RL", "RR")
    for joint in ("hip", "thigh", "calf")
]


@pytest.mark.parametrize("name", ROBOTS)
def test_order_of_positions_velocities_and_actuators(name):
    """q is [wxyz, p_WB, joints], v is [w, v, joints], u the joints, legs in order."""
    plant = MultibodyPlant(0.0)
    AddRobotModel(Parser(plant), name, visual=False)
    plant.Finalize()
    assert plant.num_bodies() == 1 + 13
    assert plant.GetPositionNames(add_model_instance_prefix=False) == [
        *("base_qw", "base_qx", "base_qy", "base_qz", "base_x", "base_y", "base_z"),
        *(f"{joint}_joint_q" for joint in NAMES),
    ]
    assert plant.GetVelocityNames(add_model_instance_prefix=False) == [
        *("base_wx", "base_wy", "base_wz", "base_vx", "base_vy", "base_vz"),
        *(f"{joint}_joint_w" for joint in NAMES),
    ]
    assert plant.GetActuatorNames(add_model_instance_prefix=False) == NAMES
    for index in plant.GetJointActuatorIndices():
        actuator = plant.get_joint_actuator(index)
        assert actuator.joint().name() == f"{actuator.name()}_joint"
    assert get_robot(name).joint_names == tuple(f"{joint}_joint" for joint in NAMES)


def test_go2_numbers():
    """What is read from the model is what the data sheets say."""
    robot = get_robot("go2")
    np.testing.assert_allclose(robot.mass, 16.085)
    np.testing.assert_allclose(robot.effort_limits, np.tile([23.7, 23.7, 35.55], 4))
    np.testing.assert_allclose(
        robot.joint_speed_limits, np.tile([30.1, 30.1, 20.07], 4)
    )
    np.testing.assert_allclose(robot.p_BHip[0], [0.1934, 0.0465, 0])
    np.testing.assert_allclose(
        robot.abduction_offset, 0.0955 * np.array([1, -1, 1, -1])
    )
    assert (robot.thigh_length, robot.calf_length) == (0.213, 0.213)
    assert robot.foot_radius == 0.022
    np.testing.assert_allclose(robot.trunk_size, [0.3762, 0.0935, 0.114])


def test_a1_numbers():
    robot = get_robot("a1")
    np.testing.assert_allclose(robot.mass, 13.741)
    np.testing.assert_allclose(robot.effort_limits, 33.5)
    np.testing.assert_allclose(robot.joint_speed_limits, 21.0)
    np.testing.assert_allclose(robot.p_BHip[3], [-0.1805, -0.047, 0])
    np.testing.assert_allclose(robot.abduction_offset[3], -0.0838)
    assert (robot.thigh_length, robot.calf_length) == (0.2, 0.2)
    assert robot.foot_radius == 0.02


def test_motor_of_the_go2_gives_the_same_power_at_every_joint():
    """The calf's linkage trades speed for torque: the product is the motor's."""
    robot = get_robot("go2")
    power = robot.effort_limits * robot.joint_speed_limits
    np.testing.assert_allclose(power, 23.7 * 30.1, rtol=1e-3)
    ratio = np.sqrt(robot.reflected_inertia[2] / robot.reflected_inertia[0])
    np.testing.assert_allclose(ratio, 1.5)
    np.testing.assert_allclose(robot.effort_limits[2] / robot.effort_limits[0], 1.5)


@pytest.mark.parametrize("name", ROBOTS)
def test_stance_height(name):
    """With equal links and toes below the hips, height is 2 l cos(thigh) + radius."""
    robot = get_robot(name)
    thigh, calf = robot.stand_joints[1:3]
    assert calf == -2 * thigh
    height = 2 * robot.thigh_length * np.cos(thigh) + robot.foot_radius
    np.testing.assert_allclose(robot.stand_height, height)
    assert np.all(robot.stand_joints > robot.joint_lower)
    assert np.all(robot.stand_joints < robot.joint_upper)


@pytest.mark.parametrize("name", ROBOTS)
def test_robot_is_shared_and_read_only(name):
    """get_robot returns one object, so nobody may write to its arrays."""
    robot = get_robot(name)
    assert get_robot(name) is robot
    with pytest.raises(ValueError, match="read-only"):
        robot.kp[0] = 1.0


def test_unknown_robot_is_named_with_the_choices():
    with pytest.raises(
        InputError, match=r"Unknown robot 'spot'; the choices are go2, a1, or"
    ):
        get_robot("spot")
    with pytest.raises(InputError, match="the choices are go2, a1"):
        AddRobotModel(Parser(MultibodyPlant(0.0)), "../go2", visual=False)


def test_packages_are_registered(mesh_cache):
    """Both packages resolve; without visuals only the models' does."""
    parser = Parser(MultibodyPlant(0.0))
    ConfigureParser(parser)
    packages = parser.package_map()
    assert packages.GetPath("loco_drake_meshes") == str(mesh_cache / "meshes")
    assert packages.ResolveUrl(get_robot("a1").url).endswith("models/a1/a1.urdf")
    bare = Parser(MultibodyPlant(0.0))
    ConfigureParser(bare, visual=False)
    assert not bare.package_map().Contains("loco_drake_meshes")
