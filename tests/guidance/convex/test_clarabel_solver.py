"""The safe door to Clarabel: what must be refused, what must be caught, what must come through."""

from typing import Any

import numpy as np
import pytest
from scipy.sparse import csc_matrix, csr_matrix

from guidance.convex.clarabel_solver import ConicSolver, SolveStatus

CONES = (("nonnegative", 2),)
COST = np.array([1.0, 2.0])
BOUND = np.array([-1.0, -3.0])
MATRIX: Any = csc_matrix(np.array([[-1.0, 0.0], [0.0, -1.0]]))


@pytest.fixture
def solver():
    return ConicSolver(MATRIX, BOUND, COST, CONES)


def test_solves_a_linear_programme(solver):
    answer = solver.solve(MATRIX.data, BOUND, COST)
    assert answer.status is SolveStatus.SOLVED
    np.testing.assert_allclose(answer.primal, [1.0, 3.0], atol=1e-6)
    np.testing.assert_allclose(answer.dual, [1.0, 2.0], atol=1e-6)


def test_new_numbers_are_used(solver):
    answer = solver.solve(-2.0 * np.ones(2), np.array([-4.0, -4.0]), COST)
    np.testing.assert_allclose(answer.primal, [2.0, 2.0], atol=1e-6)


def test_infeasible_and_unbounded_are_told_apart():
    matrix: Any = csc_matrix(np.array([[1.0], [-1.0]]))
    solver = ConicSolver(matrix, np.array([1.0, 1.0]), np.array([1.0]), CONES)
    infeasible = solver.solve(matrix.data, np.array([-1.0, -1.0]), np.array([1.0]))
    assert infeasible.status is SolveStatus.INFEASIBLE
    one: Any = csc_matrix(np.array([[1.0]]))
    unbounded = ConicSolver(one, np.array([1.0]), np.array([1.0]), (("nonnegative", 1),))
    assert unbounded.solve(one.data, np.array([1.0]), np.array([1.0])).status is SolveStatus.UNBOUNDED


def test_square_csr_is_refused_and_not_read_as_its_transpose():
    wrong: Any = csr_matrix(MATRIX)
    with pytest.raises(ValueError, match="CSC"):
        ConicSolver(wrong, BOUND, COST, CONES)


def test_unsorted_and_misshapen_data_are_refused():
    unsorted = csc_matrix((np.ones(2), np.array([1, 0]), np.array([0, 2])), shape=(2, 1))
    unsorted.has_sorted_indices = False
    with pytest.raises(ValueError, match="sorted"):
        ConicSolver(unsorted, BOUND, np.ones(1), CONES)
    with pytest.raises(ValueError, match="fit together"):
        ConicSolver(MATRIX, BOUND, np.ones(3), CONES)
    with pytest.raises(ValueError, match="fit together"):
        ConicSolver(MATRIX, BOUND, COST, (("nonnegative", 3),))


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e400])
def test_numbers_that_are_not_finite_never_reach_the_solver(solver, bad):
    for spoiled in range(3):
        data = [MATRIX.data.copy(), BOUND.copy(), COST.copy()]
        data[spoiled][0] = bad
        with pytest.raises(ValueError, match="finite"):
            solver.solve(*data)
    assert solver.solve(MATRIX.data, BOUND, COST).status is SolveStatus.SOLVED


def test_a_quadratic_cost_takes_new_curvature_and_refuses_a_bad_one(solver):
    """Least x'Px/2 + q'x above the bound: x = max(-q/p, bound), number by number."""
    quadratic = ConicSolver(MATRIX, np.zeros(2), -COST, CONES, curvature=np.ones(2))
    answer = quadratic.solve(MATRIX.data, np.zeros(2), -COST, np.array([2.0, 0.5]))
    np.testing.assert_allclose(answer.primal, [0.5, 4.0], atol=1e-6)
    for bad in ([np.nan, 1.0], [np.inf, 1.0], [-1.0, 1.0], [1.0], [1.0, 1.0, 1.0]):
        with pytest.raises(ValueError, match="curvature"):
            quadratic.solve(MATRIX.data, np.zeros(2), -COST, np.array(bad))
    with pytest.raises(ValueError, match="without one"):
        solver.solve(MATRIX.data, BOUND, COST, np.ones(2))


class Panic(BaseException):
    """Stands for pyo3's PanicException, which is not an Exception."""


class Broken:
    def __init__(self, error):
        self.error = error

    def update(self, **_):
        raise self.error


def test_panics_become_a_status(solver):
    solver._solver = Broken(Panic("index out of bounds"))
    answer = solver.solve(MATRIX.data, BOUND, COST)
    assert answer.status is SolveStatus.FAILED
    assert "index out of bounds" in answer.words


@pytest.mark.parametrize("error", [KeyboardInterrupt, SystemExit])
def test_the_user_may_always_leave(solver, error):
    solver._solver = Broken(error())
    with pytest.raises(error):
        solver.solve(MATRIX.data, BOUND, COST)
