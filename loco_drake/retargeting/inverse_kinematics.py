"""Joint angles for given toes, by Drake's InverseKinematics."""

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.inverse_kinematics import InverseKinematics
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.solvers import SnoptSolver, SolverOptions

from loco_drake.models.quadruped import Quadruped

Array = NDArray[np.float64]

# Toes are placed within a box of this half width, m.
TOLERANCE = 1e-5
# Weight of joint motion against toe error where the toes cannot be reached: 1 rad from
# the frame before counts as much as a millimetre.
_REST = 1e-3


class LegSolver:
    """Solves frame after frame of one robot, each starting from the one before.

    The trunk is fixed, so targets are positions in the trunk frame B. The program is
    built once: bounds and costs are all that change. Solving it finds joints within
    ``TOLERANCE`` of the targets, within the position limits, and as near to the frame
    before as the speed limits ask.
    """

    def __init__(self, robot: Quadruped, fps: float):
        self._robot = robot
        # A hair inside the limits, since the solver may end a hair outside its bounds.
        self._step = 0.999 * robot.joint_speed_limits / fps
        self._plant = MultibodyPlant(time_step=0.0)
        robot.AddModel(Parser(self._plant))
        world = self._plant.world_frame()
        self._plant.WeldFrames(world, self._plant.GetFrameByName(robot.trunk_frame))
        self._plant.Finalize()
        self._feet = [self._plant.GetFrameByName(foot) for foot in robot.foot_frames]
        # The model may have the legs in another order.
        self._order = [
            self._plant.GetJointByName(joint).position_start()
            for joint in robot.joint_names
        ]
        self._solver = SnoptSolver()
        self._options = SolverOptions()
        self._options.SetOption(self._solver.id(), "Major feasibility tolerance", 1e-7)

        ik = InverseKinematics(self._plant, with_joint_limits=False)
        self._prog, self._q = ik.prog(), ik.q()[self._order]
        anywhere = np.full(3, 10.0)
        self._toes = [
            ik.AddPositionConstraint(foot, np.zeros(3), world, -anywhere, anywhere)
            for foot in self._feet
        ]
        self._limits = self._prog.AddBoundingBoxConstraint(
            robot.joint_lower, robot.joint_upper, self._q
        )
        self._near = self._prog.AddQuadraticCost(
            np.eye(len(self._order)), np.zeros(len(self._order)), self._q
        )

    def solve(self, p_BF: Array) -> Array:
        """Returns joints (T, J) in rad for toes ``p_BF`` (T, 4, 3) in m.

        Where a toe cannot be reached within the limits of position and speed, it is
        put as near to its target as they allow.
        """
        joints = np.empty((len(p_BF), len(self._order)))
        previous = self._robot.stand_joints
        step = np.full(
            len(self._order), np.inf
        )  # the first frame may be far from the stance
        for k, p in enumerate(p_BF):
            lower = np.maximum(self._robot.joint_lower, previous - step)
            upper = np.minimum(self._robot.joint_upper, previous + step)
            solution = self._solve_exactly(p, previous, lower, upper)
            if solution is None:
                solution = self._solve_nearly(p, previous, lower, upper)
            joints[k] = np.clip(solution, lower, upper)
            previous, step = joints[k], self._step
        return joints

    def _solve_exactly(
        self, p_BF: Array, previous: Array, lower: Array, upper: Array
    ) -> Array | None:
        for toe, p in zip(self._toes, p_BF, strict=True):
            toe.evaluator().set_bounds(p - TOLERANCE, p + TOLERANCE)
        self._limits.evaluator().set_bounds(lower, upper)
        self._near.evaluator().UpdateCoefficients(np.eye(len(previous)), -previous)
        result = self._solver.Solve(self._prog, previous, self._options)
        if not result.is_success():
            return None
        solution: Array = result.GetSolution(self._q)
        return solution

    def _solve_nearly(
        self, p_BF: Array, previous: Array, lower: Array, upper: Array
    ) -> Array:
        """Minimises the toes' distances; built anew, since it is rarely needed."""
        ik = InverseKinematics(self._plant, with_joint_limits=False)
        prog, q = ik.prog(), ik.q()[self._order]
        world = self._plant.world_frame()
        for foot, p in zip(self._feet, p_BF, strict=True):
            # In mm, which the solver's tolerances suit better.
            ik.AddPositionCost(world, p, foot, np.zeros(3), 1e6 * np.eye(3))
        prog.AddQuadraticErrorCost(_REST * np.eye(len(previous)), previous, q)
        prog.AddBoundingBoxConstraint(lower, upper, q)
        result = self._solver.Solve(prog, previous, self._options)
        solution: Array = result.GetSolution(q)
        return solution
