"""The best affine primer for one time of flight: Newton's method up the concave dual function.

The gradient of D is what the relaxed flight led by the primer misses: with its thrust |u|(tau) along d(tau),

    dD/da = w - v_0 - g T - int |u| d,    dD/db = -(r_0 + v_0 T + g T^2/2) - int tau |u| d,

where |u| follows from the multipliers backward in tau, Y' = -weight - rate Y with Y(T) = 0 and |u| = -Y'. The
maximum is the least velocity change of the relaxed problem; where D has none, no flight lasts T. By c, of a
primer with a limit on the path at theta, the gradient is minus the relaxed flight's place at that time.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.flight_time.linear_system import dot, solve_linear
from guidance.kernel import compile_kernel
from guidance.lower_bound.dual_case import DualCase
from guidance.lower_bound.dual_function import (
    AFFINE,
    THETA,
    linear_part,
    split_step,
    step_growth,
    support,
)

STEPS = 48
"""Of the grid on which D is maximised: the primer needs no finer one."""
_MOST_ITERATIONS = 60
_OVERSHOOT = 1.5  # times what is enough
_MOST_HALVINGS = 50
_DIFFERENCE = 1e-6  # of the primer, for the second derivative
_LEAST_DAMPING = 1e-9  # of the curvature that full thrust over the whole flight has
_TRUSTED_DAMPING = 1e-3  # below it a step's promise is the distance to the maximum


class RelaxedThrust(NamedTuple):
    """The relaxed flight that a primer leads, on the grid of tau.

    Attributes:
        directions: of the thrust at the nodes, shape (n + 1, 3).
        weights: [m/s] velocity change about each node, shape (n + 1,).
        spent: [m/s] int (f mu - l nu).
    """

    directions: Array
    weights: Array
    spent: float


class Ascent(NamedTuple):
    """Where an ascent ended.

    Attributes:
        primer: (a, b), shape (6,), or (a, b, c, theta), shape (10,).
        value: [m/s] D there.
        stalled: whether no step led higher, as at a kink of D.
    """

    primer: Array
    value: float
    stalled: bool


@compile_kernel
def relax_thrust(primer: Array, time: float, case: DualCase) -> RelaxedThrust:
    """The thrust of the relaxed flight of one duration [s] that a primer leads."""
    step, bounds = time / STEPS, case.thrust
    whole = step_growth(step, bounds)
    directions, switching = np.empty((STEPS + 1, 3)), np.empty(STEPS + 1)
    slopes, weights = np.empty(STEPS), np.zeros(STEPS + 1)
    here = support(primer, 0.0, bounds, directions, 0)
    switching[0], spent = here - 1.0, 0.0
    for k in range(STEPS):
        there = support(primer, step * (k + 1), bounds, directions, k + 1)
        slopes[k] = (there - here) / step
        s = switching[k]
        for arc in split_step(s, slopes[k], step, whole, bounds):
            weight = bounds.full if arc.burning else bounds.least
            spent += weight * (s * arc.growth.first + slopes[k] * arc.growth.second)
            s = s * arc.growth.factor + slopes[k] * arc.growth.first
        switching[k + 1], here = s, there
    adjoint = 0.0
    for k in range(STEPS - 1, -1, -1):
        first, second = split_step(switching[k], slopes[k], step, whole, bounds)
        for arc, begin in ((second, first.duration), (first, 0.0)):
            weight = bounds.full if arc.burning else bounds.least
            rate = bounds.full_growth if arc.burning else bounds.least_growth
            after = weight + rate * adjoint
            before = weight + rate * (adjoint * arc.growth.factor + weight * arc.growth.first)
            pushed = adjoint * (arc.growth.factor - 1.0) + weight * arc.growth.first
            moment = arc.duration * (0.5 * pushed + (after - before) * arc.duration / 12.0)
            late = (begin * pushed + moment) / step
            weights[k + 1] += late
            weights[k] += pushed - late
            adjoint += pushed
    return RelaxedThrust(directions, weights, spent)


@compile_kernel
def dual_value(primer: Array, time: float, case: DualCase, gradient: Array) -> float:
    """D [m/s] at one time of flight, and its gradient by (a, b) or (a, b, c), shape (6,) or (9,)."""
    step, thrust = time / STEPS, relax_thrust(primer, time, case)
    for axis in range(3):
        fall = case.gravity[axis] * time
        straight, turned = 0.0, 0.0
        for k in range(STEPS + 1):
            straight += thrust.weights[k] * thrust.directions[k, axis]
            turned += thrust.weights[k] * thrust.directions[k, axis] * step * k
        gradient[axis] = case.arrival[axis] - case.velocity[axis] - fall - straight
        gradient[3 + axis] = -case.position[axis] - (case.velocity[axis] + 0.5 * fall) * time - turned
    if primer.size > AFFINE:
        gradient[AFFINE:] = 0.0
        place_before(thrust, time, primer[THETA], case, gradient[AFFINE:])
        for axis in range(3):
            gradient[AFFINE + axis] *= -1.0
    return linear_part(primer, time, case) - thrust.spent


@compile_kernel
def place_before(thrust: RelaxedThrust, time: float, theta: float, case: DualCase, out: Array) -> None:
    """Write where a relaxed flight of a duration [s] is, theta [s] before its landing, shape (3,) [m]."""
    step, before = time / STEPS, time - theta
    for axis in range(3):
        place = case.position[axis] + (case.velocity[axis] + 0.5 * case.gravity[axis] * before) * before
        for k in range(STEPS + 1):
            late = step * k - theta
            if late > 0.0:
                place += thrust.weights[k] * thrust.directions[k, axis] * late
        out[axis] = place if before >= 0.0 else 0.0


@compile_kernel
def two_impulse_primer(time: float, case: DualCase) -> Array:
    """Primer (a, b), shape (6,), of the flight of two impulses: their directions at its ends.

    A landing point that is free lies where both have the same direction but for up and down.
    """
    primer = np.empty(6)
    first, last = np.empty(3), np.empty(3)
    for axis in range(3):
        fall = case.gravity[axis] * time
        after = -case.position[axis] / time - 0.5 * fall
        first[axis] = after - case.velocity[axis]
        last[axis] = case.arrival[axis] - after - fall
    if case.anywhere:
        share = abs(first[2]) / max(abs(first[2]) + abs(last[2]), 1e-300)
        for axis in range(2):
            change = first[axis] + last[axis]
            first[axis], last[axis] = share * change, (1.0 - share) * change
    first /= max(math.sqrt(dot(first, first)), 1e-300)
    last /= max(math.sqrt(dot(last, last)), 1e-300)
    primer[:3], primer[3:] = last, (first - last) / time
    if case.anywhere:
        primer[3:5] = 0.0  # but for rounding it is
    return primer


@compile_kernel
def _numbers_to_primer(numbers: Array, basis: Array, start: Array, out: Array) -> None:
    """Write the primer that stands for some numbers in a basis, from a start."""
    for i in range(basis.shape[0]):
        out[i] = start[i]
        for k in range(numbers.size):
            out[i] += basis[i, k] * numbers[k]


@compile_kernel
def _slope(gradient: Array, basis: Array) -> Array:
    """Gradient by the numbers of a basis."""
    out = np.zeros(basis.shape[1])
    for k in range(out.size):
        for i in range(gradient.size):
            out[k] += gradient[i] * basis[i, k]
    return out


@compile_kernel
def _curvature(primer: Array, basis: Array, time: float, case: DualCase, slope: Array) -> Array:
    """-d2D by the numbers of a basis, from differences of the gradient."""
    size, moved, there = basis.shape[1], primer.copy(), np.empty(basis.shape[0])
    out = np.empty((size, size))
    for k in range(size):
        for i in range(basis.shape[0]):
            moved[i] = primer[i] + _DIFFERENCE * basis[i, k]
        dual_value(moved, time, case, there)
        for i, after in enumerate(_slope(there, basis)):
            out[i, k] = (slope[i] - after) / _DIFFERENCE
    return 0.5 * (out + out.T)


@compile_kernel
def affine_basis(time: float, case: DualCase) -> Array:
    """The numbers (a, b T) of a primer, shape (6, 6); without those that its landing point leaves no room."""
    out = np.zeros((6, 6))
    for k in range(6):
        if k < 3 or k == 5 or not case.anywhere:
            out[k, k] = 1.0 if k < 3 else 1.0 / time
    return out


@compile_kernel
def _shorten(primer: Array, step: Array, basis: Array, time: float, case: DualCase, enough: float) -> Ascent:
    """Part of the way up a step along which D [m/s] exceeds what is enough: to where it does so by little."""
    gradient, out, low, high = np.empty(basis.shape[0]), primer.copy(), 0.0, 1.0
    value = np.inf
    for _ in range(_MOST_HALVINGS):
        share = 0.5 * (low + high)
        _numbers_to_primer(share * step, basis, primer, out)
        value = dual_value(out, time, case, gradient)
        if enough < value < _OVERSHOOT * enough:
            break
        if value > enough:
            high = share
        else:
            low = share
    return Ascent(out, value, False)


@compile_kernel
def ascend(
    start: Array, basis: Array, time: float, case: DualCase, tolerance: float, enough: float
) -> Ascent:
    """Maximise D for one time of flight.

    Args:
        start: primer, shape (6,) or (10,).
        basis: columns are the directions in which it may move, shape (6, 6) or (9, 7); the seventh number,
            the multiplier along a limit's normal, does not fall below zero.
        time: [s] of flight.
        case: the relaxed problem.
        tolerance: [m/s] stop where the next step promises less.
        enough: [m/s] stop where D exceeds this: it may have no maximum.
    """
    primer, trial, numbers = start.copy(), start.copy(), np.zeros(basis.shape[1])
    gradient, there = np.empty(basis.shape[0]), np.empty(basis.shape[0])
    if numbers.size > AFFINE:
        limit = basis[AFFINE:, AFFINE]
        numbers[AFFINE] = dot(primer[AFFINE:THETA], limit) / dot(limit, limit)
    value = dual_value(primer, time, case, gradient)
    stalled = False
    damping, size = _LEAST_DAMPING, case.thrust.full * time
    for _ in range(_MOST_ITERATIONS):
        if value > enough:
            break
        slope = _slope(gradient, basis)
        curvature = _curvature(primer, basis, time, case, slope)
        better, promise, reached = False, 0.0, value
        step = slope.copy()
        for _ in range(20):
            matrix, step = curvature.copy(), slope.copy()
            for i in range(step.size):
                matrix[i, i] += damping * size
            if solve_linear(matrix, step):
                if step.size > AFFINE:
                    step[AFFINE] = max(step[AFFINE], -numbers[AFFINE])
                promise = dot(slope, step)
                _numbers_to_primer(step, basis, primer, trial)
                reached = dual_value(trial, time, case, there)
                if reached > value + 0.1 * promise and promise > 0.0:
                    better = True
                    break
            damping *= 10.0
        if not better:
            stalled = True
            break
        if reached > _OVERSHOOT * enough:  # no maximum: a longer primer would be good at this time alone
            return _shorten(primer, step, basis, time, case, enough)
        numbers += step
        primer[:], gradient[:], value = trial, there, reached
        damping = max(0.01 * damping, _LEAST_DAMPING)
        if promise < tolerance and damping < _TRUSTED_DAMPING:
            break
    return Ascent(primer, value, stalled)
