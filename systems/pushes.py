"""Pushes on the trunk."""

from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context

from .domain import DomainSystem

_TOLERANCE = 1e-6  # s; context times are sums of steps


class Pushes(DomainSystem):
    """Outputs the forces of its domain's pushes.

    .. pydrake_system::

        name: Pushes
        output_ports:
        - spatial_forces

    A discrete plant samples them at the beginning of its steps: a push that begins and
    lasts whole steps gives the trunk exactly the impulse force times duration.

    Args:
        trunk: the body to push.
    """

    def __init__(self, trunk: BodyIndex) -> None:
        super().__init__()
        self._trunk = trunk
        self.DeclareAbstractOutputPort(
            "spatial_forces",
            lambda: Value[list[ExternallyAppliedSpatialForce]](),
            self._calc,
            prerequisites_of_calc={self.time_ticket(), self._domain_ticket},
        )

    def _calc(self, context: Context, output: Any) -> None:
        time = context.get_time() + _TOLERANCE
        forces = []
        for push in self._domain(context).pushes:
            if push.start <= time < push.start + push.duration:
                force = ExternallyAppliedSpatialForce()
                force.body_index = self._trunk
                force.p_BoBq_B = np.zeros(3)
                force.F_Bq_W = SpatialForce(tau=np.zeros(3), f=push.force_W)
                forces.append(force)
        output.set_value(forces)
