"""The best affine primer for one time of flight: Newton's method up the concave dual function.

The gradient of D is what the relaxed flight led by the primer misses: with its thrust |u|(tau) along d(tau),

    dD/da = w - v_0 - g T - int |u| d,    dD/db = -(r_0 + v_0 T + g T^2/2) - int tau |u| d,

where |u| follows from the multipliers backward in tau, Y' = -weight - rate Y with Y(T) = 0 and |u| = -Y'. The
maximum is the least velocity change of the relaxed problem; where D has none, no flight lasts T.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.flight_time.linear_system import solve_linear
from guidance.kernel import compile_kernel
from guidance.lower_bound.dual_case import DualCase
from guidance.lower_bound.dual_function import linear_part, split_step, step_growth, support

_STEPS = 48  # of the grid on which D is maximised: the primer needs no finer one
_MOST_ITERATIONS = 60
_DIFFERENCE = 1e-6  # of the primer, for the second derivative
_LEAST_DAMPING = 1e-9  # of the curvature that full thrust over the whole flight has
_TRUSTED_DAMPING = 1e-3  # below it a step's promise is the distance to the maximum


class Ascent(NamedTuple):
    """Where an ascent ended.

    Attributes:
        primer: (a, b), shape (6,).
        value: [m/s] D there.
        stalled: whether no step led higher, as at a kink of D.
    """

    primer: Array
    value: float
    stalled: bool


@compile_kernel
def dual_value(primer: Array, time: float, case: DualCase, gradient: Array) -> float:
    """D [m/s] at one time of flight, and its gradient by (a, b), shape (6,)."""
    step = time / _STEPS
    whole = step_growth(step, case)
    directions, switching = np.empty((_STEPS + 1, 3)), np.empty(_STEPS + 1)
    slopes, weights = np.empty(_STEPS), np.zeros(_STEPS + 1)
    here = support(primer, 0.0, case, directions[0])
    switching[0], spent = here - 1.0, 0.0
    for k in range(_STEPS):
        there = support(primer, step * (k + 1), case, directions[k + 1])
        slopes[k] = (there - here) / step
        s = switching[k]
        for arc in split_step(s, slopes[k], step, whole, case):
            weight = case.full if arc.burning else case.least
            spent += weight * (s * arc.growth.first + slopes[k] * arc.growth.second)
            s = s * arc.growth.factor + slopes[k] * arc.growth.first
        switching[k + 1], here = s, there
    adjoint = 0.0
    for k in range(_STEPS - 1, -1, -1):
        first, second = split_step(switching[k], slopes[k], step, whole, case)
        for arc, begin in ((second, first.duration), (first, 0.0)):
            weight = case.full if arc.burning else case.least
            rate = case.full_growth if arc.burning else case.least_growth
            after = weight + rate * adjoint
            before = weight + rate * (adjoint * arc.growth.factor + weight * arc.growth.first)
            pushed = adjoint * (arc.growth.factor - 1.0) + weight * arc.growth.first
            moment = arc.duration * (0.5 * pushed + (after - before) * arc.duration / 12.0)
            late = (begin * pushed + moment) / step
            weights[k + 1] += late
            weights[k] += pushed - late
            adjoint += pushed
    for axis in range(3):
        fall = case.gravity[axis] * time
        straight, turned = 0.0, 0.0
        for k in range(_STEPS + 1):
            straight += weights[k] * directions[k, axis]
            turned += weights[k] * directions[k, axis] * step * k
        gradient[axis] = case.arrival[axis] - case.velocity[axis] - fall - straight
        gradient[3 + axis] = -case.position[axis] - (case.velocity[axis] + 0.5 * fall) * time - turned
    return linear_part(primer, time, case) - spent


@compile_kernel
def two_impulse_primer(time: float, case: DualCase) -> Array:
    """Primer (a, b), shape (6,), of the flight of two impulses: their directions at its ends."""
    primer = np.empty(6)
    first, last = np.empty(3), np.empty(3)
    for axis in range(3):
        fall = case.gravity[axis] * time
        after = -case.position[axis] / time - 0.5 * fall
        first[axis] = after - case.velocity[axis]
        last[axis] = case.arrival[axis] - after - fall
    first /= max(math.sqrt(first @ first), 1e-300)
    last /= max(math.sqrt(last @ last), 1e-300)
    primer[:3], primer[3:] = last, (first - last) / time
    return primer


@compile_kernel
def _curvature(primer: Array, time: float, case: DualCase, gradient: Array) -> Array:
    """-d2D by (a, b T), shape (6, 6), from differences of the gradient."""
    moved, there = primer.copy(), np.empty(6)
    out = np.empty((6, 6))
    for k in range(6):
        unit = 1.0 if k < 3 else 1.0 / time
        moved[k] = primer[k] + _DIFFERENCE * unit
        dual_value(moved, time, case, there)
        for i in range(6):
            out[i, k] = (gradient[i] - there[i]) / _DIFFERENCE / (1.0 if i < 3 else time)
        moved[k] = primer[k]
    return 0.5 * (out + out.T)


@compile_kernel
def ascend(start: Array, time: float, case: DualCase, tolerance: float, enough: float) -> Ascent:
    """Maximise D for one time of flight.

    Args:
        start: (a, b), shape (6,).
        time: [s] of flight.
        case: the relaxed problem.
        tolerance: [m/s] stop where the next step promises less.
        enough: [m/s] stop where D exceeds this: it may have no maximum.
    """
    primer, trial = start.copy(), np.empty(6)
    gradient, there = np.empty(6), np.empty(6)
    value = dual_value(primer, time, case, gradient)
    stalled = False
    damping, size = _LEAST_DAMPING, case.full * time
    for _ in range(_MOST_ITERATIONS):
        if value > enough:
            break
        curvature = _curvature(primer, time, case, gradient)
        better, promise, reached = False, 0.0, value
        for _ in range(20):
            matrix, step = curvature.copy(), gradient.copy()
            step[3:] /= time
            for i in range(6):
                matrix[i, i] += damping * size
            slope = step.copy()
            if solve_linear(matrix, step):
                promise = slope @ step
                trial[:3] = primer[:3] + step[:3]
                trial[3:] = primer[3:] + step[3:] / time
                reached = dual_value(trial, time, case, there)
                if reached > value + 0.1 * promise and promise > 0.0:
                    better = True
                    break
            damping *= 10.0
        if not better:
            stalled = True
            break
        primer[:], gradient[:], value = trial, there, reached
        damping = max(0.01 * damping, _LEAST_DAMPING)
        if promise < tolerance and damping < _TRUSTED_DAMPING:
            break
    return Ascent(primer, value, stalled)
