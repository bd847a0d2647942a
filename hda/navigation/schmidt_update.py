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
from hda.navigation.layout import ALTIMETER_BIAS, ESTIMATED, TILT, FilterMemory

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
def _solve_rows(factor: Array, rows: Array) -> None:
    """Replace B, shape (m, n), by (L L')^-1 B; whole rows take each step."""
    count = rows.shape[0]
    for a in range(count):
        for b in range(a):
            for j in range(rows.shape[1]):
                rows[a, j] -= factor[a, b] * rows[b, j]
        for j in range(rows.shape[1]):
            rows[a, j] /= factor[a, a]
    for a in range(count - 1, -1, -1):
        for b in range(a + 1, count):
            for j in range(rows.shape[1]):
                rows[a, j] -= factor[b, a] * rows[b, j]
        for j in range(rows.shape[1]):
            rows[a, j] /= factor[a, a]


@compile_kernel
def _design_times(design: Array, table: Array) -> Array:
    """H T by plain loops, equal to the byte on every machine; most of H is 0 and left out."""
    out = np.zeros((design.shape[0], table.shape[1]))
    for a in range(design.shape[0]):
        for k in range(design.shape[1]):
            weight = design[a, k]
            if weight != 0.0:
                for j in range(table.shape[1]):
                    out[a, j] += weight * table[k, j]
    return out


@compile_kernel
def _joseph(covariance: Array, design: Array, across: Array, gain: Array, noise: Array) -> None:
    """Joseph's form in place: first A P, then (A P) A' + K R K', with A = I - K H and rank-one steps.

    Args:
        covariance: shape (n, n), P.
        design: shape (m, n), H.
        across: shape (m, n), H P.
        gain: shape (m, k), K' as far as there are estimates; of what is considered it is 0.
        noise: shape (m,), diagonal of R.
    """
    rows, size = design.shape
    estimated = gain.shape[1]
    for i in range(estimated):
        for a in range(rows):
            for j in range(size):
                covariance[i, j] -= gain[a, i] * across[a, j]
    half = _design_times(design, covariance.T)
    for i in range(size):
        for a in range(rows):
            for j in range(estimated):
                covariance[i, j] -= half[a, i] * gain[a, j]
            if i < estimated:
                weight = gain[a, i] * noise[a]
                for j in range(estimated):
                    covariance[i, j] += weight * gain[a, j]
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
        design: shape (m, n), derivative of the measurement by the state.
        innovation: shape (m,), measured minus predicted.
        noise: shape (m,), variance of each number's own error.
        gate: greatest squared innovation that is taken in.

    Returns:
        The squared innovation in units of its predicted covariance, v' (H P H' + R)^-1 v: of m degrees of
        freedom. Above the gate nothing was changed.
    """
    mean, covariance, _ = memory
    rows = design.shape[0]
    across = _design_times(design, covariance)
    factor = _design_times(design, across.T)
    for a in range(rows):
        factor[a, a] += noise[a]
    _factor(factor)
    square = 0.0
    whitened = innovation.copy()
    for a in range(rows):
        for b in range(a):
            whitened[a] -= factor[a, b] * whitened[b]
        whitened[a] /= factor[a, a]
        square += whitened[a] * whitened[a]
    if not square <= gate:
        return square
    gain = across[:, : mean.size].copy()
    if mean.size > ESTIMATED:
        gain[:, ALTIMETER_BIAS:TILT] = 0.0
    _solve_rows(factor, gain)
    for a in range(rows):
        for i in range(mean.size):
            mean[i] += gain[a, i] * innovation[a]
    _joseph(covariance, design, across, gain, noise)
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
        design: shape (m, n).
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
