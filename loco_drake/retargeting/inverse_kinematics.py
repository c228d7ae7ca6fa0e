"""Joint angles for toe positions, by Drake's InverseKinematics."""

from typing import NamedTuple

import numpy as np
from pydrake.multibody.inverse_kinematics import InverseKinematics
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.solvers import SnoptSolver, SolverOptions

from loco_drake.common.arrays import Array, Bools
from loco_drake.models.quadruped import Quadruped

# Toes are placed within a box of this half width, m.
TOLERANCE = 1e-5
# Weight of joint motion against toe error if the toes are out of reach: 1 rad from the
# previous frame costs as much as 1 mm.
_REST = 1e-3


class Solution(NamedTuple):
    """Joints of T frames."""

    joints: Array  # rad, shape (T, J)
    solved: Bools  # in which frames the solver succeeded, shape (T,)


class LegSolver:
    """Solves the frames of one robot in order, each starting from the one before.

    The trunk is fixed, so targets are positions in the trunk frame B. The program is
    built once; only bounds and costs change. Its solution has the toes within
    ``TOLERANCE`` of the targets and the joints within the limits of position and speed.
    """

    def __init__(self, robot: Quadruped, fps: float) -> None:
        self._robot = robot
        # A margin, since the solver may slightly exceed its bounds.
        self._step = 0.999 * robot.joint_speed_limits / fps
        self._plant = MultibodyPlant(time_step=0.0)
        robot.AddModel(Parser(self._plant))
        world = self._plant.world_frame()
        self._plant.WeldFrames(world, self._plant.GetFrameByName(robot.trunk_frame))
        self._plant.Finalize()
        self._feet = [self._plant.GetFrameByName(foot) for foot in robot.foot_frames]
        # The model may have the legs in another order.
        joints = [self._plant.GetJointByName(joint) for joint in robot.joint_names]
        self._order = [joint.position_start() for joint in joints]
        self._solver = SnoptSolver()
        self.options = SolverOptions()
        self.options.SetOption(self._solver.id(), "Major feasibility tolerance", 1e-7)

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

    def solve(self, p_BF: Array) -> Solution:
        """Returns joints (T, J) in rad for toes ``p_BF`` (T, 4, 3) in m.

        A toe out of reach within the limits of position and speed is put as near to its
        target as possible. If the solver fails there too, the result is the best of its
        last iterate, the robot's :meth:`~.Quadruped.nearest_joints` and the previous
        frame.
        """
        joints = np.empty((len(p_BF), len(self._order)))
        solved = np.ones(len(p_BF), dtype=bool)
        previous = self._robot.stand_joints
        # The first frame may be far from the stance.
        step = np.full(len(self._order), np.inf)
        for k, p in enumerate(p_BF):
            lower = np.maximum(self._robot.joint_lower, previous - step)
            upper = np.minimum(self._robot.joint_upper, previous + step)
            success, solution = self._solve_exactly(p, previous, lower, upper)
            if not success:
                success, solution = self._solve_nearly(p, previous, lower, upper)
            solution = np.clip(solution, lower, upper)
            if not success:
                solved[k] = False
                solution = self._best(p, solution, previous, lower, upper)
            joints[k] = previous = solution
            step = self._step
        return Solution(joints, solved)

    def _best(
        self, p_BF: Array, ended: Array, previous: Array, lower: Array, upper: Array
    ) -> Array:
        def error(joints: Array) -> float:
            return float(np.linalg.norm(self._robot.toe_positions(joints) - p_BF))

        guess = self._robot.nearest_joints(p_BF).clip(lower, upper)
        choices = [q for q in (ended, guess, previous) if np.isfinite(q).all()]
        return min(choices, key=error)

    def _solve_exactly(
        self, p_BF: Array, previous: Array, lower: Array, upper: Array
    ) -> tuple[bool, Array]:
        for toe, p in zip(self._toes, p_BF, strict=True):
            toe.evaluator().set_bounds(p - TOLERANCE, p + TOLERANCE)
        self._limits.evaluator().set_bounds(lower, upper)
        self._near.evaluator().UpdateCoefficients(np.eye(len(previous)), -previous)
        result = self._solver.Solve(self._prog, previous, self.options)
        return result.is_success(), result.GetSolution(self._q)

    def _solve_nearly(
        self, p_BF: Array, previous: Array, lower: Array, upper: Array
    ) -> tuple[bool, Array]:
        """Minimizes the toe distances; built anew, since it is rarely needed."""
        ik = InverseKinematics(self._plant, with_joint_limits=False)
        prog, q = ik.prog(), ik.q()[self._order]
        world = self._plant.world_frame()
        for foot, p in zip(self._feet, p_BF, strict=True):
            # In mm, which the solver's tolerances suit better.
            ik.AddPositionCost(world, p, foot, np.zeros(3), 1e6 * np.eye(3))
        prog.AddQuadraticErrorCost(_REST * np.eye(len(previous)), previous, q)
        prog.AddBoundingBoxConstraint(lower, upper, q)
        result = self._solver.Solve(prog, previous, self.options)
        return result.is_success(), result.GetSolution(q)
