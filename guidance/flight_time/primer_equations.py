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
from guidance.flight_time.extremal import Burn, Extremal, PrimerProblem, add_burn
from guidance.kernel import compile_kernel

_MOST_STEPS = 30
_CONVERGED = 1e-10  # largest residual, non-dimensional: a micrometre on the paper's descents
_LATEST_FIRST_BURN = 0.5  # of the time before the braking burn, in a first guess
_UNIT = 1e-6  # by which the square of a unit vector may differ from one
LEAST_PULL, MOST_PULL = 1e-6, 0.98
"""Between these lies the square of gravity over full thrust per start mass."""
ANGLES = 4
"""Of the seven numbers of a step: two for each primer; three times follow."""


@compile_kernel
def residuals(x: Extremal, problem: PrimerProblem, out: Array) -> None:
    """Seven equations of the module docstring, all non-dimensional."""
    t1, t2, final = x.times[0], x.times[1], x.times[2]
    r, v, g, flow = problem
    first = max(t1, 0.0)
    here = np.zeros(6)
    if first > 0.0:
        add_burn(x, Burn(0.0, first, 1.0), flow, final, here)
    hamiltonian = 0.0
    for axis in range(3):
        q1, q2 = x.primer[0, axis], x.primer[1, axis]
        speed = v[axis] + g[axis] * t2 + here[3 + axis]
        hamiltonian += q2 * g[axis] * (t2 - t1) - (q2 - q1) * speed
    add_burn(x, Burn(t2, final, 1.0 - flow * first), flow, final, here)
    for axis in range(3):
        fall = g[axis] * final
        out[axis] = r[axis] + (v[axis] + 0.5 * fall) * final + here[axis]
        out[3 + axis] = v[axis] + fall + here[3 + axis]
    out[6] = hamiltonian


@compile_kernel
def move_extremal(x: Extremal, frame: Array, step: Array, out: Extremal) -> None:
    """Apply a step: two angles of q1 and of q2 in their tangent frames, and the three times."""
    for k in range(2):
        size = 0.0
        for axis in range(3):
            value = x.primer[k, axis]
            value += frame[2 * k, axis] * step[2 * k] + frame[2 * k + 1, axis] * step[2 * k + 1]
            out.primer[k, axis] = value
            size += value * value
        for axis in range(3):
            out.primer[k, axis] /= math.sqrt(size)
    for k in range(3):
        out.times[k] = x.times[k] + step[ANGLES + k]


@compile_kernel
def _copy(x: Extremal, out: Extremal) -> None:
    for axis in range(3):
        out.primer[0, axis], out.primer[1, axis] = x.primer[0, axis], x.primer[1, axis]
        out.times[axis] = x.times[axis]


@compile_kernel
def _set_frame(x: Extremal, frame: Array) -> None:
    """Two unit vectors normal to q1, and two to q2."""
    for k in range(2):
        q = x.primer[k]
        axis = np.argmin(np.abs(q))
        first = -q[axis] * q
        first[axis] += 1.0
        first /= math.sqrt(first @ first)
        for i in range(3):
            j, h = (i + 1) % 3, (i + 2) % 3
            frame[2 * k, i] = first[i]
            frame[2 * k + 1, i] = q[j] * first[h] - q[h] * first[j]


@compile_kernel
def _norm(values: Array) -> float:
    return float(np.max(np.abs(values)))


@compile_kernel
def _admitted(x: Extremal, mass_flow: float) -> bool:
    """Whether the times are in order and mass is left."""
    first = max(x.times[0], 0.0)
    return first < x.times[1] < x.times[2] and mass_flow * (first + x.times[2] - x.times[1]) < 0.95


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


@compile_kernel
def set_jacobian(
    x: Extremal, problem: PrimerProblem, here: Array, frame: Array, trial: Extremal, jacobian: Array
) -> None:
    """Derivatives of the seven equations by the seven unknowns, from differences.

    Args:
        x: where, with a flight of about one unit of time.
        problem: in the same units.
        here: residuals at x, shape (7,).
        frame: the answer's tangent frames of q1 and q2, shape (4, 3).
        trial: is overwritten.
        jacobian: the answer, shape (7, 7): a column for each angle of q1 and q2, for t1, t2 and T.
    """
    there, step = np.empty(7), np.zeros(7)
    _set_frame(x, frame)
    for k in range(7):
        step[k] = (
            -1e-7 if k == ANGLES and x.times[0] < 0.0 else 1e-7
        )  # stay on one side of the kink at t1 = 0
        move_extremal(x, frame, step, trial)
        residuals(trial, problem, there)
        for i in range(7):
            jacobian[i, k] = (there[i] - here[i]) / step[k]
        step[k] = 0.0


@compile_kernel
def _newton_step(
    x: Extremal, problem: PrimerProblem, here: Array, frame: Array, trial: Extremal
) -> tuple[Array, bool]:
    """Full step towards a root, from a difference Jacobian, and whether there is one."""
    jacobian = np.empty((7, 7))
    set_jacobian(x, problem, here, frame, trial, jacobian)
    full = -here
    found = solve_linear(jacobian, full)
    return full, found and bool(np.isfinite(full).all())


@compile_kernel
def _newton(x: Extremal, problem: PrimerProblem) -> bool:
    """Damped Newton, in place; whether it converged."""
    frame, step, trial = np.empty((4, 3)), np.empty(7), Extremal(np.empty((2, 3)), np.empty(3))
    here, there = np.empty(7), np.empty(7)
    if not _admitted(x, problem.mass_flow):
        return False
    residuals(x, problem, here)
    for _ in range(_MOST_STEPS):
        if _norm(here) < _CONVERGED:
            return True
        full, found = _newton_step(x, problem, here, frame, trial)
        if not found:
            return False
        turn, delay = _norm(full[:ANGLES]), _norm(full[ANGLES + 1 :])
        damping = min(1.0, 0.7 / max(1e-9, turn), 0.5 / max(1e-9, delay))
        before, better = math.sqrt(here @ here), False
        for _ in range(12):
            for number in range(7):
                step[number] = damping * full[number]
            move_extremal(x, frame, step, trial)
            if _admitted(trial, problem.mass_flow):
                residuals(trial, problem, there)
                if math.sqrt(there @ there) < (1.0 - 0.1 * damping) * before:
                    better = True
                    break
            damping *= 0.5
        if not better:
            return False
        _copy(trial, x)
        here, there = there, here
    return _norm(here) < _CONVERGED


@compile_kernel
def _guess(problem: PrimerProblem, first_burn: bool, x: Extremal) -> bool:
    """First guess: a suicide burn along the vertical, and two sideways impulses, at the start and in it.

    Without the sideways impulse at the start (`first_burn` False) the primer comes from below.

    Returns:
        Whether there is one: next to the target's plane a primer may be too long for floating point.
    """
    r, v, gravity, _ = problem
    up = -gravity / math.sqrt(gravity @ gravity)
    g = math.sqrt(gravity @ gravity)
    height, climb = r @ up, v @ up
    coast = (2.0 * (1.0 - g) * height - climb * climb) / 2.0
    ignition_speed = math.sqrt(max(climb * climb + 2.0 * g * coast, 1e-6 * g * abs(height)))
    t2 = max((ignition_speed + climb) / g, 1e-2 * ignition_speed / g)
    final = t2 + ignition_speed / (1.0 - g)
    across = (r - height * up) / (0.5 * (t2 + final))
    kick = -across - (v - climb * up)
    size = math.sqrt(kick @ kick)
    q2 = across + (ignition_speed + g * (final - t2)) * up
    q2 /= math.sqrt(q2 @ q2)
    t1 = min(t2 - 2.0 * ignition_speed / g, -1e-3 * t2)
    if first_burn and size > 1e-9 * ignition_speed:
        t1 = size if size < 0.8 * t2 else _LATEST_FIRST_BURN * t2
        speed = v + kick
        sine, cosine = 1.0, 0.0
        for _ in range(5):  # the Hamiltonian at t1
            gap = (speed @ up) - g * (t2 - t1)
            if gap == 0.0:
                break
            cosine = ((q2 @ speed) - sine * (kick @ speed) / size) / gap
            cosine = min(max(cosine, -0.95), 0.95)
            sine = math.sqrt(1.0 - cosine * cosine)
        q1 = sine * kick / size + cosine * up
    else:
        q1 = 0.1 * kick / ignition_speed - up
        q1 /= math.sqrt(q1 @ q1)
    for axis in range(3):
        x.primer[0, axis], x.primer[1, axis] = q1[axis], q2[axis]
    x.times[0], x.times[1], x.times[2] = t1, t2, final
    return bool(abs(q1 @ q1 - 1.0) < _UNIT and abs(q2 @ q2 - 1.0) < _UNIT)


@compile_kernel
def solve_primer(problem: PrimerProblem, x: Extremal) -> bool:
    """Find the extremal of a problem.

    Args:
        problem: in seconds, as `PrimerProblem` says.
        x: the answer, in seconds.

    Returns:
        Whether there was a first guess, and Newton's method converged from it.
    """
    r, v, g, flow = problem
    if not LEAST_PULL < g @ g < MOST_PULL or not r @ g < 0.0:
        return False
    for attempt in range(2):
        if not _guess(problem, attempt == 0, x):
            continue
        unit = x.times[2]
        for k in range(3):
            x.times[k] /= unit
        if _newton(x, PrimerProblem(r / (unit * unit), v / unit, g, flow * unit)):
            for k in range(3):
                x.times[k] *= unit
            return True
    return False
