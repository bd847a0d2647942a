"""Cheap estimate of the velocity change that a soft landing costs: two impulses and their gravity losses.

The least-propellant descent coasts between a first and a last burn. With both taken as impulses, a flight of
T seconds from r, v to rest at s needs v_1 = (s - r - g T^2/2)/T after the first and brakes v_2 = v_1 + g T,
so it costs |v_1 - v| + |v_2|. A burn of finite thrust acceleration a lasts t = |dv|/a. The first acts as if
it came t/2 late, so it needs |dv| (1 + t/2T); the last, begun earlier, at a lower speed, costs a vertical
descent |v_2| sqrt(a/(a - |g|)), about |v_2| (1 + |g|/2a). The best T is found by golden section. The
differences between sites, which choose among them, are good to a few percent until the last burn begins.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array
from guidance.golden_section import Bracket, divide, keep_either
from guidance.kernel import compile_vector_kernel
from guidance.lander import Lander
from guidance.state import State
from guidance.validation import finite_vector

_SHORTEST, _LONGEST = 0.2, 1.5  # times of flight searched, in free falls to the plane
_SECTIONS = 22  # of the golden section: 1e-4 of the interval
_TOGETHER = 16  # points of the lattice: a few vectors of doubles


class Approach(NamedTuple):
    """What the price of a site depends on, but for where it is.

    Attributes:
        velocity_east: [m/s] at the start.
        velocity_north: [m/s] at the start.
        velocity_up: [m/s] at the start.
        gravity: [m/s^2] size of the downward gravity.
        thrust_acceleration: [m/s^2] greatest, at the start mass.
    """

    velocity_east: float
    velocity_north: float
    velocity_up: float
    gravity: float
    thrust_acceleration: float


@compile_vector_kernel
def _cost(east: float, north: float, up: float, approach: Approach, time: float) -> float:
    """[m/s] at one time of flight to an offset [m]."""
    vx, vy, vz, g, thrust = approach
    first_x, first_y = east / time, north / time
    first_z = (up + 0.5 * g * time * time) / time
    first = math.sqrt((first_x - vx) ** 2 + (first_y - vy) ** 2 + (first_z - vz) ** 2)
    last = math.sqrt(first_x**2 + first_y**2 + (first_z - g * time) ** 2)
    return first + last + 0.5 * (g * last / thrust + first * first / (thrust * time))


@compile_vector_kernel
def _fill(
    east: Array,
    north: Array,
    up: float,
    approach: Approach,
    out: Array,
) -> None:
    """[m/s] of the cheapest two-impulse landing at each offset [m] from the start.

    Neighbours take each step of their golden sections together, so that it runs on the vector units.
    """
    climb, g = approach.velocity_up, approach.gravity
    fall = (climb + math.sqrt(max(climb * climb - 2.0 * g * up, 0.0))) / g
    whole = divide(_SHORTEST * fall, _LONGEST * fall)
    place = np.empty(_TOGETHER)
    bracket, cost = np.empty((4, _TOGETHER)), np.empty((2, _TOGETHER))
    for row in range(north.size):
        for start in range(0, east.size, _TOGETHER):
            for k in range(_TOGETHER):
                place[k] = east[min(start + k, east.size - 1)]
                for point in range(4):
                    bracket[point, k] = whole[point]
                cost[0, k] = _cost(place[k], north[row], up, approach, whole.first)
                cost[1, k] = _cost(place[k], north[row], up, approach, whole.second)
            for _ in range(_SECTIONS):
                for k in range(_TOGETHER):
                    lower = cost[0, k] < cost[1, k]
                    part = keep_either(
                        Bracket(bracket[0, k], bracket[1, k], bracket[2, k], bracket[3, k]), lower
                    )
                    kept = cost[0, k] if lower else cost[1, k]
                    new = part.first if lower else part.second
                    found = _cost(place[k], north[row], up, approach, new)
                    bracket[0, k], bracket[1, k], bracket[2, k], bracket[3, k] = part
                    cost[0, k] = found if lower else kept
                    cost[1, k] = kept if lower else found
            for k in range(min(_TOGETHER, east.size - start)):
                out[row, start + k] = cost[0, k] if cost[0, k] < cost[1, k] else cost[1, k]


def divert_cost(
    state: State,
    east: Array,
    north: Array,
    plane: float,
    lander: Lander,
    gravity: ArrayLike,
) -> Array:
    """Estimated propellant to land softly at each point of a lattice.

    Args:
        state: start, above the plane.
        east: [m] shape (m,), x of the lattice's columns.
        north: [m] shape (n,), y of its rows.
        plane: [m] height of the ground.
        lander: the vehicle, at full thrust in both burns.
        gravity: [m/s^2] shape (3,), along -z.

    Returns:
        [kg] shape (n, m).

    Raises:
        ValueError: the state is not above the plane, or gravity does not point along -z.
    """
    g = finite_vector("gravity", gravity, 3)
    if g[0] != 0.0 or g[1] != 0.0 or g[2] >= 0.0:
        raise ValueError(f"gravity must point along -z, got {g.tolist()}")
    if state.position[2] <= plane:
        raise ValueError(f"state: altitude {state.position[2]:g} m must be above the plane, {plane:g} m")
    vx, vy, vz = (float(v) for v in state.velocity)
    approach = Approach(vx, vy, vz, -float(g[2]), lander.max_thrust / state.mass)
    out = np.empty((north.size, east.size))
    x, y, z = state.position
    _fill(np.asarray(east - x), np.asarray(north - y), float(plane - z), approach, out)
    return state.mass * -np.expm1(-out / lander.exhaust_velocity)
