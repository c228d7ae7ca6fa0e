"""What a driver sees of a drive: on Meshcat's page and in the terminal."""

from collections import deque
from types import TracebackType
from typing import TYPE_CHECKING, Self

import numpy as np
from rich.console import Console
from rich.live import Live
from rich.text import Text

from loco_drake.common.arrays import Array
from loco_drake.common.rotations import yaw_of
from loco_drake.control.driving import COMMAND, GAIT, PUSH, RESET
from loco_drake.control.plan import PLAN_DT
from loco_drake.control.state import ORIENTATION, VELOCITY, split
from loco_drake.motion.gaits import ANY, ANY_INDEX
from loco_drake.systems.meshcat_driver import MeshcatDriver, MeshcatText

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat

    from loco_drake.evaluation.tracking import Recorder

_PERIOD = 0.5  # s between updates
_WINDOW = 5.0  # s; of the return that is shown
_NOTED = 3.0  # s for which what happened is shown
_FELL = "it fell: R puts it upright"
_HINT_UNTIL = 15.0  # s
_HINT = "W S A D Q E drive, Space halts; see also Open Controls"


class DriveView:
    """Shows command, what is followed, gait, speed and return, twice a second.

    Args:
        recorder: simulates the drive.
        meshcat: its page, if there is one.
        driver: the controls on the page, if there are any.
    """

    def __init__(
        self,
        recorder: "Recorder",
        meshcat: "Meshcat | None",
        driver: MeshcatDriver | None,
    ) -> None:
        self._recorder, self._driver = recorder, driver
        self._page = None if meshcat is None else MeshcatText(meshcat)
        console = Console(stderr=True)
        self._line = (
            Live(console=console, auto_refresh=False, transient=True)
            if console.is_terminal
            else None
        )
        self._rewards: deque[float] = deque(maxlen=round(_WINDOW / PLAN_DT))
        self._speeds: deque[float] = deque(maxlen=round(_PERIOD / PLAN_DT))
        self._happened, self._until = "", 0.0

    def __enter__(self) -> Self:
        if self._line is not None:
            self._line.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._line is not None:
            self._line.stop()

    def update(self, now: float, orders: Array) -> None:
        """Takes note of a control period and shows the last ones when it is time.

        Args:
            now: the simulation's time, s.
            orders: those of the control period, shape (ORDERS,).
        """
        if self._page is None and self._line is None:
            return
        diagram, context = self._recorder.diagram, self._recorder.context
        q, v = split(diagram.GetOutputPort("state").Eval(context))
        yaw, velocity = yaw_of(q[ORIENTATION]), v[VELOCITY]
        self._speeds.append(velocity[0] * np.cos(yaw) + velocity[1] * np.sin(yaw))
        reward = diagram.GetOutputPort("reward_terms").Eval(context).sum()
        self._rewards.append(0.0 if self._recorder.fell else float(reward))
        if orders[PUSH]:
            self._note(f"pushed by {abs(orders[PUSH]):g} N s", now)
        if orders[RESET]:
            self._note("put upright", now)
        if round(now / PLAN_DT) % round(_PERIOD / PLAN_DT):
            return
        lines = self._lines(now, orders)
        if self._page is not None:
            self._page.show(*lines)
        if self._line is not None:
            text = Text("  |  ".join(lines), no_wrap=True, overflow="ellipsis")
            self._line.update(text, refresh=True)

    def _note(self, text: str, now: float) -> None:
        self._happened, self._until = text, now + _NOTED

    def _lines(self, now: float, orders: Array) -> list[str]:
        diagram, context = self._recorder.diagram, self._recorder.context
        followed = diagram.GetOutputPort("followed").Eval(context)
        chosen = f"{ANY}: " if orders[GAIT] == ANY_INDEX else ""
        lines = [
            f"command {_command(orders[COMMAND])}",
            f"followed {_command(followed)}",
            f"{chosen}{self._recorder.gait}  {np.mean(self._speeds):.2f} m/s  "
            f"return {100 * np.mean(self._rewards):.0f}  {now:.1f} s",
        ]
        notes = [] if self._driver is None else list(self._driver.notes)
        if self._recorder.fell:
            notes.append("it fell" if self._driver is None else _FELL)
        if now < self._until:
            notes.append(self._happened)
        if self._driver is not None and now < _HINT_UNTIL:
            notes.append(_HINT)
        return [*lines, *notes]


def _command(command: Array) -> str:
    """Returns a command as text, forward, sideways and yaw rate."""
    forward, sideways, turning = command + 0.0
    return f"{forward:.2f} and {sideways:.2f} m/s, {turning:.2f} rad/s"
