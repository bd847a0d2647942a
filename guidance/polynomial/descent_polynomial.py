"""Descents whose acceleration is a polynomial in time, in closed form.

E-guidance (Cherry, "A general, explicit, optimizing guidance law for rocket-propelled spaceflight", AIAA
64-638, 1964) takes a linear one, the least that meets a position and a velocity. The lunar module's P63 and
P64 (Klumpp, "Apollo lunar descent guidance", Automatica 10, 1974) take a quadratic one, which meets an
acceleration too. With s the time to go, T of it at the start, and r_f, v_f and a_f at the end,

    linear      r = r_f - v_f s + p s^2 + q s^3,                 p and q from r and v at s = T,
    quadratic   r = r_f - v_f s + a_f s^2 / 2 + b s^3 + c s^4,   b and c from the same,

so the arrival is met exactly, whatever T. With R = r_f - r the linear one begins with
a = 6 R / T^2 - (4 v + 2 v_f) / T and is the minimum of the integral of |a|^2 for the given time; the other
begins with a = 12 R / T^2 - 6 (v + v_f) / T + a_f. Both are accelerations of the lander: the thrust adds -g.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from guidance.arrays import Array
from guidance.state import State
from guidance.validation import finite_number, finite_vector


@dataclass(frozen=True, eq=False)
class Arrival:
    """What a descent must meet at its end.

    Attributes:
        position: [m] shape (3,).
        velocity: [m/s] shape (3,); rest unless given.
        acceleration: [m/s^2] shape (3,), of the lander, gravity included; None where it is free.

    Raises:
        ValueError: a vector is not finite or of the wrong shape.
    """

    position: Array
    velocity: Array = field(default_factory=lambda: np.zeros(3))
    acceleration: Array | None = None

    def __post_init__(self) -> None:
        """Refuse what no flight can meet; copy the arrays and freeze them."""
        for name in ("position", "velocity", "acceleration"):
            if getattr(self, name) is not None:
                vector = finite_vector(name, getattr(self, name), 3)
                vector.flags.writeable = False
                object.__setattr__(self, name, vector)


@dataclass(frozen=True, eq=False)
class DescentPolynomial:
    """A descent as a polynomial in the time to go.

    Attributes:
        coefficients: shape (n, 3), of position in rising powers of the time to go [m/s^k].
        time_of_flight: [s].
    """

    coefficients: Array
    time_of_flight: float

    def position_at(self, time: Array) -> Array:
        """[m] shape (k, 3), at times [s] since the start, shape (k,)."""
        return self._derivative(time, 0)

    def velocity_at(self, time: Array) -> Array:
        """[m/s] shape (k, 3)."""
        return -self._derivative(time, 1)

    def acceleration_at(self, time: Array) -> Array:
        """[m/s^2] shape (k, 3), of the lander; the thrust's is this less gravity."""
        return self._derivative(time, 2)

    def _derivative(self, time: Array, order: int) -> Array:
        rising = np.polynomial.polynomial.polyder(self.coefficients, order)
        value = np.polynomial.polynomial.polyval(self.time_of_flight - np.asarray(time), rising)
        return np.asarray(value.T, dtype=np.float64)


def meet_arrival(state: State, arrival: Arrival, time_of_flight: float) -> DescentPolynomial:
    """The descent of least degree from a state to an arrival in a given time.

    Args:
        state: start; its mass does not matter.
        arrival: its acceleration chooses the law: None for E-guidance's, else Apollo's.
        time_of_flight: [s] above zero.

    Raises:
        ValueError: the time is not a positive number.
    """
    time = finite_number("time_of_flight", time_of_flight, above=0.0)
    return DescentPolynomial(polynomial_coefficients(state, arrival, np.array([time]))[0], time)


def polynomial_coefficients(state: State, arrival: Arrival, times: Array) -> Array:
    """Coefficients of the descents of several times of flight [s], shape (k,): shape (k, 4 or 5, 3)."""
    t = times[:, None]
    end, speed = arrival.position, arrival.velocity
    fixed = [np.broadcast_to(end, (times.size, 3)), np.broadcast_to(-speed, (times.size, 3))]
    miss, gained = state.position - end + speed * t, speed - state.velocity
    if arrival.acceleration is None:
        second, third = (3.0 * miss - gained * t) / t**2, (gained * t - 2.0 * miss) / t**3
        return np.stack([*fixed, second, third], axis=1)
    half = 0.5 * arrival.acceleration
    miss, gained = miss - half * t**2, gained - 2.0 * half * t
    third, fourth = (4.0 * miss - gained * t) / t**3, (gained * t - 3.0 * miss) / t**4
    return np.stack([*fixed, np.broadcast_to(half, (times.size, 3)), third, fourth], axis=1)
