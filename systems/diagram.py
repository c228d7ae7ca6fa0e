"""The diagram of a robot that does what a plan says."""

from pydrake.geometry import Meshcat, MeshcatVisualizer, MeshcatVisualizerParams
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import (
    Context,
    Diagram,
    DiagramBuilder,
    InputPort,
    LeafSystem,
    OutputPort,
)

from loco_drake.control.actor import load_actor
from loco_drake.control.plan import Plan, plan_from_motion
from loco_drake.models.plant import AddRobotPlant
from loco_drake.models.robots import Robot, get_robot
from loco_drake.models.shipped import policy_path
from loco_drake.motion.motion_file import load_motion

from .actuation import Actuation
from .joint_targets import JointTargets
from .keypoint_visualizer import KeypointVisualizer
from .observation import Observation
from .plan_player import PlanPlayer
from .plan_state import PlanState
from .pushes import Pushes
from .scenario import (
    ExternalAction,
    ExternalTargets,
    GeneratedReference,
    MotionReference,
    Scenario,
    TrainedPolicy,
)
from .sensors import Sensors
from .toppra_smoother import ToppraSmoother
from .tracking_policy import TrackingPolicy
from .tracking_reward import TrackingReward


def MakeLocomotionDiagram(
    scenario: Scenario, *, meshcat: Meshcat | None = None
) -> Diagram:
    """Returns the diagram that ``scenario`` describes.

    .. pydrake_system::

        name: LocomotionDiagram
        input_ports:
        - gait (optional, of a generated reference: index into LABELS)
        - action (of ExternalAction)
        - desired_state (of ExternalTargets, which has only the last two outputs)
        output_ports:
        - plan
        - plan_state
        - path_time
        - observation
        - action
        - desired_state
        - reward_terms
        - state
        - net_actuation

    The subsystems are named plant, scene_graph, reference, smoother, observation,
    policy, joint_targets, plan_state and reward, and actuation, pushes and sensors of
    the scenario's disturbances; what is not asked for is not there.
    Simulate it like this, since a robot must start where its plan starts::

        simulator = Simulator(diagram)
        StartOnPlan(simulator)
        simulator.AdvanceTo(10.0)

    Args:
        scenario: what to simulate.
        meshcat: where to draw the robot and the plan's keypoints, if anywhere.

    Raises:
        InputError: if the scenario names what does not exist.
    """
    robot = get_robot(scenario.robot)
    builder = DiagramBuilder()
    plant, scene_graph, instance = AddRobotPlant(builder, robot, scenario.plant)
    state = plant.get_state_output_port()
    desired_state = plant.get_desired_state_input_port(instance)
    measured, desired_state = _AddDisturbances(
        builder, robot, scenario, plant, desired_state
    )
    plan = None
    if isinstance(scenario.policy, ExternalTargets):
        builder.ExportInput(desired_state, "desired_state")
    else:
        plan = _AddPlan(builder, robot, scenario)
        _AddControl(builder, robot, scenario.policy, plan, measured, desired_state)
        _AddScores(builder, robot, plan, state)
    builder.ExportOutput(state, "state")
    builder.ExportOutput(plant.get_net_actuation_output_port(instance), "net_actuation")

    if meshcat is not None:
        MeshcatVisualizer.AddToBuilder(
            builder, scene_graph, meshcat, MeshcatVisualizerParams()
        )
        if plan is not None:
            drawing = builder.AddNamedSystem(
                "plan_visualizer", KeypointVisualizer(robot, meshcat)
            )
            builder.Connect(plan, drawing.GetInputPort("plan"))
    diagram = builder.Build()
    diagram.set_name("locomotion")
    return diagram


def _AddDisturbances(
    builder: DiagramBuilder,
    robot: Robot,
    scenario: Scenario,
    plant: MultibodyPlant,
    desired_state: InputPort,
) -> tuple[OutputPort, InputPort]:
    """Adds what makes the world unlike the model.

    Returns:
        The state as it is measured, and the port that takes the PD's set-points.
    """
    state = measured = plant.get_state_output_port()
    if scenario.disturbances.actuation:
        actuation = builder.AddNamedSystem(
            "actuation", Actuation(robot, scenario.plant)
        )
        builder.Connect(state, actuation.GetInputPort("state"))
        builder.Connect(actuation.GetOutputPort("desired_state"), desired_state)
        desired_state = actuation.GetInputPort("desired_state")
    if scenario.disturbances.pushes:
        trunk = plant.GetBodyByName(robot.trunk_frame).index()
        pushes = builder.AddNamedSystem("pushes", Pushes(trunk))
        builder.Connect(
            pushes.GetOutputPort("spatial_forces"),
            plant.get_applied_spatial_force_input_port(),
        )
    if scenario.disturbances.sensors:
        sensors = builder.AddNamedSystem("sensors", Sensors(robot))
        builder.Connect(state, sensors.GetInputPort("state"))
        measured = sensors.GetOutputPort("state")
    return measured, desired_state


def _AddPlan(builder: DiagramBuilder, robot: Robot, scenario: Scenario) -> OutputPort:
    """Adds what makes the plan, exports it and returns its port."""
    reference = _AddReference(builder, robot, scenario)
    plan = reference.GetOutputPort("plan")
    if scenario.smoother is not None:
        smoother = builder.AddNamedSystem(
            "smoother", ToppraSmoother(robot, scenario.smoother)
        )
        builder.Connect(plan, smoother.GetInputPort("plan"))
        plan = smoother.GetOutputPort("plan")
        if reference.HasInputPort("path_time"):
            builder.Connect(
                smoother.GetOutputPort("path_time"),
                reference.GetInputPort("path_time"),
            )
    builder.ExportOutput(plan, "plan")
    if reference.HasInputPort("gait"):
        builder.ExportInput(reference.GetInputPort("gait"), "gait")
    return plan


def _AddReference(
    builder: DiagramBuilder, robot: Robot, scenario: Scenario
) -> LeafSystem:
    reference = scenario.reference
    if isinstance(reference, GeneratedReference):
        # Loads torch models, which players do without.
        from .reference_generator import ReferenceGenerator

        return builder.AddNamedSystem("reference", ReferenceGenerator(robot, reference))
    plan: Plan | None = None
    if isinstance(reference, MotionReference):
        plan = plan_from_motion(robot, load_motion(reference.path))
    return builder.AddNamedSystem("reference", PlanPlayer(robot, plan))


def _AddControl(
    builder: DiagramBuilder,
    robot: Robot,
    config: TrainedPolicy | ExternalAction,
    plan: OutputPort,
    state: OutputPort,
    desired_state: InputPort,
) -> None:
    """Adds what turns plan and state into the PD's set-points."""
    targets = builder.AddNamedSystem("joint_targets", JointTargets(robot))
    builder.Connect(plan, targets.GetInputPort("plan"))
    builder.Connect(targets.GetOutputPort("desired_state"), desired_state)
    observation = builder.AddNamedSystem("observation", Observation(robot))
    builder.Connect(plan, observation.GetInputPort("plan"))
    builder.Connect(state, observation.GetInputPort("state"))
    builder.Connect(targets.GetOutputPort("action"), observation.GetInputPort("action"))
    if isinstance(config, ExternalAction):
        builder.ExportInput(targets.GetInputPort("action"), "action")
    else:
        weights = policy_path(robot, config.weights)
        policy = builder.AddNamedSystem(
            "policy", TrackingPolicy(load_actor(weights, robot))
        )
        builder.Connect(
            observation.GetOutputPort("observation"), policy.GetInputPort("observation")
        )
        builder.Connect(policy.GetOutputPort("action"), targets.GetInputPort("action"))
    builder.ExportOutput(observation.GetOutputPort("observation"), "observation")
    builder.ExportOutput(targets.GetOutputPort("action"), "action")
    # What reaches the PD.
    last = "actuation" if builder.HasSubsystemNamed("actuation") else "joint_targets"
    sent = builder.GetSubsystemByName(last).GetOutputPort("desired_state")
    builder.ExportOutput(sent, "desired_state")


def _AddScores(
    builder: DiagramBuilder, robot: Robot, plan: OutputPort, state: OutputPort
) -> None:
    """Adds what says how well the plan is followed."""
    reward = builder.AddNamedSystem("reward", TrackingReward(robot))
    builder.Connect(plan, reward.GetInputPort("plan"))
    builder.Connect(state, reward.GetInputPort("state"))
    builder.ExportOutput(reward.GetOutputPort("reward_terms"), "reward_terms")
    plan_state = builder.AddNamedSystem("plan_state", PlanState(robot))
    builder.Connect(plan, plan_state.GetInputPort("plan"))
    builder.ExportOutput(plan_state.GetOutputPort("state"), "plan_state")
    builder.ExportOutput(plan_state.GetOutputPort("path_time"), "path_time")


def StartOnPlan(simulator: Simulator, diagram: Diagram | None = None) -> None:
    """Initializes the simulator with the robot in the first state of its plan.

    The plan of a generator or smoother exists only after initialization, and a robot
    that starts elsewhere would begin with a jump.

    Args:
        simulator: of a locomotion diagram, or of a diagram that holds one.
        diagram: the locomotion diagram; by default the simulator's system.
    """
    diagram = diagram or simulator.get_system()
    simulator.Initialize()
    PlaceOnPlan(
        diagram, diagram.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    )
    # Publishes (logs, Meshcat) must see the robot where it starts.
    simulator.Initialize()


def PlaceOnPlan(diagram: Diagram, context: Context) -> None:
    """Sets the robot's state to that of the plan; ``context`` is the diagram's."""
    state = diagram.GetOutputPort("plan_state").Eval(context)
    plant = diagram.GetSubsystemByName("plant")
    plant.SetPositionsAndVelocities(
        diagram.GetMutableSubsystemContext(plant, context), state
    )
