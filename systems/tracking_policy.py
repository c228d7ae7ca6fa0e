"""The learned policy as a system."""

from typing import Any

import torch
from pydrake.systems.framework import Context, LeafSystem

from loco_drake.control.actor import Actor
from loco_drake.control.observation import OBSERVATION_SIZE


class TrackingPolicy(LeafSystem):
    """Outputs the network's mean action for the observation at its input.

    .. pydrake_system::

        name: TrackingPolicy
        input_ports:
        - observation
        output_ports:
        - action

    It has no state and no clock: :class:`JointTargets` decides when to sample it.
    """

    def __init__(self, actor: Actor) -> None:
        super().__init__()
        self._actor = actor
        self._observation = self.DeclareVectorInputPort("observation", OBSERVATION_SIZE)
        self.DeclareVectorOutputPort(
            "action",
            12,
            self._calc,
            prerequisites_of_calc={self._observation.ticket()},
        )

    def _calc(self, context: Context, output: Any) -> None:
        observation = torch.from_numpy(self._observation.Eval(context)).float()
        with torch.inference_mode():
            output.set_value(self._actor(observation).double().numpy())
