"""A descent that a body which must turn can follow: smooth in thrust, from its present lean to upright.

Each axis is a polynomial of fifth degree in time, from the present position, velocity and acceleration to
those of a gate above the site; from the gate on a constant deceleration ends at rest, as in
`guidance.tracking.soft_landing`. The present acceleration is gravity and a thrust along the body's axis,
whose size is free, as an engine answers sooner than a body turns. Of the flights of many durations and first
thrusts the cheapest is taken whose thrust keeps its size, its angle from the vertical, and the rate and the
acceleration with which it turns. A least-propellant descent is cheaper, but switches its thrust, and asks for
another direction at once at its start and its end.

Where a sensor is fixed to the body (`guidance.tracking.looks_ahead`) each flight is tried with detours too,
and what its looks miss is added to its cost.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array
from guidance.constants import MOON_GRAVITY
from guidance.rigid_body.body import RigidBody
from guidance.rigid_body.motion import turning_acceleration
from guidance.rigid_body.quaternion import rotate
from guidance.rigid_body.state import RigidState
from guidance.tracking.looks_ahead import LooksAhead, bend_flights, price_missed_looks
from guidance.tracking.reference import TrackingReference, make_reference
from guidance.validation import finite_number, finite_vector

_INSTANTS = 33  # of each flight at which its thrust is looked at
_FIRST_THRUSTS = (0.5, 1.0, 1.6, 2.2, 3.0, 4.0, 5.5)  # [m/s^2]
_DURATIONS = 90
_SHORTEST = 6  # control periods
_BELOW = 1e-6  # [m] that rounding may lead below the gate


@dataclass(frozen=True)
class TurningOptions:
    """What a smooth descent leaves to the feedback, and how it ends.

    Attributes:
        thrust_margin: share of the greatest thrust that is left to the feedback.
        least_thrust: [m/s^2] thrust acceleration that it never goes below: without thrust there is no
            steering.
        tilt_margin: share of the body's tilt limit that is left.
        turning_margin: share of the body's limit of rate, and of the acceleration that its torques give, that
            is left.
        terminal_time: [s] of the constant deceleration, upright.
        terminal_deceleration: [m/s^2] in it.
        longest: [s] of a flight.
        looks: that a sensor fixed to the body will take of the site; None where it turns to the site itself.

    Raises:
        ValueError: a field is out of range.
    """

    thrust_margin: float = 0.4
    least_thrust: float = 0.3
    tilt_margin: float = 0.3
    turning_margin: float = 0.5
    terminal_time: float = 5.0
    terminal_deceleration: float = 0.3
    longest: float = 70.0
    looks: LooksAhead | None = None

    def __post_init__(self) -> None:
        """Refuse what no flight could keep."""
        for name in ("thrust_margin", "tilt_margin", "turning_margin"):
            finite_number(name, getattr(self, name), at_least=0.0, at_most=0.9)
        for name in ("least_thrust", "terminal_time", "terminal_deceleration", "longest"):
            finite_number(name, getattr(self, name), above=0.0)


DEFAULT_TURNING = TurningOptions()


@dataclass(frozen=True, eq=False)
class _Ends:
    """Boundary conditions of many flights: start of shape (k, 3), end of shape (3,), time of shape (n,)."""

    start: tuple[Array, Array, Array]
    end: tuple[Array, Array, Array]
    time: Array

    def coefficients(self) -> Array:
        """Of the powers 0 to 5 of the share of the time, shape (6, n, k, 3)."""
        t = self.time[:, None, None]
        (r, v, a), (rf, vf, af) = self.start, self.end
        c0, c1, c2 = np.broadcast_arrays(r + 0.0 * t, v * t, 0.5 * a * t**2)
        place, speed, turn = rf - c0 - c1 - c2, vf * t - c1 - 2.0 * c2, af * t**2 - 2.0 * c2
        return np.array(
            [
                c0,
                c1,
                c2,
                10.0 * place - 4.0 * speed + 0.5 * turn,
                -15.0 * place + 7.0 * speed - turn,
                6.0 * place - 3.0 * speed + 0.5 * turn,
            ]
        )


def _evaluate(coefficients: Array, share: Array, order: int) -> Array:
    """A derivative by the share of the time: shape (m, ...) for m shares."""
    powers = np.arange(coefficients.shape[0])
    factor = np.array([math.perm(p, order) for p in powers], dtype=np.float64)
    basis = factor * share[:, None] ** np.maximum(powers - order, 0)
    return np.asarray(np.tensordot(basis, coefficients, axes=1), np.float64)


def plan_turning_descent(
    state: RigidState,
    site: ArrayLike,
    body: RigidBody,
    control_period: float,
    options: TurningOptions = DEFAULT_TURNING,
    gravity: ArrayLike = MOON_GRAVITY,
) -> TrackingReference | None:
    """Plan a smooth descent to rest at a site.

    Args:
        state: present state; rates and engine are not read.
        site: [m] shape (3,).
        body: the vehicle.
        control_period: [s] time over which a thrust is held.
        options: margins and end.
        gravity: [m/s^2] shape (3,), along -z.

    Returns:
        The descent at the control instants; None where no such flight keeps every limit, or where the tank
        does not pay for it to the ground.

    Raises:
        ValueError: an argument is not finite or of the wrong shape, the control period is not above zero, or
            gravity is not along -z.
    """
    down, place = finite_vector("gravity", gravity, 3), finite_vector("site", site, 3)
    if down[0] != 0.0 or down[1] != 0.0 or down[2] >= 0.0:
        raise ValueError(f"gravity must point along -z, got {down.tolist()}: turn the frame")
    finite_number("control_period", control_period, above=0.0)
    longest = max(_SHORTEST, int(options.longest / control_period))
    durations = _DURATIONS if options.looks is None else _DURATIONS // 2
    counts = np.unique(np.round(np.geomspace(_SHORTEST, longest, durations)).astype(int))
    flights = _Flights(state, place, counts * control_period, control_period, down)
    coefficients = flights.coefficients(options)
    cost = flights.cost(coefficients, body, options)
    best = np.unravel_index(int(np.argmin(cost)), cost.shape)
    if not np.isfinite(cost[best]):
        return None
    chosen, count = coefficients[:, best[0], best[1]], int(counts[best[0]])
    last = flights.last_periods(options)
    return _sample(chosen, count, last, control_period, down, options.terminal_deceleration)


@dataclass(frozen=True, eq=False)
class _Flights:
    """Flights from a state to the gate above a site, of shape (3,), in n durations [s], shape (n,)."""

    state: RigidState
    site: Array
    time: Array
    control_period: float
    gravity: Array

    def last_periods(self, options: TurningOptions) -> int:
        """Control periods from the gate to the ground."""
        return max(1, round(options.terminal_time / self.control_period))

    def coefficients(self, options: TurningOptions) -> Array:
        """Of k flights of each duration, with detours where there are looks: shape (6 or 7, n, k, 3)."""
        last, up, state = self.last_periods(options), np.array([0.0, 0.0, 1.0]), self.state
        speed = options.terminal_deceleration * last * self.control_period
        gate = self.site + 0.5 * speed * last * self.control_period * up
        axis = rotate(state.attitude, up)
        start = state.position, state.velocity, np.array(_FIRST_THRUSTS)[:, None] * axis + self.gravity
        end = gate, -speed * up, options.terminal_deceleration * up
        straight = _Ends(start, end, self.time).coefficients()
        return straight if options.looks is None else bend_flights(straight, state.velocity[:2])

    def cost(self, coefficients: Array, body: RigidBody, options: TurningOptions) -> Array:
        """[m/s] of each flight, with what its looks miss, shape (n, k); infinite beyond a limit."""
        share, time, lander = np.linspace(0.0, 1.0, _INSTANTS), self.time, body.lander
        thrust = _evaluate(coefficients, share, 2) / time[:, None, None] ** 2 - self.gravity
        size = np.linalg.norm(thrust, axis=-1)
        used = _used_share(thrust, size, time, self.state.mass, body, options)
        height = _evaluate(coefficients[..., 2], share, 0)
        used = np.where(height.min(axis=0) < height[-1] - _BELOW, np.inf, used)
        cost = size.mean(axis=0) * time[:, None]
        last = self.last_periods(options)
        payable = lander.exhaust_velocity * math.log(max(self.state.mass / lander.dry_mass, 1.0))
        payable -= (options.terminal_deceleration - self.gravity[2]) * last * self.control_period
        cost = np.where((used <= 1.0) & (cost < payable), cost, np.inf)
        if options.looks is not None:
            sight = _evaluate(coefficients, share, 0) - self.site
            cost += price_missed_looks(sight, thrust, time, last * self.control_period, options.looks)
        return cost


def _used_share(
    thrust: Array, size: Array, time: Array, mass: float, body: RigidBody, options: TurningOptions
) -> Array:
    """Greatest share of any limit that each flight uses, shape (n, k); above one it breaks one."""
    most = (1.0 - options.thrust_margin) * body.lander.max_thrust / mass
    least = max(options.least_thrust, body.lander.min_thrust / body.lander.dry_mass)
    tilt = np.arctan2(np.hypot(thrust[..., 0], thrust[..., 1]), thrust[..., 2])
    direction = thrust / np.maximum(size, 1e-9)[..., None]
    step = time[:, None] / (thrust.shape[0] - 1)
    turned = np.diff(direction, axis=0)
    rate = np.linalg.norm(turned, axis=-1) / step
    bend = np.linalg.norm(np.diff(turned, axis=0), axis=-1) / step**2
    spare = 1.0 - options.turning_margin
    fastest = turning_acceleration(mass, body.numbers())
    shares = (
        size.max(axis=0) / most,
        least / np.maximum(size.min(axis=0), 1e-9),
        tilt[1:].max(axis=0) / ((1.0 - options.tilt_margin) * body.tilt_limit),
        rate.max(axis=0) / (spare * body.rate_limit),
        bend.max(axis=0) / (spare * fastest),
    )
    return np.max(shares, axis=0)


def _sample(
    coefficients: Array, count: int, last: int, control_period: float, gravity: Array, deceleration: float
) -> TrackingReference:
    """One flight to the gate, of coefficients of shape (6 or 7, 3), and the way from it to the ground."""
    share = np.arange(count + 1) / count
    position = _evaluate(coefficients, share, 0)
    velocity = _evaluate(coefficients, share, 1) / (count * control_period)
    left = control_period * np.arange(last - 1, -1, -1.0)
    below, sinking = np.zeros((last, 3)), np.zeros((last, 3))
    sinking[:, 2] = -deceleration * left
    end = position[-1].copy()
    end[2] -= 0.5 * deceleration * (last * control_period) ** 2
    below[:, 2] = 0.5 * deceleration * left**2
    return make_reference(
        np.vstack([position, end + below]), np.vstack([velocity, sinking]), control_period, gravity
    )
