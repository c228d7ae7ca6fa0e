"""The robot in MuJoCo is the robot in Drake; other models of it are taken too."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from loco_drake.common.errors import InputError
from loco_drake.common.rotations import quat_rotate
from loco_drake.models.mjcf import robot_mjcf
from loco_drake.models.mujoco_plant import MujocoConfig, MujocoPlant
from loco_drake.models.robots import ROBOTS, get_robot

mujoco = pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")

FAR_UP = 50.0  # m


def standing(robot, height=0.0):
    base = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, robot.stand_height + height]
    return np.concatenate((base, robot.stand_joints, np.zeros(18)))


def random_state(robot, random):
    quaternion = random.normal(size=4)
    quaternion /= np.linalg.norm(quaternion)
    joints = random.uniform(robot.joint_lower, robot.joint_upper)
    position = [*random.normal(size=2), FAR_UP]
    return np.concatenate((quaternion, position, joints, 3 * random.normal(size=18)))


@pytest.mark.parametrize("name", ROBOTS)
def test_bodies_in_the_air_accelerate_as_in_drake(name):
    """With equal joint torques: masses, inertias, rotors, axes, gravity and bias."""
    robot = get_robot(name)
    drake = MultibodyPlant(0.0)
    robot.AddModel(Parser(drake))
    drake.Finalize()
    context = drake.CreateDefaultContext()
    ours = MujocoPlant(robot, MujocoConfig())
    ours.model.actuator_gainprm[:] = ours.model.actuator_biasprm[:] = 0.0
    random = np.random.default_rng(0)
    for _ in range(20):
        state, torques = random_state(robot, random), random.uniform(-20, 20, 12)
        drake.SetPositionsAndVelocities(context, state)
        applied = np.concatenate((np.zeros(6), torques))
        forces = applied + drake.CalcGravityGeneralizedForces(context)
        M = drake.CalcMassMatrix(context)
        expected = np.linalg.solve(M, forces - drake.CalcBiasTerm(context))
        ours.set_state(state)
        ours.data.qfrc_applied[6:] = torques
        mujoco.mj_forward(ours.model, ours.data)
        linear, angular_B, joints = np.split(ours.data.qacc, [3, 6])
        found = np.concatenate((quat_rotate(state[:4], angular_B), linear, joints))
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", ROBOTS)
def test_states_are_those_of_drake(name):
    robot = get_robot(name)
    plant = MujocoPlant(robot, MujocoConfig())
    state = random_state(robot, np.random.default_rng(1))
    plant.set_state(state)
    np.testing.assert_allclose(plant.state, state, rtol=1e-14, atol=1e-14)
    joint = plant.data.joint("FR_thigh_joint")
    assert (joint.qpos[0], joint.qvel[0]) == (state[11], state[29])


@pytest.mark.parametrize("name", ROBOTS)
def test_it_stands_as_deep_in_the_ground_as_rubber_gives(name):
    """m g / 4 k on average, as tests/models/test_plant.py holds of Drake."""
    robot = get_robot(name)
    plant = MujocoPlant(robot, MujocoConfig())
    plant.set_state(standing(robot))
    plant.advance(robot.stand_joints, 3.0)
    depths = [-contact.dist for contact in plant.data.contact]
    assert len(depths) == 4
    expected = robot.mass * 9.81 / (4 * 5e4)
    assert np.mean(depths) == pytest.approx(expected, rel=0.01)


def test_motors_are_the_pd_within_their_limits():
    """kp = 100, kd = 3: of .1 rad and 2 rad/s 4 Nm; of 1 rad all that the Go2 has."""
    robot = get_robot("go2")
    plant = MujocoPlant(robot, MujocoConfig())
    state = standing(robot, FAR_UP)
    state[26] = 2.0
    plant.set_state(state)
    plant.data.ctrl[:] = robot.stand_joints
    plant.data.ctrl[1] += 0.1
    plant.data.ctrl[2] += 1.0
    mujoco.mj_forward(plant.model, plant.data)
    torques = plant.data.qfrc_actuator[6:]
    np.testing.assert_allclose(torques[:3], [0.0, 4.0, 35.55], atol=1e-9)
    np.testing.assert_array_equal(torques[3:], 0.0)


def test_ground_of_ice_lets_feet_slide():
    """Ground of .1 under feet of .8: the harmonic mean is 2 (.08) / .9, as in Drake."""
    robot = get_robot("go2")
    plant = MujocoPlant(robot, MujocoConfig(friction=0.1))
    plant.set_state(standing(robot))
    state = plant.advance(robot.stand_joints, 2.0)
    state[22] = 1.0
    plant.set_state(state)
    mujoco.mj_forward(plant.model, plant.data)
    impulse = np.zeros(3)
    for _ in range(20):
        plant.advance(robot.stand_joints, 0.002)
        force = np.zeros(6)
        for i in range(plant.data.ncon):
            mujoco.mj_contactForce(plant.model, plant.data, i, force)
            R_CW = plant.data.contact[i].frame.reshape(3, 3)
            impulse += R_CW.T @ force[:3]
    assert -impulse[0] / impulse[2] == pytest.approx(0.16 / 0.9, rel=0.02)


def test_a_written_model_is_the_same_model(tmp_path):
    robot = get_robot("go2")
    file = tmp_path / "go2.xml"
    file.write_text(robot_mjcf(robot))
    ours = MujocoPlant(robot, MujocoConfig())
    theirs = MujocoPlant(robot, MujocoConfig(mjcf=file))
    for plant in (ours, theirs):
        plant.set_state(standing(robot))
    np.testing.assert_array_equal(
        ours.advance(robot.stand_joints, 0.1), theirs.advance(robot.stand_joints, 0.1)
    )
    # Its own actuators, for those who use the file by itself.
    model = mujoco.MjModel.from_xml_path(str(file))
    names = [model.actuator(i).name for i in range(3)]
    assert names == ["FL_hip", "FL_thigh", "FL_calf"]
    np.testing.assert_array_equal(model.key("stand").ctrl, robot.stand_joints)
    gains = model.actuator_biasprm[:, :3]
    np.testing.assert_array_equal(gains, [[0.0, -100.0, -3.0]] * 12)


# Legs in another order, as a chain of hinges each, no ground and a motor.
LEG = """<body name="{0}"><joint name="{0}_hip_joint" damping="2"/><geom size=".02"/>
<body><joint name="{0}_thigh_joint"/><geom size=".02"/>
<body><joint name="{0}_calf_joint" axis="0 1 0"/><geom size=".02"/>
</body></body></body>"""


def other_model(legs, root="<freejoint/>"):
    chains = "".join(LEG.format(leg) for leg in legs)
    return (
        f'<mujoco><worldbody><body pos="0 0 1">{root}<geom size=".1"/>{chains}</body>'
        f'</worldbody><actuator><motor joint="{legs[0]}_hip_joint"/></actuator>'
        f'<sensor><jointpos joint="{legs[0]}_hip_joint"/></sensor></mujoco>'
    )


def test_another_model_is_driven_by_the_names_of_its_joints(tmp_path):
    robot = get_robot("go2")
    file = tmp_path / "other.xml"
    file.write_text(other_model(["RR", "RL", "FR", "FL"]))
    plant = MujocoPlant(robot, MujocoConfig(mjcf=file))
    assert plant.model.nu == 12
    assert (plant.model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE).sum() == 1
    state = random_state(robot, np.random.default_rng(2))
    plant.set_state(state)
    np.testing.assert_allclose(plant.state, state, rtol=1e-14, atol=1e-14)
    assert plant.data.joint("FL_hip_joint").qpos[0] == state[7]
    plant.data.ctrl[:] = state[7:19]
    plant.data.ctrl[11] += 0.1
    mujoco.mj_forward(plant.model, plant.data)
    calf = plant.data.joint("RR_calf_joint").qfrc_actuator[0]
    assert calf == pytest.approx(10.0 - 3.0 * state[36])
    # Of the motors' damping the joint's own is a part.
    hip = plant.data.joint("RR_hip_joint").qfrc_actuator[0]
    assert hip == pytest.approx(-1.0 * state[34])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (other_model(["FL", "FR", "RL"]), "lacks the hinge joints RR_hip_joint, RR_th"),
        (other_model(["FL", "FR", "RL", "RR"], root=""), "must have one free joint"),
        ("<mujoco><worldbody><body/></worldbody>", "cannot be read as MJCF: "),
        ("<robot name='go2'/>", "cannot be read as MJCF: "),
        ("not XML", "cannot be read as MJCF: "),
    ],
)
def test_models_that_do_not_fit_are_refused(tmp_path, text, message):
    file = tmp_path / "other.xml"
    file.write_text(text)
    with pytest.raises(InputError, match=message) as refused:
        MujocoPlant(get_robot("go2"), MujocoConfig(mjcf=file))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("config", "message"),
    [
        (MujocoConfig(time_step=0.02), "time_step must be a number from 1e-05 to 0.01"),
        (MujocoConfig(friction=0.0), "friction must be a number"),
        (MujocoConfig(friction=0.5, mjcf=Path(__file__)), "is set in its MJCF file"),
        (MujocoConfig(mjcf=Path("nowhere.xml")), "There is no MJCF file 'nowhere.xml'"),
    ],
)
def test_bad_config_is_refused(config, message):
    with pytest.raises(InputError, match=message):
        config.check()
