"""True motion of a variable-mass point in constant gravity: the only integrator of truth.

    r' = v,   v' = T/m + g,   m' = -|T| / (g_ref Isp)

Under a constant thrust vector the equations have a closed form (Tsiolkovsky's equation, integrated once
more), so a held thrust is propagated exactly, whatever the duration. A thrust that varies is integrated by
DOP853.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array
from guidance.constants import MOON_GRAVITY
from guidance.kernel import compile_kernel
from guidance.lander import Lander
from guidance.state import State
from guidance.validation import finite_number, finite_vector

_SERIES_BELOW = 0.02  # burnt mass fraction under which the power series is more exact than the logarithm


@compile_kernel
def velocity_factor(burnt: float) -> float:
    """-ln(1 - x)/x: gain of velocity over that at constant mass; x = burnt fraction of the initial mass."""
    if burnt == 0.0:
        return 1.0
    return -math.log1p(-burnt) / burnt


@compile_kernel
def position_factor(burnt: float) -> float:
    """((1 - x) ln(1 - x) + x)/x^2: path over (T/m0) t^2; 1/2 at constant mass."""
    if burnt < _SERIES_BELOW:
        total = 0.0
        power = 1.0
        for k in range(10):
            total += power / ((k + 1.0) * (k + 2.0))
            power *= burnt
        return total
    return ((1.0 - burnt) * math.log1p(-burnt) + burnt) / (burnt * burnt)


@compile_kernel
def propagate_into(
    start: Array,
    thrust: Array,
    duration: float,
    gravity: Array,
    exhaust_velocity: float,
    out: Array,
) -> None:
    """Write the 7-vector reached from `start` (x y z vx vy vz m) under a constant thrust into `out`."""
    mass = start[6]
    flow = math.sqrt(thrust[0] ** 2 + thrust[1] ** 2 + thrust[2] ** 2) / exhaust_velocity
    burnt = flow * duration / mass
    to_velocity = duration * velocity_factor(burnt) / mass
    to_position = duration * duration * position_factor(burnt) / mass
    for axis in range(3):
        out[axis] = (
            start[axis]
            + start[3 + axis] * duration
            + 0.5 * gravity[axis] * duration * duration
            + thrust[axis] * to_position
        )
        out[3 + axis] = start[3 + axis] + gravity[axis] * duration + thrust[axis] * to_velocity
    out[6] = mass - flow * duration


def propagate(
    state: State,
    thrust: ArrayLike,
    duration: float,
    lander: Lander,
    gravity: ArrayLike = MOON_GRAVITY,
) -> State:
    """Fly a constant thrust vector for a while; exact to rounding.

    Args:
        state: where the flight starts.
        thrust: [N] shape (3,), site frame; taken as applied, without the vehicle's limits.
        duration: [s] at least zero.
        lander: gives the exhaust velocity.
        gravity: [m/s^2] shape (3,).

    Returns:
        The state after `duration`. Its mass may be below the dry mass: the tank is the caller's business.

    Raises:
        ValueError: an argument is not finite or of the wrong shape, or all mass would be burnt.
    """
    force = finite_vector("thrust", thrust, 3)
    g = finite_vector("gravity", gravity, 3)
    time = finite_number("duration", duration, at_least=0.0)
    if float(np.linalg.norm(force)) / lander.exhaust_velocity * time >= state.mass:
        raise ValueError(f"duration {time:g} s burns more than the whole mass {state.mass:g} kg")
    out = np.empty(7)
    propagate_into(state.as_array(), force, time, g, lander.exhaust_velocity, out)
    return State(out[:3], out[3:6], float(out[6]))


def integrate(
    state: State,
    thrust_at: Callable[[float], Array],
    times: Array,
    lander: Lander,
    gravity: ArrayLike = MOON_GRAVITY,
) -> Array:
    """Fly a thrust that varies in time (scipy's DOP853, restarted at each of `times`, where thrust may kink).

    Args:
        state: state at times[0].
        thrust_at: time [s] -> thrust [N], shape (3,), site frame.
        times: [s] shape (n,), strictly increasing, n >= 2.
        lander: gives the exhaust velocity.
        gravity: [m/s^2] shape (3,).

    Returns:
        Shape (n, 7): position, velocity and mass at each of `times`.

    Raises:
        ValueError: `times` is not finite or does not increase.
        RuntimeError: the integrator cannot go on, as where all mass is burnt.
    """
    from scipy.integrate import solve_ivp

    if times.ndim != 1 or times.size < 2 or not np.isfinite(times).all() or not (np.diff(times) > 0.0).all():
        raise ValueError("times must be finite and strictly increasing, at least two")
    g = finite_vector("gravity", gravity, 3)

    def rate(time: float, y: Array) -> Array:
        force = thrust_at(time)
        flow = float(np.linalg.norm(force)) / lander.exhaust_velocity
        return np.concatenate([y[3:6], force / y[6] + g, [-flow]])

    path = np.empty((times.size, 7))
    path[0] = state.as_array()
    for k in range(times.size - 1):
        leg = solve_ivp(rate, (times[k], times[k + 1]), path[k], method="DOP853", rtol=1e-11, atol=1e-10)
        if not leg.success:
            raise RuntimeError(f"integration stopped after {leg.t[-1]:g} s: {leg.message}")
        path[k + 1] = leg.y[:, -1]
    return path
