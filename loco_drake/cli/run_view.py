"""What one sees of a simulation besides pictures: in the corner of Meshcat's page."""

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from loco_drake.common.rotations import yaw_of
from loco_drake.control.plan import PLAN_DT
from loco_drake.control.state import ORIENTATION, VELOCITY, split
from loco_drake.viewing.captions import (
    Caption,
    PageText,
    Track,
    legend,
    replay_corner,
)

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat

    from loco_drake.evaluation.tracking import Recorder

_PERIOD = 0.5  # s between updates
_MARKED = 2.0  # s for which a change of gait stands out


class RunView:
    """Shows gait, time, speed and return, twice a second and when the gait changes.

    Args:
        recorder: simulates.
        meshcat: its page, if there is one.
        forces: whether it shows contact forces.
        gait: what the gait is called; by default as the plan calls it.
        window: seconds of which the return is shown; by default of all so far.
        keep: whether to take note without a page, too, for a video.
    """

    def __init__(
        self,
        recorder: "Recorder",
        meshcat: "Meshcat | None",
        *,
        forces: bool = False,
        gait: str | None = None,
        window: float | None = None,
        keep: bool = False,
    ) -> None:
        self._recorder, self._gait = recorder, gait
        self._legend = legend("plan", forces=forces)
        self._page = None if meshcat is None else PageText(meshcat, self._legend)
        kept = None if window is None else round(window / PLAN_DT)
        self._rewards: deque[float] = deque(maxlen=kept)
        self._speeds: deque[float] = deque(maxlen=round(_PERIOD / PLAN_DT))
        self._walked = self._before = ""
        self._changed = -_MARKED
        self._keep = keep or meshcat is not None
        self._track: list[tuple[float, Caption]] = []

    def update(self, now: float) -> None:
        """Takes note of a control period that ended at ``now`` in s, and may show it.

        Without a page or a video it does nothing.
        """
        if not self._keep:
            return
        if self.measure(now):
            self.tell(now, self.caption(now))

    def measure(self, now: float) -> bool:
        """Takes note of a control period; returns whether it is time to tell."""
        diagram, context = self._recorder.diagram, self._recorder.context
        q, v = split(diagram.GetOutputPort("state").Eval(context))
        yaw, velocity = yaw_of(q[ORIENTATION]), v[VELOCITY]
        self._speeds.append(velocity[0] * np.cos(yaw) + velocity[1] * np.sin(yaw))
        reward = diagram.GetOutputPort("reward_terms").Eval(context).sum()
        self._rewards.append(0.0 if self._recorder.fell else float(reward))
        walked = self._gait or str(self._recorder.gait)
        changed = walked != self._walked
        if changed and self._walked:
            self._before, self._changed = self._walked, now
        self._walked = walked
        return changed or round(now / PLAN_DT) % round(_PERIOD / PLAN_DT) == 0

    def caption(self, now: float) -> Caption:
        """Returns what there is to say at ``now`` in s."""
        marked = now < self._changed + _MARKED
        return Caption(
            f"{self._before} → {self._walked}" if marked else self._walked,
            (
                f"{now:.1f} s  {np.mean(self._speeds):.2f} m/s  "
                f"return {100 * np.mean(self._rewards):.0f}",
            ),
            marked,
        )

    def tell(self, now: float, caption: Caption) -> None:
        """Shows a caption, here and in the replay, from ``now`` in s on."""
        # What is known first holds from the beginning.
        self._track.append((now if self._track else 0.0, caption))
        if self._page is not None:
            self._page.show(caption)

    @property
    def track(self) -> Track:
        """What was told so far."""
        return tuple(self._track)

    def fell(self, now: float) -> None:
        """Says that the robot fell at ``now`` in s, and that this was the end."""
        line = f"{now:.1f} s  {self._walked}" if self._walked else f"{now:.1f} s"
        self.tell(now, Caption("it fell", (line,), True))

    def replay(self) -> str:
        """Shows what belongs to the time of the recording that is on the page now.

        Returns:
            HTML that does the same on a saved page.
        """
        corner = replay_corner(self._track, self._legend)
        if self._page is not None:
            self._page.replay(corner)
        return corner
