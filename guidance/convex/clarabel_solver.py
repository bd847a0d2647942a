"""One safe door to Clarabel: what its Python interface does not check is checked here.

Clarabel reads a square CSR matrix as its transpose, panics (a BaseException) on some others, prints and
ignores unknown keys of `update`, and ends in NumericalError on infinite data.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any

import numpy as np

from guidance.arrays import Array

if TYPE_CHECKING:
    from scipy.sparse import csc_matrix


DEFAULT_TOLERANCE = 1e-8
"""Gap and feasibility tolerance of a solve."""


class SolveStatus(Enum):
    """How a conic solve ended."""

    SOLVED = "solved"
    INFEASIBLE = "infeasible"
    UNBOUNDED = "unbounded"
    LIMIT_REACHED = "limit reached"
    FAILED = "failed"


_STATUSES = {
    "Solved": SolveStatus.SOLVED,
    "AlmostSolved": SolveStatus.LIMIT_REACHED,
    "PrimalInfeasible": SolveStatus.INFEASIBLE,
    "AlmostPrimalInfeasible": SolveStatus.LIMIT_REACHED,
    "DualInfeasible": SolveStatus.UNBOUNDED,
    "MaxIterations": SolveStatus.LIMIT_REACHED,
    "MaxTime": SolveStatus.LIMIT_REACHED,
}


@dataclass(frozen=True, eq=False)
class ConicAnswer:
    """Answer to: minimise x'Px/2 + q'x subject to A x + s = b, s in the cones.

    Attributes:
        status: how the solve ended; `primal` means something only if SOLVED.
        primal: x, shape (n,).
        dual: shape (m,); the Farkas certificate if INFEASIBLE.
        iterations: interior-point iterations.
        words: the solver's own name of the ending.
    """

    status: SolveStatus
    primal: Array
    dual: Array
    iterations: int
    words: str


def _clarabel() -> Any:
    """The extension module, which has no type stubs."""
    return importlib.import_module("clarabel")


def cone_list(cones: tuple[tuple[str, int], ...]) -> list[Any]:
    """Clarabel cone objects for ('zero' | 'nonnegative' | 'second_order', size) pairs."""
    clarabel = _clarabel()
    makers = {
        "zero": clarabel.ZeroConeT,
        "nonnegative": clarabel.NonnegativeConeT,
        "second_order": clarabel.SecondOrderConeT,
    }
    return [makers[kind](size) for kind, size in cones]


@dataclass(frozen=True)
class ConicSettings:
    """How a `ConicSolver` works.

    Attributes:
        tolerance: gap and feasibility tolerance.
        refine: whether to refine each linear solve; it takes two fifths of the time, and well-scaled problems
            end in the same place without it.
    """

    tolerance: float = DEFAULT_TOLERANCE
    refine: bool = False


DEFAULT_SETTINGS = ConicSettings()


def _native_settings(settings: ConicSettings) -> Any:
    native = _clarabel().DefaultSettings()
    native.verbose = False
    native.presolve_enable = False  # removed rows would forbid updates
    native.input_sparse_dropzeros = False
    native.max_threads = 1
    native.direct_solve_method = "qdldl"
    native.max_iter = 100
    native.iterative_refinement_enable = settings.refine
    for name in ("tol_gap_abs", "tol_gap_rel", "tol_feas"):
        setattr(native, name, settings.tolerance)
    return native


class ConicSolver:
    """A Clarabel solver of fixed sparsity; every solve replaces all numbers: none depends on an earlier."""

    def __init__(
        self,
        matrix: csc_matrix,
        bound: Array,
        cost: Array,
        cones: tuple[tuple[str, int], ...],
        settings: ConicSettings = DEFAULT_SETTINGS,
        curvature: Array | None = None,
    ) -> None:
        """Assemble from nominal numbers, and solve them once.

        The first solve of a Clarabel object differs from later ones in its last bits.

        Args:
            matrix: A, CSC, shape (m, n); every entry that may ever be nonzero is stored.
            bound: b, shape (m,).
            cost: q, shape (n,).
            cones: (kind, size) in row order.
            settings: how it works.
            curvature: diagonal of P, shape (n,), at least zero; None for a linear cost.

        Raises:
            ValueError: the data do not fit together or are not finite.
        """
        from scipy.sparse import csc_matrix

        if matrix.format != "csc":
            raise ValueError(f"matrix must be CSC, got {matrix.format}")
        if not matrix.has_sorted_indices:
            raise ValueError("matrix must have sorted indices")
        if matrix.shape != (bound.size, cost.size) or sum(size for _, size in cones) != bound.size:
            raise ValueError("matrix, bound, cost and cones do not fit together")
        self._shape = (matrix.nnz, bound.size, cost.size)
        self._has_curvature = curvature is not None
        self._check(np.asarray(matrix.data, dtype=np.float64), bound, cost)
        quadratic = csc_matrix((cost.size, cost.size))
        if curvature is not None:
            self._check_curvature(curvature)
            columns = np.arange(cost.size + 1)
            quadratic = csc_matrix((curvature, columns[:-1], columns), shape=(cost.size, cost.size))
        self._solver = _clarabel().DefaultSolver(
            quadratic, cost, matrix, bound, cone_list(cones), _native_settings(settings)
        )
        self._solver.solve()

    def _check_curvature(self, curvature: Array) -> None:
        if curvature.shape != (self._shape[2],) or not np.isfinite(curvature).all() or curvature.min() < 0.0:
            raise ValueError("curvature must be finite, at least zero and of the shape of cost")

    def _check(self, *arrays: Array) -> None:
        for array, size in zip(arrays, self._shape, strict=True):
            if array.shape != (size,) or not np.isfinite(array).all():
                raise ValueError("conic data must be finite and of the assembled shape")

    def solve(self, values: Array, bound: Array, cost: Array, curvature: Array | None = None) -> ConicAnswer:
        """Solve with new numbers: the stored entries of A in CSC order, b and q, and the diagonal of P.

        The curvature is kept where none is given; one may be given only where there was one from the start.

        No exception of the solver's comes through, panics included.

        Raises:
            ValueError: a number is not finite, a shape is not the assembled one, or a curvature is negative
                or was not there from the start.
        """
        self._check(values, bound, cost)
        if curvature is not None:
            if not self._has_curvature:
                raise ValueError("curvature: the solver was assembled without one")
            self._check_curvature(curvature)
        try:
            if curvature is not None:
                self._solver.update(P=curvature)
            self._solver.update(A=values, b=bound, q=cost)
            solution = self._solver.solve()
            words = str(solution.status)
            primal = np.array(solution.x)
            dual = np.array(solution.z)
            status = _STATUSES.get(words, SolveStatus.FAILED)
            if status in (SolveStatus.SOLVED, SolveStatus.INFEASIBLE):
                answer = primal if status is SolveStatus.SOLVED else dual
                if not np.isfinite(answer).all():
                    status = SolveStatus.FAILED
            return ConicAnswer(status, primal, dual, int(solution.iterations), words)
        except (KeyboardInterrupt, SystemExit):
            raise
        except BaseException as error:  # pyo3's PanicException is not an Exception
            empty = np.full(self._shape[2], np.nan), np.full(self._shape[1], np.nan)
            return ConicAnswer(SolveStatus.FAILED, *empty, 0, f"{type(error).__name__}: {error}")
