"""Joint angles for positions of toes or other points, by Drake's InverseKinematics."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from pydrake.multibody.inverse_kinematics import InverseKinematics
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.solvers import SnoptSolver, SolverOptions

from loco_drake.common.arrays import Array, Bools
from loco_drake.models.quadruped import Quadruped

# Points are placed within a box of this half width, m.
TOLERANCE = 1e-5
# Weight of joint motion against the error of points that are out of reach: 1 rad from
# the previous frame costs as much as 1 mm.
_REST = 1e-3


class Linkage(NamedTuple):
    """Joints that place points of a robot in its trunk's frame B."""

    add_model: Callable[[Parser], ModelInstanceIndex]  # of no other moving joints
    trunk_frame: str  # name of B
    joint_names: tuple[str, ...]  # of the J joints
    lower: Array  # position limits, rad, shape (J,)
    upper: Array
    speed_limits: Array  # rad/s, shape (J,)
    rest: Array  # joints before the first frame, rad, shape (J,)
    # Names of frames, and positions in them in m, (3,), of the N points.
    points: tuple[tuple[str, Array], ...]


class Solution(NamedTuple):
    """Joints of T frames."""

    joints: Array  # rad, shape (T, J)
    solved: Bools  # in which frames the solver succeeded, shape (T,)


class PointSolver:
    """Solves the frames of one robot in order, each starting from the one before.

    The trunk is fixed, so targets are positions in the trunk frame B. The program is
    built once; only bounds and costs change. Its solution has the points within
    ``TOLERANCE`` of the targets and the joints within the limits of position and speed.

    Args:
        linkage: the joints and points.
        fps: frames per second.
        exact: whether points can be at their targets; else they are only near them.
    """

    def __init__(self, linkage: Linkage, fps: float, *, exact: bool = True) -> None:
        self._linkage, self._exact = linkage, exact
        # A margin, since the solver may slightly exceed its bounds.
        self._step = 0.999 * linkage.speed_limits / fps
        self._plant = MultibodyPlant(time_step=0.0)
        linkage.add_model(Parser(self._plant))
        world = self._plant.world_frame()
        self._plant.WeldFrames(world, self._plant.GetFrameByName(linkage.trunk_frame))
        self._plant.Finalize()
        self._context = self._plant.CreateDefaultContext()
        self._points = [
            (self._plant.GetFrameByName(name), p) for name, p in linkage.points
        ]
        # The model may have the legs in another order.
        joints = [self._plant.GetJointByName(joint) for joint in linkage.joint_names]
        self._order = [joint.position_start() for joint in joints]
        self._solver = SnoptSolver()
        self.options = SolverOptions()
        self.options.SetOption(self._solver.id(), "Major feasibility tolerance", 1e-7)

        ik = InverseKinematics(self._plant, with_joint_limits=False)
        self._prog, self._q = ik.prog(), ik.q()[self._order]
        anywhere = np.full(3, 10.0)
        self._ends = [
            ik.AddPositionConstraint(frame, p, world, -anywhere, anywhere)
            for frame, p in self._points
        ]
        self._limits = self._prog.AddBoundingBoxConstraint(
            linkage.lower, linkage.upper, self._q
        )
        self._near = self._prog.AddQuadraticCost(
            np.eye(len(self._order)), np.zeros(len(self._order)), self._q
        )

    def solve(self, p_BP: Array) -> Solution:
        """Returns joints (T, J) in rad for points ``p_BP`` (T, N, 3) in m.

        A point out of reach within the limits of position and speed is put as near to
        its target as possible. If the solver fails there too, the result is the best of
        its last iterate, :meth:`guess` and the previous frame.
        """
        joints = np.empty((len(p_BP), len(self._order)))
        solved = np.ones(len(p_BP), dtype=bool)
        previous = self._linkage.rest
        # The first frame may be far from the stance.
        step = np.full(len(self._order), np.inf)
        for k, p in enumerate(p_BP):
            lower = np.maximum(self._linkage.lower, previous - step)
            upper = np.minimum(self._linkage.upper, previous + step)
            success, solution = False, previous
            if self._exact:
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

    def positions(self, joints: Array) -> Array:
        """Returns p_BP in m, shape (N, 3), at joints (J,) in rad."""
        q = np.empty(len(self._order))
        q[self._order] = joints
        self._plant.SetPositions(self._context, q)
        world = self._plant.world_frame()
        placed = [
            self._plant.CalcPointsPositions(self._context, frame, p, world)[:, 0]
            for frame, p in self._points
        ]
        return np.array(placed)

    def guess(self, p_BP: Array, previous: Array) -> Array:
        """Returns joints (J,) in rad that may put points near ``p_BP`` (N, 3)."""
        return previous

    def _best(
        self, p_BP: Array, ended: Array, previous: Array, lower: Array, upper: Array
    ) -> Array:
        def error(joints: Array) -> float:
            return float(np.linalg.norm(self.positions(joints) - p_BP))

        guess = self.guess(p_BP, previous).clip(lower, upper)
        choices = [q for q in (ended, guess, previous) if np.isfinite(q).all()]
        return min(choices, key=error)

    def _solve_exactly(
        self, p_BP: Array, previous: Array, lower: Array, upper: Array
    ) -> tuple[bool, Array]:
        for end, p in zip(self._ends, p_BP, strict=True):
            end.evaluator().set_bounds(p - TOLERANCE, p + TOLERANCE)
        self._limits.evaluator().set_bounds(lower, upper)
        self._near.evaluator().UpdateCoefficients(np.eye(len(previous)), -previous)
        result = self._solver.Solve(self._prog, previous, self.options)
        return result.is_success(), result.GetSolution(self._q)

    def _solve_nearly(
        self, p_BP: Array, previous: Array, lower: Array, upper: Array
    ) -> tuple[bool, Array]:
        """Minimizes the distances; built anew, since toes rarely need it."""
        ik = InverseKinematics(self._plant, with_joint_limits=False)
        prog, q = ik.prog(), ik.q()[self._order]
        world = self._plant.world_frame()
        for (frame, p_F), p in zip(self._points, p_BP, strict=True):
            # In mm, which the solver's tolerances suit better.
            ik.AddPositionCost(world, p, frame, p_F, 1e6 * np.eye(3))
        prog.AddQuadraticErrorCost(_REST * np.eye(len(previous)), previous, q)
        prog.AddBoundingBoxConstraint(lower, upper, q)
        result = self._solver.Solve(prog, previous, self.options)
        return result.is_success(), result.GetSolution(q)


class LegSolver(PointSolver):
    """Solves for the toes of a robot on four legs, (T, 4, 3), as its kinematics are."""

    def __init__(self, robot: Quadruped, fps: float) -> None:
        self._robot = robot
        linkage = Linkage(
            add_model=robot.AddModel,
            trunk_frame=robot.trunk_frame,
            joint_names=robot.joint_names,
            lower=robot.joint_lower,
            upper=robot.joint_upper,
            speed_limits=robot.joint_speed_limits,
            rest=robot.stand_joints,
            points=tuple((foot, np.zeros(3)) for foot in robot.foot_frames),
        )
        super().__init__(linkage, fps)

    def positions(self, joints: Array) -> Array:
        """Returns p_BF in m, shape (4, 3)."""
        return self._robot.toe_positions(joints)

    def guess(self, p_BP: Array, previous: Array) -> Array:
        """Returns the robot's :meth:`~.Quadruped.nearest_joints`."""
        return self._robot.nearest_joints(p_BP)
