"""Optimality conditions of a least-propellant descent, solved by Newton: the kernel of the indirect method.

With constant gravity, no least thrust and no limit on the path, Pontryagin's principle says: the primer p is
affine in time, the thrust points along p and is full or zero; dS/dt = (d|p|/dt)/m for the switching function
S, and |p| is convex, so that a flight is at most burn - coast - burn with |p| equal at both switches; the
time of flight is free, so that H = p.g - p'.v = 0 during the coast. The scale of p does not matter. Let the
primer be the unit vectors q1 and q2 at the switches t1 and t2. Then

    r(T) = target,    v(T) = 0,    q2.g (t2 - t1) = (q2 - q1).v(t2)

are seven equations for q1, q2 (two each), t1, t2 and T. Where the flight starts with a coast, they hold with
a t1 < 0. Since the thrust is known in time, r and v are quadratures.

A flight may touch the ground while its first burn turns it upward. There the primer's slope jumps along the
vertical (as the costate of the position does where a limit on it binds at one time), and two unknowns, the
time s of the touch and the jump c, go with two equations, z(s) = v_z(s) = 0.

Source: Lawden, Optimal Trajectories for Space Navigation, 1963; Lu, JGCD 41(4), 2018 (propellant-optimal
powered descent); Bryson, Denham and Dreyfus, AIAA Journal 1(11), 1963 (limits on the state).
"""

from __future__ import annotations

import math
from typing import cast

import numpy as np

from guidance.arrays import Array
from guidance.flight_time.extremal import (
    Burn,
    Extremal,
    PrimerProblem,
    add_burn,
    copy_extremal,
    in_unit,
    new_extremal,
    touches,
)
from guidance.flight_time.first_guess import guess_impulses, guess_suicide_burn, guess_touch
from guidance.flight_time.linear_system import dot, solve_linear
from guidance.kernel import compile_kernel

_MOST_STEPS = 30
_CONVERGED = 1e-10  # largest residual, non-dimensional: a micrometre on the paper's descents
LEAST_PULL, MOST_PULL = 1e-6, 0.98
"""Between these lies the square of gravity over full thrust per start mass."""
ANGLES = 4
"""Of the numbers of a step: two for each primer; three times follow, then those of a touch."""
FREE, TOUCHING = cast("tuple[int, int]", (np.int64(7), np.int64(9)))
"""Equations and unknowns of a flight, and of one that touches the ground. They are numpy's: numba compiles a
kernel anew for each number of Python's that another kernel hands to it."""
HELD, TOUCHING_HELD = cast("tuple[int, int]", (np.int64(6), np.int64(8)))
"""The same where the time of flight is held, and the Hamiltonian need not vanish."""
_TIME = 6  # place of the time of flight among the unknowns, and of the Hamiltonian among the equations


@compile_kernel
def residuals(x: Extremal, problem: PrimerProblem, out: Array) -> None:
    """The equations of the module docstring, all non-dimensional; the last two where `out` has room."""
    t1, t2, final = x.times[0], x.times[1], x.times[2]
    r, v, g, flow = problem
    first = max(t1, 0.0)
    for number in range(6):
        out[number] = 0.0
    if first > 0.0:
        add_burn(x, Burn(0.0, first, 1.0), flow, final, out)
    hamiltonian = 0.0
    for axis in range(3):
        q1, q2 = x.primer[0, axis], x.primer[1, axis]
        speed = v[axis] + g[axis] * t2 + out[3 + axis]
        hamiltonian += q2 * g[axis] * (t2 - t1) - (q2 - q1) * speed
    add_burn(x, Burn(t2, final, 1.0 - flow * first), flow, final, out)
    for axis in range(3):
        fall = g[axis] * final
        out[axis] += r[axis] + (v[axis] + 0.5 * fall) * final
        out[3 + axis] += v[axis] + fall
    out[6] = hamiltonian
    if out.size == TOUCHING:
        touch, up = x.touch[0], np.zeros(6)
        add_burn(x, Burn(0.0, touch, 1.0), flow, touch, up)
        out[7] = r[2] + (v[2] + 0.5 * g[2] * touch) * touch + up[2] - x.touch[2]
        out[8] = v[2] + g[2] * touch + up[5]


@compile_kernel
def move_extremal(x: Extremal, frame: Array, step: Array, out: Extremal) -> None:
    """Apply a step: two angles of q1 and of q2 in their tangent frames, the times, and those of a touch."""
    for k in range(2):
        size = 0.0
        for axis in range(3):
            value = x.primer[k, axis]
            value += frame[2 * k, axis] * step[2 * k] + frame[2 * k + 1, axis] * step[2 * k + 1]
            out.primer[k, axis] = value
            size += value * value
        size = math.sqrt(size)
        for axis in range(3):
            out.primer[k, axis] /= size
    for k in range(3):
        out.times[k] = x.times[k] + step[ANGLES + k]
    if step.size == TOUCHING:
        out.touch[0], out.touch[1] = x.touch[0] + step[FREE], x.touch[1] + step[FREE + 1]
        out.touch[2] = x.touch[2]


@compile_kernel
def _set_frame(x: Extremal, frame: Array) -> None:
    """Two unit vectors normal to q1, and two to q2."""
    for k in range(2):
        q = x.primer[k]
        axis = 0
        for i in range(1, 3):
            if abs(q[i]) < abs(q[axis]):
                axis = i
        first, tilt = frame[2 * k], -q[axis]
        for i in range(3):
            first[i] = tilt * q[i]
        first[axis] += 1.0
        size = math.sqrt(dot(first, first))
        for i in range(3):
            first[i] /= size
        for i in range(3):
            j, h = (i + 1) % 3, (i + 2) % 3
            frame[2 * k + 1, i] = q[j] * first[h] - q[h] * first[j]


@compile_kernel
def _norm(values: Array) -> float:
    """Largest magnitude; nan where a value is."""
    largest = 0.0
    for value in values:
        if math.isnan(value):
            return value
        largest = max(largest, abs(value))
    return largest


@compile_kernel
def _length(values: Array) -> float:
    return math.sqrt(dot(values, values))


@compile_kernel
def _admitted(x: Extremal, mass_flow: float) -> bool:
    """Whether the times are in order and mass is left."""
    first = max(x.times[0], 0.0)
    if touches(x) and not 0.0 < x.touch[0] < first:
        return False
    return first < x.times[1] < x.times[2] and mass_flow * (first + x.times[2] - x.times[1]) < 0.95


@compile_kernel
def set_jacobian(
    x: Extremal, problem: PrimerProblem, here: Array, frame: Array, trial: Extremal, jacobian: Array
) -> None:
    """Derivatives of the equations by the unknowns, from differences.

    Args:
        x: where, with a flight of about one unit of time.
        problem: in the same units.
        here: residuals at x, shape (7,), or (9,) with a touch.
        frame: the answer's tangent frames of q1 and q2, shape (4, 3).
        trial: is overwritten.
        jacobian: the answer, as many rows and columns: a column for each angle of q1 and q2, for t1, t2 and
            T, and for s and c.
    """
    there, step = np.empty(here.size), np.zeros(here.size)
    _set_frame(x, frame)
    for k in range(here.size):
        step[k] = (
            -1e-7 if k == ANGLES and x.times[0] < 0.0 else 1e-7
        )  # stay on one side of the kink at t1 = 0
        move_extremal(x, frame, step, trial)
        residuals(trial, problem, there)
        for i in range(here.size):
            jacobian[i, k] = (there[i] - here[i]) / step[k]
        step[k] = 0.0


@compile_kernel
def _newton_step(
    x: Extremal, problem: PrimerProblem, here: Array, size: int, frame: Array, trial: Extremal
) -> tuple[Array, bool]:
    """Full step towards a root of so many equations, from a difference Jacobian; if there is one."""
    jacobian = np.empty((here.size, here.size))
    set_jacobian(x, problem, here, frame, trial, jacobian)
    if size == TOUCHING_HELD:
        jacobian[_TIME, :], jacobian[_TIME, _TIME] = 0.0, 1.0
    count = TOUCHING if size == TOUCHING_HELD else size
    full = -here[:count]
    found = solve_linear(jacobian[:count, :count], full)
    for value in full:
        found = found and math.isfinite(value)
    return full, found


@compile_kernel
def _newton(x: Extremal, problem: PrimerProblem, size: int) -> bool:
    """Damped Newton, in place, on so many unknowns and equations, as of `solve_from`; if it converged."""
    count, held = TOUCHING if size > FREE else FREE, size == TOUCHING_HELD
    solved = TOUCHING if held else size
    frame, step, trial = np.empty((4, 3)), np.zeros(count), new_extremal()
    here, there = np.empty(count), np.empty(count)
    if not _admitted(x, problem.mass_flow):
        return False
    residuals(x, problem, here)
    for _ in range(_MOST_STEPS):
        if held:
            here[_TIME] = 0.0
        if _norm(here[:solved]) < _CONVERGED:
            return True
        full, found = _newton_step(x, problem, here, size, frame, trial)
        if not found:
            return False
        turn, delay = _norm(full[:ANGLES]), _norm(full[ANGLES + 1 : FREE])
        damping = min(1.0, 0.7 / max(1e-9, turn), 0.5 / max(1e-9, delay))
        before, better = _length(here[:solved]), False
        for _ in range(12):
            for number in range(solved):
                step[number] = damping * full[number]
            move_extremal(x, frame, step, trial)
            if _admitted(trial, problem.mass_flow):
                residuals(trial, problem, there)
                if held:
                    there[_TIME] = 0.0
                if _length(there[:solved]) < (1.0 - 0.1 * damping) * before:
                    better = True
                    break
            damping *= 0.5
        if not better:
            return False
        copy_extremal(trial, x)
        here, there = there, here
    return _norm(here[:solved]) < _CONVERGED


@compile_kernel
def solve_from(x: Extremal, problem: PrimerProblem, size: int) -> bool:
    """Newton from a guess, with the time of flight of the guess as unit of time.

    Args:
        x: a guess in seconds; the answer.
        problem: in seconds.
        size: FREE or TOUCHING; or HELD or TOUCHING_HELD.
    """
    unit = x.times[2]
    for k in range(3):
        x.times[k] /= unit
    x.touch[0], x.touch[1], x.touch[2] = x.touch[0] / unit, x.touch[1] * unit, x.touch[2] / (unit * unit)
    found = _newton(x, in_unit(problem, unit), size)
    for k in range(3):
        x.times[k] *= unit
    x.touch[0], x.touch[1], x.touch[2] = x.touch[0] * unit, x.touch[1] / unit, x.touch[2] * (unit * unit)
    return found


@compile_kernel
def solve_primer(problem: PrimerProblem, x: Extremal) -> bool:
    """Find the extremal of a problem.

    Args:
        problem: in seconds, as `PrimerProblem` says.
        x: the answer, in seconds.

    Returns:
        Whether there was a first guess, and Newton's method converged from it.
    """
    r, g = problem.position, problem.gravity
    if not LEAST_PULL < dot(g, g) < MOST_PULL or not dot(r, g) < 0.0:
        return False
    for attempt in range(2):
        if guess_suicide_burn(problem, attempt == 0, x) and solve_from(x, problem, FREE):
            return True
    return guess_impulses(problem, x) and solve_from(x, problem, FREE)


@compile_kernel
def solve_touching(problem: PrimerProblem, x: Extremal) -> bool:
    """Find the extremal that touches the target's altitude in its first burn.

    Args:
        problem: in seconds, as `PrimerProblem` says.
        x: the answer, in seconds.

    Returns:
        Whether it was found. The ground bends its primer as it may where c > 0, upward.
    """
    pull = problem.gravity
    if not LEAST_PULL < dot(pull, pull) < MOST_PULL or not guess_touch(problem, x):
        return False
    return solve_from(x, problem, TOUCHING)
