"""The system that draws a plan as spheres in Meshcat."""

import numpy as np
from pydrake.geometry import Meshcat, Rgba, Sphere
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context

from loco_drake.common.arrays import Array
from loco_drake.common.rotations import quat_rotate
from loco_drake.control.state import JOINTS, ORIENTATION, POSITION
from loco_drake.models.robot import Robot
from loco_drake.models.simulated import SimulatedRobot

from .control import PlanFollower

# Those of the paper's Figure 1.
_FRONT = Rgba(0.1, 0.3, 0.9)
_REAR = Rgba(0.9, 0.1, 0.1)
_TRUNK = Rgba(0.1, 0.7, 0.2)
NAMES = ("FL_toe", "FR_toe", "RL_toe", "RR_toe", "withers", "hip")
COLORS = (_FRONT, _FRONT, _REAR, _REAR, _TRUNK, _TRUNK)
# Over the radius of a foot, so that a point is seen around the toe that is there.
POINT = 1.5


class KeypointVisualizer(PlanFollower):
    """Draws the plan's toes, withers and hip in Meshcat.

    .. pydrake_system::

        name: KeypointVisualizer
        input_ports:
        - plan: abstract, Plan

    Front toes are blue, rear toes red. Withers and hip are green, and lie above the
    robot's front and rear hip joints. ``period`` is the time between frames in s; a sum
    of powers of two keeps times exact.
    """

    def __init__(
        self,
        robot: SimulatedRobot,
        meshcat: Meshcat,
        path: str = "plan",
        period: float = 1 / 64,
    ) -> None:
        super().__init__(robot)
        self._meshcat = meshcat
        self._paths = [f"{path}/{name}" for name in NAMES]
        for name, color in zip(self._paths, COLORS, strict=True):
            meshcat.SetObject(name, Sphere(POINT * robot.foot_radius), color)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._publish)
        self.DeclareForcedPublishEvent(self._publish)

    def _publish(self, context: Context) -> None:
        plan, k = self._now(context)
        points = keypoints(self._robot, plan.q[k])
        for path, p_W in zip(self._paths, points, strict=True):
            self._meshcat.SetTransform(path, RigidTransform(p_W), context.get_time())


def keypoints(robot: SimulatedRobot, q: Array) -> Array:
    """Returns contact points, withers and hip of a robot, m, shape (..., 6, 3).

    ``q`` is [q_WB as w x y z, p_WB, joints], m and rad, shape (..., 7 + J). Withers and
    hip lie above the front and rear hip joints, and are of a humanoid chest and pelvis.
    """
    if isinstance(robot, Robot):
        x = np.abs(robot.p_BHip[:, 0]).mean()
        trunk = np.array([[x, 0.0, 0.06], [-x, 0.0, 0.06]])
    else:
        trunk = np.array([[0.0, 0.0, 0.3 * robot.stand_height], [0.0, 0.0, 0.0]])
    trunk = np.broadcast_to(trunk, (*q.shape[:-1], *trunk.shape))
    p_BK = np.concatenate((robot.contact_points(q[JOINTS]), trunk), axis=-2)
    turned = quat_rotate(q[ORIENTATION][..., None, :], p_BK)
    return q[POSITION][..., None, :] + turned
