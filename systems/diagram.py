"""The diagram of a robot that tracks a plan."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
from pydrake.geometry import Meshcat, SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import (
    Diagram,
    DiagramBuilder,
    InputPort,
    LeafSystem,
    OutputPort,
)

from loco_drake.common.errors import InputError
from loco_drake.control.actor_file import load_actor
from loco_drake.control.gait_choice import best_gait
from loco_drake.control.plan import plan_from_motion
from loco_drake.control.retiming import fall_limit
from loco_drake.models.plant import AddRobotPlant
from loco_drake.models.robots import Robot, SimulatedRobot, get_simulated
from loco_drake.models.shipped import policy_path
from loco_drake.motion.gaits import ANY, gait_name
from loco_drake.motion.motion_file import load_motion

from .control import (
    JointTargets,
    Observation,
    PlanPlayer,
    PlanState,
    RobotState,
    TrackingPolicy,
    TrackingReward,
)
from .domain import Actuation, Pushes, Sensors
from .drawing import AddDrawing
from .gait_selector import GaitSelector, measured_gaits
from .scenario import (
    ExternalTargets,
    GeneratedReference,
    MotionReference,
    Scenario,
    TrainedPolicy,
)
from .steering import Steering
from .toppra_smoother import ToppraSmoother


@dataclass(frozen=True)
class Locomotion:
    """The systems that :func:`AddLocomotion` added, with ports to connect."""

    robot: SimulatedRobot
    plant: MultibodyPlant  # finalized; contains the robot
    scene_graph: SceneGraph
    instance: ModelInstanceIndex  # the robot's in the plant
    # Ports by name, see MakeLocomotionDiagram.
    inputs: dict[str, InputPort] = field(default_factory=dict)
    outputs: dict[str, OutputPort] = field(default_factory=dict)

    def ExportPorts(self, builder: DiagramBuilder) -> None:
        """Exports all ports by their names."""
        for name, port in self.inputs.items():
            builder.ExportInput(port, name)
        for name, port in self.outputs.items():
            builder.ExportOutput(port, name)


def MakeLocomotionDiagram(
    scenario: Scenario, *, meshcat: Meshcat | None = None
) -> Diagram:
    """Returns the diagram that ``scenario`` describes.

    .. pydrake_system::

        name: LocomotionDiagram
        input_ports:
        - gait: vector (1,), index into LABELS, or with steering -1 for any; only of a
          generated reference, optional
        - command: vector (3,), velocity to follow: forward, sideways, yaw rate, in the
          heading frame; m/s, rad/s; optional
        - action: vector (J,); ACTION_SCALE; only with ExternalAction
        - desired_state: vector (2 J,), [q_d, 0]; rad, rad/s; only with ExternalTargets
        output_ports:
        - plan: abstract, Plan; the plan that is tracked
        - plan_state: vector (13 + 2 J,), [q, v]; m, rad, m/s, rad/s
        - path_time: vector (1,), time before smoothing; s
        - followed: vector (3,), the command as far as it is followed; m/s, rad/s
        - observation: vector (N,), N the size of the robot's Layout
        - action: vector (J,), the action in use; ACTION_SCALE
        - desired_state: vector (2 J,), [q_d, 0]; rad, rad/s
        - reward_terms: vector (5,), weighted; see REWARD_TERMS
        - state: vector (13 + 2 J,), [q, v]; m, rad, m/s, rad/s
        - net_actuation: vector (J,), joint torques; N m

    With ExternalTargets the only output ports are state and net_actuation. The
    quaternions in plan_state and state have length one.

    The subsystems are named plant, scene_graph, robot_state, reference, steering,
    smoother, observation, policy, joint_targets, plan_state and reward; a generated
    reference that is steered adds gait_selector, and the scenario's disturbances add
    actuation, pushes and sensors. ``meshcat`` shows the robot, the
    plan's keypoints, and contact forces if the scenario's visualization publishes
    contacts.

    A robot must start on its plan: use :func:`.simulator.MakeSimulator` and
    :func:`.simulator.StartEpisode`. Drake never frees a diagram that contains systems
    written in Python, so reuse one diagram for all episodes.

    Raises:
        InputError: if the scenario is invalid.
    """
    builder = DiagramBuilder()
    AddLocomotion(builder, scenario, meshcat=meshcat).ExportPorts(builder)
    diagram = builder.Build()
    diagram.set_name("locomotion")
    return diagram


def AddLocomotion(
    builder: DiagramBuilder,
    scenario: Scenario,
    *,
    meshcat: Meshcat | None = None,
    pre_finalize: Callable[[MultibodyPlant, SceneGraph], None] | None = None,
) -> Locomotion:
    """Adds the systems that ``scenario`` describes to ``builder``; exports no ports.

    Args:
        builder: the builder of a diagram that has no plant yet.
        scenario: the scenario.
        meshcat: where to draw the robot and the plan's keypoints, see :mod:`.drawing`.
        pre_finalize: called with plant and scene graph; may add bodies to the plant.

    Raises:
        InputError: if the scenario is invalid, or the builder has a plant.
    """
    scenario.check()
    if builder.HasSubsystemNamed("plant"):
        raise InputError(
            "The builder has a system named plant already: AddLocomotion makes the "
            "plant, and its pre_finalize adds your bodies to it."
        )
    robot = get_simulated(scenario.robot)
    plant, scene_graph, instance = AddRobotPlant(
        builder,
        robot,
        scenario.plant,
        pre_finalize,
        movable_ground=scenario.disturbances.terrain,
    )
    made = Locomotion(robot, plant, scene_graph, instance)
    robot_state, plant_state = RobotState(robot), plant.get_state_output_port(instance)
    _Add(builder, "robot_state", robot_state, plant_state=plant_state)
    state = robot_state.GetOutputPort("state")
    measured, desired_state = _AddDisturbances(builder, made, scenario, state)
    if isinstance(scenario.policy, ExternalTargets):
        made.inputs["desired_state"] = desired_state
    else:
        inputs, outputs = AddPlan(builder, robot, scenario)
        made.inputs.update(inputs)
        made.outputs.update(outputs)
        _AddControl(builder, made, scenario, measured, desired_state)
        _AddScores(builder, made, state)
    made.outputs["state"] = state
    made.outputs["net_actuation"] = plant.get_net_actuation_output_port(instance)
    if meshcat is not None:
        plan = made.outputs.get("plan")
        AddDrawing(builder, robot, plant, scenario.visualization, meshcat, plan)
    return made


def _Add(
    builder: DiagramBuilder, name: str, system: LeafSystem, **inputs: OutputPort
) -> LeafSystem:
    """Adds a system and connects its input ports by name."""
    builder.AddNamedSystem(name, system)
    for port, source in inputs.items():
        builder.Connect(source, system.GetInputPort(port))
    return system


def _AddDisturbances(
    builder: DiagramBuilder, made: Locomotion, scenario: Scenario, state: OutputPort
) -> tuple[OutputPort, InputPort]:
    """Simulates a world unlike the model; returns measured state and set-point port."""
    robot, plant, wanted = made.robot, made.plant, scenario.disturbances
    desired_state = plant.get_desired_state_input_port(made.instance)
    if wanted.actuation:
        assert isinstance(robot, Robot)  # as the scenario checks
        actuation = Actuation(robot, scenario.plant)
        _Add(builder, "actuation", actuation, state=state)
        made.outputs["desired_state"] = actuation.GetOutputPort("desired_state")
        builder.Connect(made.outputs["desired_state"], desired_state)
        desired_state = actuation.GetInputPort("desired_state")
    if wanted.pushes:
        trunk = plant.GetBodyByName(robot.trunk_frame, made.instance).index()
        pushes = _Add(builder, "pushes", Pushes(trunk))
        builder.Connect(
            pushes.GetOutputPort("spatial_forces"),
            plant.get_applied_spatial_force_input_port(),
        )
    if wanted.sensors:
        sensors = _Add(builder, "sensors", Sensors(robot), state=state)
        state = sensors.GetOutputPort("state")
    return state, desired_state


def AddPlan(
    builder: DiagramBuilder, robot: SimulatedRobot, scenario: Scenario
) -> tuple[dict[str, InputPort], dict[str, OutputPort]]:
    """Adds reference, steering and smoother, which depend on no robot's state.

    Steering and smoother are of robots with three joints a leg; others follow the
    reference itself.

    Returns their input and output ports by name, see :func:`MakeLocomotionDiagram`.
    """
    made, grounded = _MakeReference(robot, scenario)
    reference = _Add(builder, "reference", made)
    inputs, outputs, chain = {}, {}, [reference]
    if reference.HasInputPort("gait"):
        inputs["gait"] = reference.GetInputPort("gait")
    quadruped = robot if isinstance(robot, Robot) else None
    if quadruped and scenario.steering is not None:
        steering = Steering(quadruped, scenario.steering)
        _Add(builder, "steering", steering, plan=chain[-1].GetOutputPort("plan"))
        inputs["command"] = steering.GetInputPort("command")
        outputs["followed"] = steering.GetOutputPort("followed")
        if scenario.steering.tell and reference.HasInputPort("command"):
            told = steering.GetOutputPort("told")
            builder.Connect(told, reference.GetInputPort("command"))
        chain.append(steering)
        if isinstance(scenario.reference, GeneratedReference):
            selector = GaitSelector(quadruped, str(scenario.reference.gait))
            command = steering.GetOutputPort("asked")
            _Add(builder, "gait_selector", selector, command=command)
            builder.Connect(selector.GetOutputPort("gait"), inputs["gait"])
            inputs["gait"] = selector.GetInputPort("gait")
    if quadruped and scenario.smoother is not None:
        config = scenario.smoother
        if config.fall is None:
            config = replace(config, fall=fall_limit(grounded))
        smoother = ToppraSmoother(quadruped, config)
        _Add(builder, "smoother", smoother, plan=chain[-1].GetOutputPort("plan"))
        ports = ("path_time", "fixed_time", "clock_rate")
        for system, name in product(chain, ports):
            if system.HasInputPort(name):
                builder.Connect(smoother.GetOutputPort(name), system.GetInputPort(name))
        chain.append(smoother)
    outputs["plan"] = chain[-1].GetOutputPort("plan")
    return inputs, outputs


def _MakeReference(
    robot: SimulatedRobot, scenario: Scenario
) -> tuple[LeafSystem, bool]:
    """Returns the reference, and whether its motion is grounded."""
    reference = scenario.reference
    if isinstance(reference, GeneratedReference):
        assert isinstance(robot, Robot)  # as the scenario checks
        # Imports torch models, which a player does not need.
        from .reference_generator import ReferenceGenerator

        if reference.gait == ANY:
            gait = best_gait(measured_gaits(robot), np.zeros(3))
            reference = replace(reference, gait=gait_name(gait))
        generator = ReferenceGenerator(robot, reference)
        return generator, generator.grounded
    if isinstance(reference, MotionReference):
        motion = load_motion(reference.path)
        return PlanPlayer(robot, plan_from_motion(robot, motion)), motion.grounded
    return PlanPlayer(robot), False


def _AddControl(
    builder: DiagramBuilder,
    made: Locomotion,
    scenario: Scenario,
    state: OutputPort,
    desired_state: InputPort,
) -> None:
    """Adds the systems that compute the PD set-points from plan and state."""
    robot, plan = made.robot, made.outputs["plan"]
    targets = _Add(builder, "joint_targets", JointTargets(robot), plan=plan)
    builder.Connect(targets.GetOutputPort("desired_state"), desired_state)
    action = targets.GetOutputPort("action")
    observation = Observation(robot)
    _Add(builder, "observation", observation, plan=plan, state=state, action=action)
    seen = observation.GetOutputPort("observation")
    if isinstance(scenario.policy, TrainedPolicy):
        actor = load_actor(policy_path(robot, scenario.policy.weights), robot)
        policy = _Add(builder, "policy", TrackingPolicy(actor), observation=seen)
        builder.Connect(policy.GetOutputPort("action"), targets.GetInputPort("action"))
    else:
        made.inputs["action"] = targets.GetInputPort("action")
    made.outputs["observation"] = seen
    made.outputs["action"] = action
    # Actuation, if present, has already set the port that reaches the PD.
    made.outputs.setdefault("desired_state", targets.GetOutputPort("desired_state"))


def _AddScores(builder: DiagramBuilder, made: Locomotion, state: OutputPort) -> None:
    """Adds the systems that measure tracking."""
    plan = made.outputs["plan"]
    reward = TrackingReward(made.robot)
    _Add(builder, "reward", reward, plan=plan, state=state)
    made.outputs["reward_terms"] = reward.GetOutputPort("reward_terms")
    plan_state = _Add(builder, "plan_state", PlanState(made.robot), plan=plan)
    made.outputs["plan_state"] = plan_state.GetOutputPort("state")
    made.outputs["path_time"] = plan_state.GetOutputPort("path_time")
