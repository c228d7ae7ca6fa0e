"""The system that tells a locomotion diagram where to go."""

from collections.abc import Callable

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from loco_drake.common.arrays import Array
from loco_drake.control.driving import GAIT, PUSH, RESET
from loco_drake.control.plan import PLAN_DT


class CommandSource(LeafSystem):
    """Samples orders from outside the diagram, such as a person's, into its state.

    .. pydrake_system::

        name: CommandSource
        output_ports:
        - command: vector (3,), forward, sideways, yaw rate in H; m/s, rad/s
        - gait: vector (1,), index into LABELS, or -1 for any
        - events: vector (2,), push to the left and whether to reset; N s, 1 or 0

    The outputs are the state and nothing else, so a Context can be cloned, and orders
    that are noted down and sampled again give the same simulation. Steering reads them
    one control period after they are sampled. Those at time 0 are sampled when the
    system is made.

    Args:
        sample: returns the orders at a time in s, see :mod:`.control.driving`; such as
            ``OrderTable.at``.
    """

    def __init__(self, sample: Callable[[float], Array]) -> None:
        super().__init__()
        first = sample(0.0) + 0.0  # which turns -0 into 0
        self._sample = sample
        self._parts: dict[str, slice] = {
            "command": slice(0, GAIT),
            "gait": slice(GAIT, GAIT + 1),
            "events": slice(PUSH, RESET + 1),
        }
        for name, part in self._parts.items():
            index = self.DeclareDiscreteState(first[part])
            self.DeclareStateOutputPort(name, index)
        self.DeclarePeriodicDiscreteUpdateEvent(PLAN_DT, 0.0, self._update)

    def orders(self, context: Context) -> Array:
        """Returns the orders in ``context``, which is this system's own, (ORDERS,)."""
        groups = context.get_discrete_state()
        return np.concatenate([groups.value(k) for k in range(groups.num_groups())])

    def _update(self, context: Context, values: DiscreteValues) -> None:
        if context.get_time() == 0:
            return
        orders = self._sample(context.get_time()) + 0.0
        for index, part in enumerate(self._parts.values()):
            values.set_value(index, orders[part])
