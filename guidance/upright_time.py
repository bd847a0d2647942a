"""Time to go of a ZEM/ZEV flight that keeps a pointing limit.

The undisturbed 6/2 flight of t seconds from r, v to rest at s has a thrust acceleration linear in time: with
d = s - r it is 6 d/t^2 - 4 v/t - g at its start and -6 d/t^2 + 2 v/t - g at its end. The longer the flight,
the more upright it is. Of the times from the quartic's upward the shortest is taken whose thrust stays
within the limit; where the propellant for that is not on board, the one that it can pay for and that leans
over the limit the least.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array
from guidance.constants import MOON_GRAVITY
from guidance.lander import Lander
from guidance.state import State
from guidance.thrust_limits import pointing_angle
from guidance.validation import finite_number, finite_vector
from guidance.zem_zev import time_to_go

_LONGEST = 3.0  # times the quartic's
_TIMES = 81
_INSTANTS = 9  # of each flight at which its thrust is looked at
_SPARED = 0.03  # share of the velocity change on board that stays for the feedback


def upright_time_to_go(
    state: State,
    target: ArrayLike,
    lander: Lander,
    gravity: ArrayLike = MOON_GRAVITY,
    margin: float = 0.1,
) -> float:
    """Time to go for a ZEM/ZEV flight to `target` whose thrust keeps the lander's pointing limit.

    Args:
        state: present state.
        target: [m] shape (3,), site frame.
        lander: the vehicle; without a pointing limit this is the quartic's time to go.
        gravity: [m/s^2] shape (3,).
        margin: share of the pointing limit that the undisturbed flight leaves to the feedback.

    Returns:
        [s], never less than `guidance.time_to_go`, and at most three times as much.

    Raises:
        ValueError: an argument is not finite, out of range or of the wrong shape.
    """
    shortest = time_to_go(state, target, gravity)
    limit = pointing_angle(lander) * (1.0 - finite_number("margin", margin, at_least=0.0, at_most=0.9))
    if lander.pointing_limit is None or shortest == 0.0:
        return shortest
    times = shortest * np.linspace(1.0, _LONGEST, _TIMES)
    thrust = _undisturbed_flights(
        state, finite_vector("target", target, 3), times, finite_vector("gravity", gravity, 3)
    )
    tilt = np.arctan2(np.hypot(thrust[..., 0], thrust[..., 1]), thrust[..., 2]).max(axis=1)
    change = np.linalg.norm(thrust, axis=2).mean(axis=1) * times
    on_board = lander.exhaust_velocity * math.log(max(state.mass / lander.dry_mass, 1.0))
    payable = change <= (1.0 - _SPARED) * on_board
    payable[0] = True
    upright = payable & (tilt <= limit)
    if upright.any():
        return float(times[np.argmax(upright)])
    return float(times[np.argmin(np.where(payable, tilt, np.inf))])


def _undisturbed_flights(state: State, target: Array, times: Array, gravity: Array) -> Array:
    """[m/s^2] thrust acceleration of the 6/2 flights of some times, shape (times, instants, 3)."""
    t = times[:, None]
    miss = 6.0 * (target - state.position) / t**2
    start = miss - 4.0 * state.velocity / t - gravity
    end = -miss + 2.0 * state.velocity / t - gravity
    fraction = np.linspace(0.0, 1.0, _INSTANTS)[:, None]
    return start[:, None] * (1.0 - fraction) + end[:, None] * fraction
