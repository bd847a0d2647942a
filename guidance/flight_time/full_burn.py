"""Flights without a coast: full thrust from the start to the landing, along a primer affine in time.

Where the switching function stays positive there is no coast, and least propellant is least time. Six
equations, r(T) = target and v(T) = 0, go with six unknowns: the primer but for its scale, and T. The
Hamiltonian vanishes, so that the switching function is p'.v - p.g over the thrust acceleration; it is least
where |p| is. The flight is an extremal where it is positive there.

An `Extremal` has a coast. That of such a flight lasts a hundred-millionth of it, where |p| is least.
"""

from __future__ import annotations

import math

import numpy as np

from guidance.arrays import Array
from guidance.flight_time.extremal import Burn, Extremal, PrimerProblem, add_burn, no_touch
from guidance.flight_time.linear_system import dot, solve_linear
from guidance.kernel import compile_kernel

_COAST = 1e-8  # of the time of flight
_PARTS = 12  # of the burn, in its quadrature
_MOST_STEPS = 30
_CONVERGED = 1e-10  # largest residual, non-dimensional
_DIFFERENCE = 1e-7
_MOST_HALVINGS = 12
_BISECTIONS = 60
_SAMPLES = 9  # of the thrust of a first guess
_UNKNOWNS = 7  # the primer at both ends, and the time of flight


@compile_kernel
def _state_after(y: Array, problem: PrimerProblem, time: float, out: Array) -> None:
    """Write position and velocity, shape (6,), after a burn of some time along the primer of unknowns y."""
    r, v, g, flow = problem
    final = y[6]
    x = Extremal(y[:6].copy().reshape((2, 3)), np.array([0.0, final, final]), no_touch())
    for axis in range(3):
        fall = g[axis] * time
        out[axis] = r[axis] + (v[axis] + 0.5 * fall) * time
        out[3 + axis] = v[axis] + fall
    for part in range(_PARTS):
        begin, end = time * part / _PARTS, time * (part + 1) / _PARTS
        add_burn(x, Burn(begin, end, 1.0 - flow * begin), flow, time, out)


@compile_kernel
def _set_residuals(y: Array, problem: PrimerProblem, out: Array) -> bool:
    """Write what is missed at the end, non-dimensional, and the scale of the primer; whether mass is left."""
    final = y[6]
    if not (final > 0.0 and problem.mass_flow * final < 0.95):
        return False
    _state_after(y, problem, final, out)
    for axis in range(3):
        out[axis] /= final * final
        out[3 + axis] /= final
    out[6] = dot(y[:6], y[:6]) - 2.0
    return True


@compile_kernel
def _set_guess(problem: PrimerProblem, y: Array) -> bool:
    """The flight of least energy of the time in which its thrust is full in the mean: u affine in time."""
    r, v, g, flow = problem
    pull, first, last = math.sqrt(dot(g, g)), np.empty(3), np.empty(3)
    low, high = 0.0, 8.0 * (math.sqrt(dot(v, v)) + math.sqrt(math.sqrt(dot(r, r)))) / max(1.0 - pull, 1e-3)
    if not high > 0.0:
        return False
    for _ in range(_BISECTIONS):
        time, mean = 0.5 * (low + high), 0.0
        for axis in range(3):
            way = -6.0 * r[axis] / (time * time)
            first[axis] = way - 4.0 * v[axis] / time - g[axis]
            last[axis] = -way + 2.0 * v[axis] / time - g[axis]
        for k in range(_SAMPLES):
            share, square = k / (_SAMPLES - 1), 0.0
            for axis in range(3):
                square += (first[axis] + (last[axis] - first[axis]) * share) ** 2
            mean += math.sqrt(square) / _SAMPLES
        if mean > 1.0 + 0.5 * flow * time:
            low = time
        else:
            high = time
    scale = math.sqrt(0.5 * (dot(first, first) + dot(last, last)))
    y[:3], y[3:6], y[6] = first / scale, last / scale, 0.5 * (low + high)
    return scale > 0.0


@compile_kernel
def _newton(y: Array, problem: PrimerProblem) -> bool:
    """Damped Newton on the seven equations, in place; whether it converged."""
    here, there, trial = np.empty(_UNKNOWNS), np.empty(_UNKNOWNS), np.empty(_UNKNOWNS)
    jacobian = np.empty((_UNKNOWNS, _UNKNOWNS))
    if not _set_residuals(y, problem, here):
        return False
    for _ in range(_MOST_STEPS):
        if np.abs(here).max() < _CONVERGED:
            return True
        for k in range(_UNKNOWNS):
            trial[:] = y
            step = _DIFFERENCE * (y[6] if k == 6 else 1.0)
            trial[k] += step
            if not _set_residuals(trial, problem, there):
                return False
            jacobian[:, k] = (there - here) / step
        full, damping, better = -here, 1.0, False
        if not solve_linear(jacobian, full):
            return False
        damping = min(1.0, 0.5 * y[6] / max(abs(full[6]), 1e-300))
        for _ in range(_MOST_HALVINGS):
            trial[:] = y + damping * full
            if _set_residuals(trial, problem, there):
                better = dot(there, there) < (1.0 - 0.1 * damping) ** 2 * dot(here, here)
            if better:
                break
            damping *= 0.5
        if not better:
            return False
        y[:], here[:] = trial, there
    return False


@compile_kernel
def solve_full_burn(problem: PrimerProblem, x: Extremal) -> bool:
    """Find the flight that burns all the way, where that is the optimum.

    Args:
        problem: in seconds, as `PrimerProblem` says.
        x: the answer, in seconds.

    Returns:
        Whether it was found, and no coast would spare propellant.
    """
    y, state = np.empty(_UNKNOWNS), np.empty(6)
    if not (_set_guess(problem, y) and _newton(y, problem)):
        return False
    final, begin = y[6], y[:3].copy()
    slope = (y[3:6] - begin) / final
    middle = -dot(begin, slope) / max(dot(slope, slope), 1e-300)
    if not middle < (1.0 - _COAST) * final:
        return False
    _state_after(y, problem, min(max(middle, 0.0), final), state)
    nearest = begin + slope * max(middle, 0.0)
    if not dot(slope, state[3:6]) - dot(nearest, problem.gravity) >= 0.0:
        return False
    if middle > _COAST * final:
        x.times[0], x.times[1] = middle - 0.5 * _COAST * final, middle + 0.5 * _COAST * final
    else:  # |p| grows from the start on: one burn
        x.times[0], x.times[1] = min(2.0 * middle, -_COAST * final), 0.0
    x.times[2] = final
    size = math.sqrt(dot(nearest, nearest))
    if not size > 0.0:
        return False
    for k in range(2):
        for axis in range(3):
            x.primer[k, axis] = (begin[axis] + slope[axis] * x.times[k]) / size
    x.touch[:] = no_touch()
    return True
