"""Sparse least squares within linear inequalities, as a MathematicalProgram."""

import numpy as np
from pydrake.solvers import ClarabelSolver, MathematicalProgram
from scipy.sparse import csc_matrix, eye_array, hstack

from loco_drake.common.arrays import Array

_CHUNK = 64  # of residuals in one cost, which Drake stores as a dense matrix


def solve_least_squares(A: csc_matrix, b: Array, G: csc_matrix, h: Array) -> Array:
    """Returns x that minimizes |A x - b|^2 with G x <= h.

    The residuals are variables of their own, so that the program stays sparse.

    Raises:
        ArithmeticError: if Clarabel finds no solution.
    """
    rows, columns = A.shape
    prog = MathematicalProgram()
    x = prog.NewContinuousVariables(columns)
    r = prog.NewContinuousVariables(rows)
    equal = csc_matrix(hstack((A, -eye_array(rows))))
    prog.AddLinearEqualityConstraint(equal, b, np.concatenate((x, r)))
    prog.AddLinearConstraint(G, np.full(len(h), -np.inf), h, x)
    for start in range(0, rows, _CHUNK):
        part = r[start : start + _CHUNK]
        prog.AddQuadraticCost(
            2 * np.eye(len(part)), np.zeros(len(part)), part, is_convex=True
        )
    result = ClarabelSolver().Solve(prog)
    if not result.is_success():
        raise ArithmeticError(f"Clarabel: {result.get_solution_result()}.")
    solution: Array = result.GetSolution(x)
    return solution
