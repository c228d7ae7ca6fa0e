"""The base of systems that extend a plan while the simulation runs."""

from typing import Any

from pydrake.common.value import AbstractValue, Value
from pydrake.systems.framework import Context, DependencyTicket, LeafSystem, State

from loco_drake.control.plan import UPDATE_PERIOD


class PlanProducer(LeafSystem):
    """Base of systems whose abstract state is an immutable value with a ``plan``.

    The plan is their output port ``plan``. It depends on the state only, so the inputs
    of the system may depend on it, unless they are declared.
    """

    def _DeclarePlan(self, first: Any, *inputs: DependencyTicket) -> None:
        """Declares state, by default ``first``, port and update.

        ``inputs`` are tickets of input ports on which the plan depends, too.
        """
        self._index = self.DeclareAbstractState(Value(first))
        self.DeclareAbstractOutputPort(
            "plan",
            lambda: Value(first.plan),
            self._calc_plan,
            prerequisites_of_calc={self.xa_ticket(), *inputs},
        )
        self.DeclarePeriodicUnrestrictedUpdateEvent(UPDATE_PERIOD, 0.0, self._update)

    def _next(self, context: Context, value: Any) -> Any:
        """Returns the state that follows ``value``."""
        raise NotImplementedError

    def _get(self, context: Context) -> Any:
        return context.get_abstract_state(self._index).get_value()

    def _set(self, target: Context | State, value: Any) -> None:
        target.get_mutable_abstract_state(self._index).set_value(value)

    def _calc_plan(self, context: Context, output: AbstractValue) -> None:
        output.set_value(self._get(context).plan)

    def _update(self, context: Context, state: State) -> None:
        self._set(state, self._next(context, self._get(context)))
