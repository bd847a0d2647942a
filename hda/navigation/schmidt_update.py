"""One measurement taken into the filter, where some errors are considered and not estimated.

Schmidt's filter (S. F. Schmidt, "Application of state-space methods to navigation problems", Advances in
Control Systems 3, 1966): the gain of what is considered is zero, its covariance with the estimate is kept.
Such a gain is not the optimal one, so the covariance is updated in Joseph's form, which holds for any gain:

    P+ = (I - K H) P (I - K H)' + K R K'.
"""

from __future__ import annotations

import math

import numpy as np

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from hda.navigation.layout import ESTIMATED, FilterMemory

_MOST_DOUBTS = 32  # a factor of 2^32: a state that no such doubt opens is not seen at all


@compile_kernel
def _factor(matrix: Array) -> None:
    """Cholesky's lower factor of a small positive definite matrix, in place."""
    for i in range(matrix.shape[0]):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            if i == j:
                matrix[i, i] = math.sqrt(total)
            else:
                matrix[i, j] = total / matrix[j, j]


@compile_kernel
def _solve_forward(factor: Array, vector: Array) -> None:
    """Replace b by L^-1 b."""
    for i in range(vector.size):
        for k in range(i):
            vector[i] -= factor[i, k] * vector[k]
        vector[i] /= factor[i, i]


@compile_kernel
def _solve_backward(factor: Array, vector: Array) -> None:
    """Replace b by L'^-1 b."""
    for i in range(vector.size - 1, -1, -1):
        for k in range(i + 1, vector.size):
            vector[i] -= factor[k, i] * vector[k]
        vector[i] /= factor[i, i]


@compile_kernel
def _times_transpose(left: Array, right: Array) -> Array:
    """A B' by plain loops: equal to the byte on every machine's linear algebra."""
    out = np.zeros((left.shape[0], right.shape[0]))
    for i in range(left.shape[0]):
        for j in range(right.shape[0]):
            for k in range(left.shape[1]):
                out[i, j] += left[i, k] * right[j, k]
    return out


@compile_kernel
def _joseph(covariance: Array, design: Array, gain: Array, noise: Array) -> None:
    """Joseph's form in place: first A P, then (A P) A' + K R K', with A = I - K H and rank-one steps."""
    size, rows = covariance.shape[0], design.shape[0]
    across = _times_transpose(covariance, design)
    for i in range(ESTIMATED):
        for j in range(size):
            for a in range(rows):
                covariance[i, j] -= gain[i, a] * across[j, a]
    half = _times_transpose(covariance, design)
    for i in range(size):
        for j in range(ESTIMATED):
            for a in range(rows):
                covariance[i, j] -= half[i, a] * gain[j, a]
                if i < ESTIMATED:
                    covariance[i, j] += gain[i, a] * noise[a] * gain[j, a]
    for i in range(size):
        for j in range(i):
            mean = 0.5 * (covariance[i, j] + covariance[j, i])
            covariance[i, j] = mean
            covariance[j, i] = mean


@compile_kernel
def update(memory: FilterMemory, design: Array, innovation: Array, noise: Array, gate: float) -> float:
    """Take a measurement of m numbers in, unless the gate rejects it.

    Args:
        memory: of the filter; changed in place.
        design: shape (m, 20), derivative of the measurement by the state.
        innovation: shape (m,), measured minus predicted.
        noise: shape (m,), variance of each number's own error.
        gate: greatest squared innovation that is taken in.

    Returns:
        The squared innovation in units of its predicted covariance, v' (H P H' + R)^-1 v: of m degrees of
        freedom. Above the gate nothing was changed.
    """
    mean, covariance, _ = memory
    rows = design.shape[0]
    across = _times_transpose(covariance, design)
    factor = _times_transpose(design, across.T)
    for a in range(rows):
        factor[a, a] += noise[a]
    _factor(factor)
    whitened = innovation.copy()
    _solve_forward(factor, whitened)
    square = 0.0
    for a in range(rows):
        square += whitened[a] * whitened[a]
    if not square <= gate:
        return square
    gain = across[:ESTIMATED].copy()
    for i in range(ESTIMATED):
        _solve_forward(factor, gain[i])
        _solve_backward(factor, gain[i])
        for a in range(rows):
            mean[i] += gain[i, a] * innovation[a]
    _joseph(covariance, design, gain, noise)
    return square


@compile_kernel
def take_in(
    memory: FilterMemory,
    design: Array,
    innovation: Array,
    noise: Array,
    gating: tuple[float, int, int, int, int],
) -> float:
    """Take a measurement in; after too many rejections in a row doubt the estimate and not the sensor.

    The doubt is a variance, first the innovation's own square, that is added to the states which the sensor
    sees, and doubled until the gate lets this reading through: the filter never goes on alone for good. A
    single addition does not suffice where the sensor sees a state at a narrow angle, as close beams do.

    Args:
        memory: of the filter; changed in place.
        design: shape (m, 20).
        innovation: shape (m,).
        noise: shape (m,).
        gating: the gate, the patience, the sensor's number, and first and last but one index of the states
            to doubt.

    Returns:
        The squared innovation before any doubt.
    """
    gate, patience, sensor, first, last = gating
    square = update(memory, design, innovation, noise, gate)
    if square <= gate:
        memory.rejections[sensor] = 0
        return square
    memory.rejections[sensor] += 1
    if memory.rejections[sensor] >= patience:
        doubt = 0.0
        for a in range(innovation.size):
            doubt += innovation[a] * innovation[a]
        for _ in range(_MOST_DOUBTS):
            for i in range(first, last):
                memory.covariance[i, i] += doubt
            if update(memory, design, innovation, noise, gate) <= gate:
                memory.rejections[sensor] = 0
                break
            doubt *= 2.0
    return square
