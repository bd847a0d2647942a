"""Optimality conditions of a least-propellant descent, solved by Newton: the kernel of the indirect method.

With constant gravity, no least thrust and no limit on the path, Pontryagin's principle says: the primer p is
affine in time, the thrust points along p and is full or zero; dS/dt = (d|p|/dt)/m for the switching function
S, and |p| is convex, so that a flight is at most burn - coast - burn with |p| equal at both switches; the
time of flight is free, so that H = p.g - p'.v = 0 during the coast. The scale of p does not matter. Let the
primer be the unit vectors q1 and q2 at the switches t1 and t2. Then

    r(T) = target,    v(T) = 0,    q2.g (t2 - t1) = (q2 - q1).v(t2)

are seven equations for q1, q2 (two each), t1, t2 and T. Where the flight starts with a coast, they hold with
a t1 < 0. Since the thrust is known in time, r and v are quadratures.

Source: Lawden, Optimal Trajectories for Space Navigation, 1963; Lu, JGCD 41(4), 2018 (propellant-optimal
powered descent).
"""

from __future__ import annotations

import math

import numpy as np

from guidance.arrays import Array
from guidance.kernel import compile_kernel

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_MOST_STEPS = 30
_CONVERGED = 1e-10  # largest residual, non-dimensional: a micrometre on the paper's descents
LEGS = 6
"""Parts of an arc in a flown path."""
_LATEST_FIRST_BURN = 0.5  # of the time before the braking burn, in a first guess


@compile_kernel
def _primer(x: Array, time: float, p: Array) -> None:
    """Primer vector at a time; x = (q1, q2, t1, t2, T)."""
    share = (time - x[6]) / (x[7] - x[6])
    for axis in range(3):
        p[axis] = x[axis] + (x[3 + axis] - x[axis]) * share


@compile_kernel
def _add_burn(x: Array, span: tuple[float, float, float], mass: float, flow: float, out: Array) -> None:
    """Add to out = (r, v) at time span[2] what full thrust from span[0] to span[1] contributes.

    Unit thrust; `mass` at the start, burnt at the rate `flow`. Gauss-Legendre quadrature.
    """
    begin, end, then = span
    half = 0.5 * (end - begin)
    p = np.empty(3)
    for k in range(_POINTS.size):
        elapsed = half * (1.0 + _POINTS[k])
        _primer(x, begin + elapsed, p)
        size = math.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
        push = half * _WEIGHTS[k] / ((mass - flow * elapsed) * max(size, 1e-12))
        for axis in range(3):
            gain = push * p[axis]
            out[3 + axis] += gain
            out[axis] += gain * (then - begin - elapsed)


@compile_kernel
def _residuals(x: Array, case: Array, out: Array) -> None:
    """Seven equations of the module docstring; case = (r0, v0, g, mass flow), all non-dimensional."""
    t1, t2, final, flow = x[6], x[7], x[8], case[9]
    first = max(t1, 0.0)
    here = np.zeros(6)
    if first > 0.0:
        _add_burn(x, (0.0, first, final), 1.0, flow, here)
    hamiltonian = 0.0
    for axis in range(3):
        speed = case[3 + axis] + case[6 + axis] * t2 + here[3 + axis]
        hamiltonian += x[3 + axis] * case[6 + axis] * (t2 - t1) - (x[3 + axis] - x[axis]) * speed
    _add_burn(x, (t2, final, final), 1.0 - flow * first, flow, here)
    for axis in range(3):
        pull = case[6 + axis] * final
        out[axis] = case[axis] + (case[3 + axis] + 0.5 * pull) * final + here[axis]
        out[3 + axis] = case[3 + axis] + pull + here[3 + axis]
    out[6] = hamiltonian


@compile_kernel
def _moved(x: Array, frame: Array, step: Array, out: Array) -> None:
    """Apply a step: two angles of q1 and of q2 in their tangent frames, and the three times."""
    for k in range(2):
        size = 0.0
        for axis in range(3):
            value = x[3 * k + axis]
            value += frame[2 * k, axis] * step[2 * k] + frame[2 * k + 1, axis] * step[2 * k + 1]
            out[3 * k + axis] = value
            size += value * value
        for axis in range(3):
            out[3 * k + axis] /= math.sqrt(size)
    for k in range(3):
        out[6 + k] = x[6 + k] + step[4 + k]


@compile_kernel
def _set_frame(x: Array, frame: Array) -> None:
    """Two unit vectors normal to q1, and two to q2."""
    for k in range(2):
        q = x[3 * k : 3 * k + 3]
        axis = np.argmin(np.abs(q))
        first = -q[axis] * q
        first[axis] += 1.0
        first /= math.sqrt(first @ first)
        frame[2 * k] = first
        frame[2 * k + 1] = np.cross(q, first)


@compile_kernel
def _norm(values: Array) -> float:
    return float(np.max(np.abs(values)))


@compile_kernel
def _admitted(x: Array, flow: float) -> bool:
    """Whether the times are in order and mass is left."""
    first = max(x[6], 0.0)
    return first < x[7] < x[8] and flow * (first + x[8] - x[7]) < 0.95


@compile_kernel
def _solve_linear(matrix: Array, right: Array) -> bool:
    """Solve in place by elimination with row exchange; False where the matrix is singular."""
    size = right.size
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
            right[k], right[best] = right[best], right[k]
        for i in range(k + 1, size):
            factor = matrix[i, k] / matrix[k, k]
            for j in range(k + 1, size):
                matrix[i, j] -= factor * matrix[k, j]
            right[i] -= factor * right[k]
    for k in range(size - 1, -1, -1):
        for j in range(k + 1, size):
            right[k] -= matrix[k, j] * right[j]
        right[k] /= matrix[k, k]
    return True


@compile_kernel
def _newton_step(x: Array, case: Array, here: Array, frame: Array) -> tuple[Array, bool]:
    """Full step towards a root, from a difference Jacobian, and whether there is one."""
    jacobian, there = np.empty((7, 7)), np.empty(7)
    step, trial = np.zeros(7), np.empty(9)
    _set_frame(x, frame)
    for k in range(7):
        step[k] = -1e-7 if k == 4 and x[6] < 0.0 else 1e-7  # stay on one side of the kink at t1 = 0
        _moved(x, frame, step, trial)
        _residuals(trial, case, there)
        for i in range(7):
            jacobian[i, k] = (there[i] - here[i]) / step[k]
        step[k] = 0.0
    full = -here
    found = _solve_linear(jacobian, full)
    return full, found and bool(np.isfinite(full).all())


@compile_kernel
def _newton(x: Array, case: Array) -> bool:
    """Damped Newton, in place; whether it converged."""
    frame, step, trial = np.empty((4, 3)), np.empty(7), np.empty(9)
    here, there = np.empty(7), np.empty(7)
    if not _admitted(x, case[9]):
        return False
    _residuals(x, case, here)
    for _ in range(_MOST_STEPS):
        if _norm(here) < _CONVERGED:
            return True
        full, found = _newton_step(x, case, here, frame)
        if not found:
            return False
        share = min(1.0, 0.7 / max(1e-9, _norm(full[:4])), 0.5 / max(1e-9, _norm(full[5:])))
        before, better = math.sqrt(here @ here), False
        for _ in range(12):
            step[:] = share * full
            _moved(x, frame, step, trial)
            if _admitted(trial, case[9]):
                _residuals(trial, case, there)
                if math.sqrt(there @ there) < (1.0 - 0.1 * share) * before:
                    better = True
                    break
            share *= 0.5
        if not better:
            return False
        x[:] = trial
        here[:] = there
    return _norm(here) < _CONVERGED


@compile_kernel
def _guess(case: Array, first_burn: bool, x: Array) -> None:
    """First guess: a suicide burn along the vertical, and two sideways impulses, at the start and in it.

    Without the sideways impulse at the start (`first_burn` False) the primer comes from below.
    """
    up = -case[6:9] / math.sqrt(case[6:9] @ case[6:9])
    pull = math.sqrt(case[6:9] @ case[6:9])
    height, climb = case[:3] @ up, case[3:6] @ up
    coast = (2.0 * (1.0 - pull) * height - climb * climb) / 2.0
    turn = math.sqrt(max(climb * climb + 2.0 * pull * coast, 1e-6 * pull * abs(height)))
    t2 = max((turn + climb) / pull, 1e-2 * turn / pull)
    final = t2 + turn / (1.0 - pull)
    across = (case[:3] - height * up) / (0.5 * (t2 + final))
    kick = -across - (case[3:6] - climb * up)
    size = math.sqrt(kick @ kick)
    q2 = across + (turn + pull * (final - t2)) * up
    q2 /= math.sqrt(q2 @ q2)
    x[3:6], x[7], x[8] = q2, t2, final
    if first_burn and size > 1e-9 * turn:
        x[6] = size if size < 0.8 * t2 else _LATEST_FIRST_BURN * t2
        speed = case[3:6] + kick
        sine, cosine = 1.0, 0.0
        for _ in range(5):  # the Hamiltonian at t1
            gap = (speed @ up) - pull * (t2 - x[6])
            if gap == 0.0:
                break
            cosine = ((q2 @ speed) - sine * (kick @ speed) / size) / gap
            cosine = min(max(cosine, -0.95), 0.95)
            sine = math.sqrt(1.0 - cosine * cosine)
        x[:3] = sine * kick / size + cosine * up
    else:
        x[6] = min(t2 - 2.0 * turn / pull, -1e-3 * t2)
        x[:3] = 0.1 * kick / turn - up
        x[:3] /= math.sqrt(x[:3] @ x[:3])


@compile_kernel
def solve_primer(case: Array, x: Array) -> bool:
    """Find x = (q1, q2, t1, t2, T) for case = (r0, v0, g, mass flow), in units of the full thrust.

    Args:
        case: start seen from the target, gravity and share of the mass burnt per second at full thrust, all
            but the last divided by full thrust over start mass: units are seconds alone. Shape (10,).
        x: the answer, shape (9,).

    Returns:
        Whether Newton's method converged.
    """
    if not 1e-6 < case[6:9] @ case[6:9] < 0.98 or not case[:3] @ case[6:9] < 0.0:
        return False
    scaled = case.copy()
    for attempt in range(2):
        _guess(case, attempt == 0, x)
        unit = x[8]
        scaled[:3] = case[:3] / (unit * unit)
        scaled[3:6] = case[3:6] / unit
        scaled[9] = case[9] * unit
        x[6:] /= unit
        if _newton(x, scaled):
            x[6:] *= unit
            return True
    return False


@compile_kernel
def fly_primer(x: Array, case: Array) -> Array:
    """States and primers along a flight, at the ends of equal parts of its arcs.

    Returns:
        Rows (r, v, unit vector of p) in the units of `solve_primer`, from the start to the landing.
    """
    first, flow = max(x[6], 0.0), case[9]
    ends = np.array([0.0, first, x[7], x[8]])
    path = np.empty((3 * LEGS + 1, 9))
    state, p, time, mass = case[:6].copy(), np.empty(3), 0.0, 1.0
    for k in range(3 * LEGS + 1):
        _primer(x, time, p)
        path[k, :6] = state
        path[k, 6:] = p / max(math.sqrt(p @ p), 1e-12)
        arc, part = k // LEGS, k % LEGS
        if arc == 3:
            break
        step = (ends[arc + 1] - ends[arc]) / LEGS
        then = ends[arc] + (part + 1) * step
        state[:3] += state[3:] * step + 0.5 * step * step * case[6:9]
        state[3:] += step * case[6:9]
        if arc != 1:
            _add_burn(x, (time, then, then), mass, flow, state)
            mass -= flow * (then - time)
        time = then
    return path
