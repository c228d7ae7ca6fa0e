"""The system that chooses the gait by the command."""

from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.common.files import read_json
from loco_drake.control.gait_choice import Choice, MeasuredGait, best_gait, next_choice
from loco_drake.control.plan import UPDATE_PERIOD
from loco_drake.models.robots import Robot
from loco_drake.models.shipped import results_path
from loco_drake.motion.gaits import ANY, ANY_INDEX, LABELS, gait_name, parse_label

_ASKED, _LABEL = 0, 1  # in the state
_CHOICES = {k: gait_name(k) for k in (ANY_INDEX, *range(len(LABELS)))}


def measured_gaits(robot: Robot) -> dict[int, MeasuredGait]:
    """Returns what the results of ``evaluate steering`` say of each gait of a robot.

    The keys are indices into LABELS.

    Raises:
        InputError: if there are no results.
    """
    path = results_path(f"steering-{robot.name}")
    if not path.is_file():
        raise InputError(
            f"The gait any needs measurements of {robot.name}, of which there are "
            f"none: run loco-drake evaluate steering --robot {robot.name} --search "
            f"--json {path}, or name a gait, such as {LABELS[0]}."
        )
    return {
        parse_label(label).index: MeasuredGait.of_figures(figures)
        for label, figures in read_json(path)["labels"].items()
    }


class GaitSelector(LeafSystem):
    """Passes the gait that is asked for, and where that is "any" chooses one.

    .. pydrake_system::

        name: GaitSelector
        input_ports:
        - gait: vector (1,), index into LABELS, or -1 for any; optional
        - command: vector (3,), forward, sideways, yaw rate in H; m/s, rad/s; nan
          without a command; optional
        output_ports:
        - gait: vector (1,), index into LABELS; nan if none is asked for

    H is the base's heading frame. :mod:`loco_drake.control.gait_choice` says how the
    command chooses: by what was measured of the robot's main policy. Without a command
    the gait stays as it is. Where the port ``gait`` has no value, what
    :meth:`SetGait` asked for counts.

    The choice and its time are in the state, which is updated every ``UPDATE_PERIOD``.
    A gait that is asked for by its label passes at once.

    Args:
        robot: the robot.
        gait: "any" to choose from the beginning on.

    Raises:
        InputError: if any gait is asked for, and nothing was measured of the robot.
    """

    def __init__(self, robot: Robot, gait: str | None = None) -> None:
        super().__init__()
        self._robot, self._begins = robot, gait
        self._measured: dict[int, MeasuredGait] | None = None
        self._gait = self.DeclareVectorInputPort("gait", 1)
        self._command = self.DeclareVectorInputPort("command", 3)
        asked, label = np.nan, ANY_INDEX
        if gait == ANY:
            asked, label = ANY_INDEX, self.first_gait(np.zeros(3))
        # What SetGait asked for, the choice, and the Context time of it in s.
        state = self.DeclareDiscreteState([asked, label, -np.inf])
        self.DeclareVectorOutputPort(
            "gait",
            1,
            self._calc_gait,
            {self._gait.ticket(), self.discrete_state_ticket(state)},
        )
        self.DeclarePeriodicDiscreteUpdateEvent(UPDATE_PERIOD, 0.0, self._update)

    def first_gait(self, command: Array) -> int:
        """Returns the best gait at a command (3,), an index into LABELS.

        Raises:
            InputError: if nothing was measured of the robot.
        """
        return best_gait(self._table, command)

    @property
    def _table(self) -> dict[int, MeasuredGait]:
        if self._measured is None:
            self._measured = measured_gaits(self._robot)
        return self._measured

    def SetGait(self, context: Context, gait: str | None = None) -> str | None:
        """Asks for "any" or for no gait, as at the beginning of an episode.

        ``gait`` is that of the constructor by default. Any text but "any" is the
        generator's affair, and asks for none here. ``context`` is this system's own.

        Returns:
            ``gait``, but instead of "any" the label that is best at the present
            command, or on the spot if there is no command.

        Raises:
            InputError: if any is asked for, and nothing was measured of the robot.
        """
        gait = self._begins if gait is None else gait
        asked, label = np.nan, ANY_INDEX
        if gait == ANY:
            command = self._commanded(context)
            asked = ANY_INDEX
            label = self.first_gait(np.zeros(3) if command is None else command)
            gait = gait_name(label)
        context.SetDiscreteState([asked, label, -np.inf])
        return gait

    def _commanded(self, context: Context) -> Array | None:
        """Returns the command (3,), None if there is none that is finite."""
        if not self._command.HasValue(context):
            return None
        command: Array = self._command.Eval(context)
        return command if np.isfinite(command).all() else None

    def _asked(self, context: Context) -> float:
        """Returns the gait that is asked for, nan if none is."""
        if not self._gait.HasValue(context):
            return float(context.get_discrete_state_vector()[_ASKED])
        index = float(self._gait.Eval(context)[0])
        if index not in _CHOICES:
            raise InputError(
                f"The input port gait must be the index of a gait, "
                f"{', '.join(f'{k} {name}' for k, name in _CHOICES.items())}; not "
                f"{index:g}."
            )
        return index

    def _calc_gait(self, context: Context, output: Any) -> None:
        gait = self._asked(context)
        if gait == ANY_INDEX:
            gait = context.get_discrete_state_vector()[_LABEL]
        output[0] = np.nan if gait == ANY_INDEX else gait

    def _update(self, context: Context, values: DiscreteValues) -> None:
        asked, label, since = context.get_discrete_state_vector().value()
        before, gait = Choice(int(label), since), self._asked(context)
        choice, command = before, self._commanded(context)
        if gait == ANY_INDEX and command is not None:
            choice = next_choice(self._table, command, before, context.get_time())
        elif gait in range(len(LABELS)) and gait != label:
            choice = Choice(int(gait), context.get_time())
        values.set_value([asked, choice.label, choice.since])
