"""When a polynomial descent should land: the time to go that E-guidance and Apollo's law leave open.

Cherry fixes it by what the engine gives, Klumpp by the jerk at the end. A throttled lander above unknown
ground has neither: here it is the time whose descent asks the least velocity change of those that the lander
can fly, so that both laws are at their best.
"""

from __future__ import annotations

import numpy as np

from guidance.arrays import Array
from guidance.lander import Lander
from guidance.polynomial.descent_polynomial import Arrival, polynomial_coefficients
from guidance.state import State
from guidance.thrust_limits import pointing_angle
from guidance.validation import finite_number

_INSTANTS = 17  # of each descent at which it is looked at
_SPARED = 0.05  # share of thrust and of pointing limit that stays for the feedback


def cheapest_time_of_flight(
    state: State, arrival: Arrival, times: Array, lander: Lander, gravity: Array
) -> float:
    """Of some times of flight, that of the cheapest polynomial descent that keeps the lander's limits.

    A descent keeps them where its thrust at the present mass lies within the engine's greatest and the
    pointing limit, if there is one, 5 % of each spared, and where it never passes below the arrival. Where
    none does, the one that breaks them least is taken.

    Args:
        state: start.
        arrival: end, and with it the law.
        times: [s] shape (k,), above zero.
        lander: the vehicle.
        gravity: [m/s^2] shape (3,).

    Returns:
        [s], one of `times`.

    Raises:
        ValueError: there are no times, or one is not positive.
    """
    if times.size == 0:
        raise ValueError("times must hold at least one time of flight")
    finite_number("times", float(times.min()), above=0.0)
    coefficients = polynomial_coefficients(state, arrival, times)
    left = times[:, None] * np.linspace(1.0, 0.0, _INSTANTS)
    powers = left[..., None] ** np.arange(coefficients.shape[1])
    height = powers @ coefficients[..., 2:] - arrival.position[2]
    order = np.arange(2, coefficients.shape[1])
    acceleration = powers[..., : order.size] @ (coefficients[:, 2:] * (order * (order - 1))[:, None])
    thrust = acceleration - gravity
    size = np.linalg.norm(thrust, axis=2)
    share = 1.0 - _SPARED
    excess = np.maximum(size.max(axis=1) * state.mass / (share * lander.max_thrust) - 1.0, 0.0)
    if lander.pointing_limit is not None:
        tilt = np.arctan2(np.hypot(thrust[..., 0], thrust[..., 1]), thrust[..., 2]).max(axis=1)
        excess += np.maximum(tilt - share * pointing_angle(lander), 0.0)
    excess += np.maximum(-height.min(axis=(1, 2)) / max(state.position[2] - arrival.position[2], 1.0), 0.0)
    excess[excess < 1e-9] = 0.0
    velocity_change = np.trapezoid(size, dx=1.0 / (_INSTANTS - 1), axis=1) * times
    return float(times[np.lexsort((velocity_change, excess))[0]])
