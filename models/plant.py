"""A robot on flat ground as a MultibodyPlant."""

from collections.abc import Callable
from dataclasses import dataclass

from pydrake.geometry import SceneGraph, SceneGraphConfig
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    MultibodyPlant,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import ModelInstanceIndex, PdControllerGains
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import DiagramBuilder

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError, check_choice, check_number

from .ground import AddGround
from .movable_ground import FilterMovableGround
from .simulated import SimulatedRobot

CONTACTS = ("similar", "lagged", "sap", "cenic")


# Not frozen: yaml_load_typed sets the fields one by one.
@dataclass(kw_only=True)
class PlantConfig:
    """Contact model, time step and ground; docs/contact.md explains the defaults."""

    # Time step of the discrete plant in s; with cenic, the longest step.
    time_step: float = 0.01
    # Contact solver: similar, lagged, sap or cenic. The last is of a continuous plant
    # with error control.
    contact: str = "similar"
    # Accuracy of the integrator of cenic.
    accuracy: float = 1e-3
    # Coulomb friction coefficient of the ground. A contact uses the harmonic mean with
    # the feet's .8.
    friction: float = 0.8
    # Load meshes and a floor for Meshcat.
    visual: bool = False

    def check(self) -> None:
        """Raises InputError unless every field is sound."""
        check_choice("contact", self.contact, CONTACTS)
        for name, low, high in (
            ("time_step", 1e-5, 0.05),
            ("accuracy", 1e-9, 0.1),
            ("friction", 1e-6, 1e3),
        ):
            check_number(f"The plant's {name}", getattr(self, name), low, high)


def plant_damping(robot: SimulatedRobot, config: PlantConfig) -> Array:
    """Returns the damping of the PD in the plant, N m s/rad, shape (J,).

    A discrete plant applies its PD implicitly. With q and v at the beginning of a step
    of length h and v' at its end, the torque is

        kp (q_d - q - h v') - d v' = kp (q_d - q) - (d + h kp) v'

    so the step itself damps by h kp. The plant gets d = robot.kd - h kp, and the motors
    damp by robot.kd at every step. CENIC controls its error, and gets robot.kd.

    Raises:
        InputError: if the step alone would damp by more than the motors do.
    """
    if config.contact == "cenic":
        return robot.kd
    damping = robot.kd - robot.kp * config.time_step
    if damping.min() < 0:
        longest = float((robot.kd / robot.kp).min())
        raise InputError(
            f"The plant's time_step must be at most {longest:g} s for {robot.name}, "
            f"not {config.time_step:g}: the step alone would damp the joints by more "
            "than the motors do."
        )
    return damping


def AddRobotPlant(
    builder: DiagramBuilder,
    robot: SimulatedRobot,
    config: PlantConfig,
    pre_finalize: Callable[[MultibodyPlant, SceneGraph], None] | None = None,
    *,
    movable_ground: bool = False,
) -> tuple[MultibodyPlant, SceneGraph, ModelInstanceIndex]:
    """Adds a finalized plant with ``robot`` and a ground, and a scene graph.

    The systems are named "plant" and "scene_graph". By default the robot stands: trunk
    at (0, 0, robot.stand_height), joints at robot.stand_joints. Its PD runs inside the
    plant; the port ``plant.get_desired_state_input_port(instance)`` takes [q_d; v_d] of
    the J joints, in rad and rad/s. The joints are limp while it is not connected. v_d
    must be 0, since CENIC of Drake 1.51 applies it with the wrong sign. The PD has the
    stiffness robot.kp and the damping :func:`plant_damping`.

    With the contact "cenic" also call :func:`ConfigureSimulator`. ``pre_finalize`` may
    add to the plant. With ``movable_ground`` the ground is that of
    :mod:`.movable_ground`.

    Returns:
        The plant, the scene graph and the robot's model instance.

    Raises:
        InputError: if ``config`` is invalid, or its step too long for the robot's PD.
    """
    config.check()
    damping = plant_damping(robot, config)
    continuous = config.contact == "cenic"
    plant_config = MultibodyPlantConfig(
        time_step=0.0 if continuous else config.time_step,
        contact_model="point",
        # With sampled ports the plant steps in an unrestricted update, which sees
        # targets set at the same time one step late.
        use_sampled_output_ports=False,
    )
    if not continuous:
        plant_config.discrete_contact_approximation = config.contact
    plant, scene_graph = AddMultibodyPlant(plant_config, builder)
    # By default Drake prepares every shape for hydroelastic and deformable contact, and
    # warns that it cannot for a half space.
    scene_graph_config = SceneGraphConfig()
    scene_graph_config.default_proximity_properties.resolution_hint = None
    scene_graph.set_config(scene_graph_config)
    instance = robot.AddModel(Parser(plant), visual=config.visual)
    for joint, p, d in zip(robot.joint_names, robot.kp, damping, strict=True):
        actuator = plant.GetJointActuatorByName(joint.removesuffix("_joint"))
        actuator.set_controller_gains(PdControllerGains(p=p, d=d))
    AddGround(
        plant,
        friction=config.friction,
        visual=config.visual,
        movable=movable_ground,
    )
    if pre_finalize is not None:
        pre_finalize(plant, scene_graph)
    if movable_ground:
        FilterMovableGround(plant, scene_graph)
    plant.Finalize()
    plant.SetDefaultPositions(
        instance,
        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, robot.stand_height, *robot.stand_joints],
    )
    return plant, scene_graph, instance


def ConfigureSimulator(simulator: Simulator, config: PlantConfig) -> None:
    """Sets the integrator that ``config`` requires.

    For "cenic" this is Drake's CENIC integrator with error control at
    ``config.accuracy`` and steps of at most ``config.time_step``. Discrete plants need
    none.
    """
    if config.contact == "cenic":
        simulator_config = SimulatorConfig(
            integration_scheme="cenic",
            max_step_size=config.time_step,
            accuracy=config.accuracy,
            use_error_control=True,
        )
        ApplySimulatorConfig(simulator_config, simulator)
