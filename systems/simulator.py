"""Simulator of a locomotion diagram, and start of an episode."""

import math
from collections.abc import Iterator
from typing import Any

from pydrake.systems.analysis import ExtractSimulatorConfig, Simulator, SimulatorStatus
from pydrake.systems.framework import Context, Diagram

from loco_drake.common.errors import InputError
from loco_drake.control.domain import Domain
from loco_drake.control.plan import PLAN_DT, Plan
from loco_drake.control.state import unit_base
from loco_drake.models.movable_ground import HasMovableGround
from loco_drake.models.plant import ConfigureSimulator

from .control import FindRobot, PlanPlayer
from .domain import FollowTerrain, GetTerrain, SetDomain
from .scenario import Scenario

_TOLERANCE = 1e-6  # of a control period; context times are sums of steps


class LocomotionSimulator(Simulator):
    """A Simulator that keeps the base quaternion of each robot at length one.

    Drake's discrete plants never normalize it, and no system can change the state of
    another. AdvanceTo therefore stops at the end of each control period and normalizes
    the quaternion in the Context, and moves uneven ground under the toes. The steps of
    the plant do not change. The diagram contains systems of
    :func:`.diagram.AddLocomotion` at any depth.
    """

    def __init__(self, diagram: Diagram) -> None:
        super().__init__(diagram)
        self._robots = [FindRobot(part)[1:] for part in _locomotions(diagram)]
        self._uneven = [
            part
            for part in _locomotions(diagram)
            if HasMovableGround(FindRobot(part)[1])
        ]

    def AdvanceTo(
        self, boundary_time: float, interruptible: bool = True
    ) -> SimulatorStatus:
        """Advances to ``boundary_time``, s, or until a monitor ends the simulation."""
        context = self.get_mutable_context()
        if not boundary_time >= context.get_time():
            # Drake would end the process.
            raise InputError(
                f"The simulation is at {context.get_time():g} s already, and cannot "
                f"advance to {boundary_time:g} s."
            )
        while True:
            period = math.floor(context.get_time() / PLAN_DT + _TOLERANCE) + 1
            until = min(period * PLAN_DT, boundary_time)
            status = super().AdvanceTo(until, interruptible=interruptible)
            reached = status.reason() == status.ReturnReason.kReachedBoundaryTime
            if reached and until == period * PLAN_DT:
                self._normalize(context)
                for part in self._uneven:
                    FollowTerrain(part, context)
            if not reached or until == boundary_time:
                return status

    def _normalize(self, root: Context) -> None:
        for plant, instance in self._robots:
            if plant.time_step() == 0:
                continue  # CENIC normalizes
            context = plant.GetMyMutableContextFromRoot(root)
            q = plant.GetPositions(context, instance)
            unit = unit_base(q)
            if unit is not q:
                plant.SetPositions(context, instance, unit)


def MakeSimulator(diagram: Diagram, scenario: Scenario) -> LocomotionSimulator:
    """Returns a simulator with the integrator and the real-time rate of ``scenario``.

    Raises:
        InputError: if the diagram was made from another scenario, or CENIC would have
            to simulate a nested locomotion diagram, whose plant it does not find.
    """
    parts = list(_locomotions(diagram))
    if not parts:
        raise InputError(
            "This diagram has no locomotion in it: make it with MakeLocomotionDiagram "
            "or AddLocomotion."
        )
    scenario.check()
    continuous = scenario.plant.contact == "cenic"
    for part in parts:
        if _is_continuous(part) != continuous:
            raise InputError(
                f"The diagram was not made of this scenario, whose contact is "
                f"{scenario.plant.contact}."
            )
        if continuous and part is not diagram:
            raise InputError(
                "CENIC finds a plant only among the root diagram's own systems: add "
                "the locomotion to your builder with AddLocomotion, or use contact "
                "similar, lagged or sap."
            )
    simulator = LocomotionSimulator(diagram)
    ConfigureSimulator(simulator, scenario.plant)
    simulator.set_target_realtime_rate(scenario.simulator.target_realtime_rate)
    return simulator


def StartEpisode(
    simulator: Simulator,
    *,
    gait: str | None = None,
    seed: int | None = None,
    plan: Plan | None = None,
    domain: Domain | None = None,
    diagram: Diagram | None = None,
) -> None:
    """Starts an episode at time 0 with the robot in the first state of its plan.

    Resets the whole Context to its default, so the episode equals one in a new diagram
    bit for bit. Values that you fixed at input ports remain. Initializes the simulator.

    Args:
        simulator: of a diagram as in :class:`LocomotionSimulator`.
        gait: replaces the scenario's gait of a generated reference. With "any" it
            begins with the gait that goes with the command at time 0, or on the spot.
        seed: replaces the scenario's seed of a generated reference.
        plan: replaces the plan of a reference that plays plans.
        domain: how the world differs from the model; the scenario must have the
            disturbances that it needs.
        diagram: the locomotion diagram that these arguments apply to, if there are
            several.

    Raises:
        InputError: if the reference does not accept an argument, or a continuous plant
            has another integrator than CENIC.
    """
    root, context = simulator.get_system(), simulator.get_mutable_context()
    parts = list(_locomotions(root))
    if diagram is None and len(parts) != 1:
        raise InputError(
            f"The simulator's diagram holds {len(parts)} locomotion diagrams; name "
            "one of them with diagram=."
        )
    chosen = diagram or parts[0]
    scheme = ExtractSimulatorConfig(simulator).integration_scheme
    if scheme != "cenic" and any(map(_is_continuous, parts)):
        raise InputError(
            f"The plant is continuous, and the integrator {scheme} would take a "
            "million steps a second for its contacts: make the simulator with "
            "MakeSimulator."
        )
    root.SetDefaultContext(context)
    context.SetTime(0.0)
    if domain is not None:
        SetDomain(chosen, context, domain)
    SetReference(chosen, context, gait=gait, seed=seed, plan=plan)
    for part in parts:
        _place_on_plan(part, context)
    simulator.Initialize()


def SetReference(diagram: Diagram, root: Context, **given: Any) -> None:
    """Passes gait, seed or plan, where they are not None, to the reference.

    Raises:
        InputError: if the reference does not accept an argument, or any gait is asked
            for and nothing was measured of the robot.
    """
    if diagram.HasSubsystemNamed("gait_selector"):
        selector = diagram.GetSubsystemByName("gait_selector")
        context = selector.GetMyMutableContextFromRoot(root)
        given["gait"] = selector.SetGait(context, given.get("gait"))
    given = {name: value for name, value in given.items() if value is not None}
    if not given:
        return
    takes: set[str] = set()
    if diagram.HasSubsystemNamed("reference"):
        reference = diagram.GetSubsystemByName("reference")
        plays = isinstance(reference, PlanPlayer)
        takes = {"plan"} if plays else {"gait", "seed"}
    if given.keys() - takes:
        raise InputError(
            f"This scenario's reference takes no {' or '.join(given.keys() - takes)}: "
            "a GeneratedReference takes gait and seed, "
            "a MotionReference or PlanReference takes plan."
        )
    start = reference.SetPlan if plays else reference.SetReference
    start(reference.GetMyMutableContextFromRoot(root), **given)


def _place_on_plan(diagram: Diagram, root: Context) -> None:
    """Sets the robot to the first state of its plan, if it has one."""
    if not diagram.HasSubsystemNamed("plan_state"):
        return
    if diagram.HasSubsystemNamed("smoother"):
        # The smoothed plan exists only after initialization.
        smoother = diagram.GetSubsystemByName("smoother")
        smoother.ExecuteInitializationEvents(smoother.GetMyMutableContextFromRoot(root))
    PlaceOnPlan(diagram, root)


def PlaceOnPlan(diagram: Diagram, root: Context) -> None:
    """Sets the robot to the present state of its plan; on a slope, turned with it.

    Args:
        diagram: a locomotion diagram that tracks a plan.
        root: the Context of the simulation.
    """
    plan_state = diagram.GetSubsystemByName("plan_state")
    context = plan_state.GetMyContextFromRoot(root)
    state = plan_state.GetOutputPort("state").Eval(context)
    terrain = GetTerrain(diagram, root)
    robot, plant, instance = FindRobot(diagram)
    if terrain is not None:
        state = terrain.in_world(terrain.placed(robot, state))
    context = plant.GetMyMutableContextFromRoot(root)
    plant.SetPositionsAndVelocities(context, instance, state)
    FollowTerrain(diagram, root)


def _locomotions(diagram: Diagram) -> Iterator[Diagram]:
    """Yields all locomotion diagrams in ``diagram``, including itself."""
    if diagram.HasSubsystemNamed("robot_state"):
        yield diagram
    for system in diagram.GetSystems():
        if isinstance(system, Diagram):
            yield from _locomotions(system)


def _is_continuous(diagram: Diagram) -> bool:
    return diagram.GetSubsystemByName("plant").time_step() == 0
