"""How weak a motor may be: the mass matrix of the plant that stands for it."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from scipy.optimize import minimize

from loco_drake.common.errors import InputError
from loco_drake.models.parameters import (
    SetReflectedInertia,
    SetTrunkLoad,
    check_strength,
    least_strength,
)
from loco_drake.models.plant import PlantConfig
from loco_drake.models.robot import LEAST_PAYLOAD
from loco_drake.models.robots import ROBOTS, get_robot
from loco_drake.tracking.randomization import STANDARD, RandomizationConfig

# What the implicit PD adds to each joint in a step of 10 ms: kd h.
SURPLUS = 3 * 0.01


def share_of_indefinite_poses(name, strength, payload=0.0):
    """Of 1,000 poses, with the rotors as they stand for motors of that strength."""
    robot = get_robot(name)
    plant = MultibodyPlant(0.0)
    robot.AddModel(Parser(plant))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    SetTrunkLoad(
        plant.GetBodyByName("base"), context, mass=payload, p_shift_B=np.zeros(3)
    )
    for index in plant.GetJointActuatorIndices():
        actuator = plant.get_joint_actuator(index)
        ratio = actuator.default_gear_ratio()
        inertia = actuator.default_rotor_inertia() * ratio**2
        inertia -= (1 - strength) * SURPLUS
        actuator.SetRotorInertia(context, inertia / ratio**2)
    random = np.random.default_rng(1)
    lowest = []
    for joints in random.uniform(robot.joint_lower, robot.joint_upper, (1000, 12)):
        plant.SetPositions(context, [1.0, *[0.0] * 6, *joints])
        lowest.append(np.linalg.eigvalsh(plant.CalcMassMatrix(context))[0])
    return np.mean(np.array(lowest) <= 0)


@pytest.mark.parametrize("name", ROBOTS)
def test_removable_inertia_is_the_least_of_all_poses(name):
    """Searched from many poses within the joint limits, the trunk at its lightest.

    With S to select the joints' columns of the mass matrix M, M - c S S' is positive
    definite while c is below the smallest eigenvalue of (S' M^-1 S)^-1.
    """
    robot = get_robot(name)
    plant = MultibodyPlant(0.0)
    robot.AddModel(Parser(plant))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    trunk = plant.GetBodyByName("base")
    SetTrunkLoad(trunk, context, mass=LEAST_PAYLOAD, p_shift_B=np.zeros(3))

    def removable(joints):
        plant.SetPositions(context, [1.0, *[0.0] * 6, *joints])
        M = plant.CalcMassMatrix(context)
        return 1 / np.linalg.eigvalsh(np.linalg.inv(M)[6:, 6:])[-1]

    limits = robot.joint_lower, robot.joint_upper
    poses = np.random.default_rng(0).uniform(*limits, (1000, 12))
    bounds = list(zip(*limits, strict=True))
    worst = sorted(poses, key=removable)[:4]
    found = [
        minimize(removable, q, bounds=bounds, method="L-BFGS-B").fun for q in worst
    ]
    assert robot.removable_inertia == int(1e4 * min(found)) / 1e4


@pytest.mark.parametrize(("name", "least"), [("go2", 0.79), ("a1", 0.64)])
@pytest.mark.parametrize("payload", [-3.0, 0.0, 3.0])
def test_at_the_bound_the_mass_matrix_is_positive_definite_in_every_pose(
    name, least, payload
):
    assert least_strength(get_robot(name), PlantConfig()) == least
    assert share_of_indefinite_poses(name, least, payload) == 0


def test_the_bound_is_not_far_off():
    """A Go2 at .7 is impossible in seven poses of ten, and at .74 in some."""
    assert share_of_indefinite_poses("go2", 0.7) == pytest.approx(0.6, abs=0.15)
    assert share_of_indefinite_poses("go2", 0.74) > 0


@pytest.mark.parametrize("name", ROBOTS)
def test_weak_motors_are_refused_with_the_bound(name):
    """Where they are asked for, and where they are set; the standard range is sound."""
    robot, plant = get_robot(name), PlantConfig()
    STANDARD.check(robot, plant)
    for strength in (0.6, np.nan):
        with pytest.raises(InputError, match=f"of {name} must be at least 0"):
            check_strength(robot, plant, strength)
    weak = RandomizationConfig(motor_strength=(0.6, 1.0))
    with pytest.raises(
        InputError, match=r"at least 0.* at a time step of 0\.01 s, not 0"
    ):
        weak.check(robot, plant)
    # A CENIC plant has no step, and so takes nothing off the rotors.
    weak.check(robot, PlantConfig(contact="cenic"))


def test_inertia_is_refused_in_the_plant_too():
    robot = get_robot("go2")
    plant = MultibodyPlant(0.0)
    robot.AddModel(Parser(plant))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    instance = plant.GetModelInstanceByName("go2")
    inertia = robot.reflected_inertia
    SetReflectedInertia(plant, instance, context, inertia - 0.21 * SURPLUS)
    with pytest.raises(InputError, match="not positive definite in every pose"):
        SetReflectedInertia(plant, instance, context, inertia - 0.3 * SURPLUS)
    with pytest.raises(InputError, match="not positive definite"):
        SetReflectedInertia(plant, instance, context, np.full(12, np.nan))
