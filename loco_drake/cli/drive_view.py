"""What a driver sees of a drive: on Meshcat's page and in the terminal."""

from dataclasses import replace
from types import TracebackType
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.live import Live
from rich.text import Text

from loco_drake.cli.run_view import RunView
from loco_drake.common.arrays import Array
from loco_drake.control.driving import COMMAND, GAIT, PUSH, RESET
from loco_drake.motion.gaits import ANY, ANY_INDEX
from loco_drake.systems.meshcat_driver import MeshcatDriver
from loco_drake.viewing.captions import Caption

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat

    from loco_drake.evaluation.tracking import Recorder

_WINDOW = 5.0  # s; of the return that is shown
_NOTED = 3.0  # s for which what happened is shown
_FELL = "it fell: R puts it upright"
_HINT_UNTIL = 15.0  # s
_HINT = "W S A D Q E drive, Space halts; see also Open Controls"


class DriveView:
    """Shows what :class:`RunView` does, command, what is followed, and what happened.

    Args:
        recorder: simulates the drive.
        meshcat: its page, if there is one.
        driver: the controls on the page, if there are any.
        forces: whether the page shows contact forces.
    """

    def __init__(
        self,
        recorder: "Recorder",
        meshcat: "Meshcat | None",
        driver: MeshcatDriver | None,
        forces: bool = False,
    ) -> None:
        self._recorder, self._driver = recorder, driver
        self._view = RunView(recorder, meshcat, window=_WINDOW, forces=forces)
        console = Console(stderr=True)
        self._line = (
            Live(console=console, auto_refresh=False, transient=True)
            if console.is_terminal
            else None
        )
        self._seen = meshcat is not None or self._line is not None
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
        """Takes note of a control period, and shows it when it is time.

        Args:
            now: the simulation's time, s.
            orders: those of the control period, shape (ORDERS,).
        """
        if not self._seen:
            return
        if orders[PUSH]:
            self._note(f"pushed by {abs(orders[PUSH]):g} N s", now)
        if orders[RESET]:
            self._note("put upright", now)
        if not self._view.measure(now):
            return
        caption = self._caption(now, orders)
        self._view.tell(now, caption)
        if self._line is not None:
            text = "  |  ".join((caption.title, *caption.lines))
            self._line.update(
                Text(text, no_wrap=True, overflow="ellipsis"), refresh=True
            )

    def replay(self) -> str:
        """See :meth:`RunView.replay`."""
        return self._view.replay()

    def _note(self, text: str, now: float) -> None:
        self._happened, self._until = text, now + _NOTED

    def _caption(self, now: float, orders: Array) -> Caption:
        diagram, context = self._recorder.diagram, self._recorder.context
        followed = diagram.GetOutputPort("followed").Eval(context)
        chosen = f"{ANY}: " if orders[GAIT] == ANY_INDEX else ""
        run = self._view.caption(now)
        lines = [
            *run.lines,
            f"command {_command(orders[COMMAND])}",
            f"followed {_command(followed)}",
        ]
        if self._driver is not None:
            lines += self._driver.notes
        if self._recorder.fell:
            lines.append("it fell" if self._driver is None else _FELL)
        if now < self._until:
            lines.append(self._happened)
        if self._driver is not None and now < _HINT_UNTIL:
            lines.append(_HINT)
        return replace(run, title=f"{chosen}{run.title}", lines=tuple(lines))


def _command(command: Array) -> str:
    """Returns a command as text, forward, sideways and yaw rate."""
    forward, sideways, turning = command + 0.0
    return f"{forward:.2f} and {sideways:.2f} m/s, {turning:.2f} rad/s"
