"""Linear algebra of a few numbers inside compiled loops.

Calling BLAS and LAPACK costs more than the work itself, and loading them costs a process its first 0.2 s.
"""

from __future__ import annotations

from guidance.arrays import Array
from guidance.kernel import compile_kernel


@compile_kernel
def dot(first: Array, second: Array) -> float:
    """Scalar product."""
    total = 0.0
    for k in range(first.size):
        total += first[k] * second[k]
    return total


@compile_kernel
def solve_linear(matrix: Array, vector: Array) -> bool:
    """Solve in place by elimination with row exchange; False where the matrix is singular."""
    size = vector.size
    for k in range(size):
        best = k
        for i in range(k + 1, size):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        if not abs(matrix[best, k]) > 1e-14:
            return False
        if best != k:
            for j in range(k, size):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            vector[k], vector[best] = vector[best], vector[k]
        for i in range(k + 1, size):
            factor = matrix[i, k] / matrix[k, k]
            for j in range(k + 1, size):
                matrix[i, j] -= factor * matrix[k, j]
            vector[i] -= factor * vector[k]
    for k in range(size - 1, -1, -1):
        for j in range(k + 1, size):
            vector[k] -= matrix[k, j] * vector[j]
        vector[k] /= matrix[k, k]
    return True
