"""The system that keeps a robot in the middle of Meshcat's page."""

from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, LeafSystem

from loco_drake.control.state import POSITION
from loco_drake.models.ground import FLOOR_Z, TILE
from loco_drake.models.scenery import EYE, TARGET
from loco_drake.models.simulated import SimulatedRobot

_FLOOR = "/drake/illustration/floor"
# m; the floor's pattern repeats every two tiles.
_FLOOR_STEP = 10 * TILE


class FollowCamera(LeafSystem):
    """Moves all that is drawn so that the robot stays in the middle of the page.

    .. pydrake_system::

        name: FollowCamera
        input_ports:
        - state: vector (13 + 2 J,), [q, v]; m, rad, m/s, rad/s

    The camera stays and the world moves, by the path ``/drake`` of which all drawings
    are parts. So the viewer's own turning and zooming stay as they are, and a recorded
    page follows, too, while Meshcat cannot animate its camera. The floor moves on in
    steps of its pattern and never ends.

    Args:
        robot: the robot.
        meshcat: the Meshcat that shows it.
        period: time between frames in s; a sum of powers of two keeps times exact.
    """

    def __init__(
        self, robot: SimulatedRobot, meshcat: Meshcat, period: float = 1 / 64
    ) -> None:
        super().__init__()
        self._meshcat = meshcat
        meshcat.SetCameraPose(EYE, TARGET)
        size = 13 + 2 * len(robot.joint_names)
        self._state = self.DeclareVectorInputPort("state", size)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._publish)
        self.DeclareForcedPublishEvent(self._publish)

    def _publish(self, context: Context) -> None:
        time = context.get_time()
        x, y, _ = self._state.Eval(context)[POSITION]
        self._meshcat.SetTransform("/drake", RigidTransform([-x, -y, 0.0]), time)
        steps = [_FLOOR_STEP * round(p / _FLOOR_STEP) for p in (x, y)]
        self._meshcat.SetTransform(_FLOOR, RigidTransform([*steps, FLOOR_Z]), time)
