"""The systems that draw a simulation in Meshcat."""

from copy import copy

from pydrake.geometry import Meshcat, Rgba
from pydrake.multibody.meshcat import ContactVisualizer, ContactVisualizerParams
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.lcm import ApplyLcmBusConfig
from pydrake.visualization import ApplyVisualizationConfig, VisualizationConfig

from loco_drake.models.simulated import SimulatedRobot

from .keypoint_visualizer import KeypointVisualizer

# Of the arrows of contact forces.
FORCE_COLOR = Rgba(1.0, 0.5, 0.0)
FORCE_SCALE = 500.0  # N for each m of their length
_FORCE_RADIUS = 0.008  # m


def AddDrawing(
    builder: DiagramBuilder,
    robot: SimulatedRobot,
    plant: MultibodyPlant,
    config: VisualizationConfig,
    meshcat: Meshcat,
    plan: OutputPort | None = None,
) -> None:
    """Adds what draws the robot, and a plan's keypoints.

    If ``config`` publishes contacts, arrows show their forces.

    Args:
        builder: the builder of a diagram with a plant and a scene graph.
        robot: the robot.
        plant: the plant, finalized.
        config: what to draw, and how often.
        meshcat: where to draw it.
        plan: port of the plan.
    """
    period = config.publish_period
    if config.publish_contacts:
        forces = ContactVisualizerParams(
            publish_period=period,
            color=FORCE_COLOR,
            newtons_per_meter=FORCE_SCALE,
            radius=_FORCE_RADIUS,
        )
        ContactVisualizer.AddToBuilder(builder, plant, meshcat, forces)
        # The arrows that it would add are fifty times as long.
        config = copy(config)
        config.publish_contacts = False
    ApplyVisualizationConfig(
        config,
        builder,
        # A null bus disables publishing to LCM.
        lcm_buses=ApplyLcmBusConfig({"default": None}, builder),
        meshcat=meshcat,
    )
    if plan is not None:
        drawing = KeypointVisualizer(robot, meshcat, period=period)
        builder.AddNamedSystem("plan_visualizer", drawing)
        builder.Connect(plan, drawing.GetInputPort("plan"))
