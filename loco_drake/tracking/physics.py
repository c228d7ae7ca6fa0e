"""Simulation of control periods, in one world for all robots or one for each."""

import math
from dataclasses import asdict, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram

from loco_drake.control.domain import Domain
from loco_drake.control.plan import PLAN_DT
from loco_drake.control.terrain import Terrain
from loco_drake.models.plant import ConfigureSimulator, PlantConfig
from loco_drake.systems.diagram import MakeLocomotionDiagram
from loco_drake.systems.domain import FollowTerrain, SetDomain
from loco_drake.systems.scenario import Disturbances, ExternalTargets, Scenario
from loco_drake.tracking.config import EnvironmentConfig

Array = NDArray[np.float64]


@lru_cache(maxsize=4)
def _diagram(
    robot: str, plant: tuple[tuple[str, Any], ...], disturbances: Disturbances
) -> Diagram:
    # One per process: pydrake never frees diagrams with Python systems.
    return MakeLocomotionDiagram(
        Scenario(
            robot=robot,
            plant=PlantConfig(**dict(plant)),
            policy=ExternalTargets(),
            disturbances=disturbances,
        )
    )


class _Simulation:
    """The plant in a Context, with its state and the port of its targets at hand."""

    def __init__(self, config: EnvironmentConfig, disturbances: Disturbances) -> None:
        plant = tuple(asdict(config.plant).items())
        diagram = _diagram(config.robot, plant, disturbances)
        self._diagram = diagram
        self._simulator = Simulator(diagram, diagram.CreateDefaultContext())
        ConfigureSimulator(self._simulator, config.plant)
        self._context = self._simulator.get_mutable_context()
        self._plant = diagram.GetSubsystemByName("plant")
        self._plant_context = self._plant.GetMyMutableContextFromRoot(self._context)
        port = diagram.GetInputPort("desired_state")
        self._desired_state = port.FixValue(self._context, np.zeros(port.size()))

    def _set(self, state: Array, desired_state: Array) -> None:
        self._plant.SetPositionsAndVelocities(self._plant_context, state)
        # GetMutableData tells what depends on it that it changes.
        targets = self._desired_state.GetMutableData().get_mutable_value()
        targets.set_value(desired_state)

    def _advance(self, time: float) -> Array:
        self._simulator.AdvanceTo(time, interruptible=False)
        return np.asarray(self._plant.GetPositionsAndVelocities(self._plant_context))


class SharedWorld(_Simulation):
    """One control period of a robot, as a function of its state and its targets.

    [q, v] is the entire state of the diagram, and the plant does not depend on time, so
    one Context serves all robots. Separate Contexts would evict each other from the
    processor's caches. A domain may be given, without pushes and terrain; where its
    motors delay set-points, by one period at most, the targets before count, too.
    """

    def __init__(self, config: EnvironmentConfig, domain: Domain | None = None) -> None:
        disturbances = Disturbances()
        if domain is not None:
            disturbances = replace(config.randomization.disturbances, sensors=False)
        super().__init__(config, disturbances)
        # The clock may continue if plant steps and control periods coincide exactly at
        # any time. An integrator must be reset for each robot.
        steps = PLAN_DT / config.plant.time_step
        power_of_2 = steps >= 1 and math.frexp(steps)[0] == 0.5
        self._runs_on = power_of_2 and config.plant.contact != "cenic"
        self._periods = 0
        self._simulator.Initialize()
        self.delays = domain is not None and domain.latency > 0
        if domain is not None:
            SetDomain(self._diagram, self._context, replace(domain, sensors=None))
        if self.delays:
            self._actuation = self._diagram.GetSubsystemByName("actuation")
            self._motors = self._actuation.GetMyMutableContextFromRoot(self._context)

    def begin(self, domain: Domain, sample: int) -> None:
        """Does nothing, since every episode's world is the model's."""

    def advance(
        self, state: Array, desired_state: Array, before: Array | None = None
    ) -> Array:
        """Returns the state [q, v], (13 + 2 J,), one control period after ``state``.

        The PD's desired state is [q_d, v_d], shape (2 J,). ``before`` is that of the
        period before, if ``delays``.
        """
        if before is not None:
            self._actuation.SetPast(self._motors, before[: len(before) // 2])
        self._set(state, desired_state)
        if not self._runs_on:
            self._periods = 0
            self._context.SetTime(0.0)
            self._simulator.Initialize()
        self._periods += 1
        return self._advance(self._periods * PLAN_DT)


class OwnWorld(_Simulation):
    """One robot in its own world, drawn for each of its episodes.

    A world is stored in a Context, motors have memory, and pushes depend on time, so
    every robot needs a Context, on the clock of its plan.
    """

    def __init__(self, config: EnvironmentConfig) -> None:
        # Sensors are simulated for all robots at once.
        disturbances = replace(config.randomization.disturbances, sensors=False)
        super().__init__(config, disturbances)
        self._sample = 0
        self._terrain: Terrain | None = None

    def begin(self, domain: Domain, sample: int) -> None:
        """Begins an episode in ``domain``, at a sample of a plan."""
        self._sample = sample
        self._terrain = domain.terrain
        self._context.SetTime(sample * PLAN_DT)
        if self._diagram.HasSubsystemNamed("actuation"):
            actuation = self._diagram.GetSubsystemByName("actuation")
            # Reset the memory of the motors.
            actuation.SetDefaultContext(
                actuation.GetMyMutableContextFromRoot(self._context)
            )
        SetDomain(self._diagram, self._context, replace(domain, sensors=None))
        self._simulator.Initialize()

    def advance(self, state: Array, desired_state: Array) -> Array:
        """Returns the state after a control period; see :class:`SharedWorld`."""
        self._sample += 1
        terrain, end = self._terrain, self._sample * PLAN_DT
        if terrain is None:
            self._set(state, desired_state)
            return self._advance(end)
        self._set(terrain.in_world(state), desired_state)
        FollowTerrain(self._diagram, self._context)
        return terrain.over_ground(self._advance(end))
