"""In what an episode's world differs from the model: a domain, and how it is set.

Domain randomization (Tobin et al. 2017; Tan et al. 2018, "Sim-to-real") draws a domain
for each episode. All of it lives in the Context: parameters of plant and scene graph,
and the parameter of three systems that a diagram holds only if its scenario asks for
them, :class:`.actuation.Actuation`, :class:`.pushes.Pushes` and
:class:`.sensors.Sensors`.
"""

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import (
    AbstractParameterIndex,
    Context,
    Diagram,
    LeafSystem,
)

from loco_drake.control.domain import Domain
from loco_drake.models.ground import SetGround
from loco_drake.models.parameters import SetReflectedInertia, SetTrunkLoad

DISTURBING_SYSTEMS = ("actuation", "pushes", "sensors")


class DomainSystem(LeafSystem):
    """A system with a domain as its parameter; by default, one like the model."""

    def __init__(self) -> None:
        super().__init__()
        self._index = AbstractParameterIndex(
            self.DeclareAbstractParameter(Value(Domain()))
        )
        self._domain_ticket = self.abstract_parameter_ticket(self._index)

    def SetDomain(self, context: Context, domain: Domain) -> None:
        """Sets the domain; ``context`` is this system's own."""
        context.get_mutable_abstract_parameter(self._index).set_value(domain)

    def _domain(self, context: Context) -> Domain:
        return context.get_abstract_parameter(self._index).get_value()


def SetDomain(diagram: Diagram, context: Context, domain: Domain) -> None:
    """Puts a locomotion diagram's Context into ``domain``.

    Ground, trunk and rotors, where the domain does not give them, stay as they are in
    ``context``.

    Args:
        diagram: made by :func:`.diagram.MakeLocomotionDiagram`, with the disturbances
            that the domain has.
        context: the diagram's.
        domain: the domain.

    Raises:
        ValueError: if the diagram lacks a system that the domain needs.
    """
    for name in DISTURBING_SYSTEMS:
        if domain.needs(name) and not diagram.HasSubsystemNamed(name):
            raise ValueError(f"this domain needs a diagram with the system {name}")
    plant = diagram.GetSubsystemByName("plant")
    if domain.friction is not None or domain.stiffness is not None:
        scene_graph = diagram.GetSubsystemByName("scene_graph")
        SetGround(
            plant,
            scene_graph,
            scene_graph.GetMyMutableContextFromRoot(context),
            friction=domain.friction,
            stiffness=domain.stiffness,
        )
    if domain.payload is not None or domain.com_shift is not None:
        SetTrunkLoad(
            plant,
            plant.GetMyMutableContextFromRoot(context),
            mass=domain.payload or 0.0,
            p_shift_B=np.zeros(3) if domain.com_shift is None else domain.com_shift,
        )
    if domain.strength is not None:
        actuation = diagram.GetSubsystemByName("actuation")
        SetReflectedInertia(
            plant,
            plant.GetMyMutableContextFromRoot(context),
            actuation.reflected_inertia(domain.strength),
        )
    for name in DISTURBING_SYSTEMS:
        if diagram.HasSubsystemNamed(name):
            system = diagram.GetSubsystemByName(name)
            system.SetDomain(system.GetMyMutableContextFromRoot(context), domain)
