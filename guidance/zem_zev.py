"""Zero-effort-miss / zero-effort-velocity guidance, its time to go, and thrust saturation.

Paper, section "Controller". With ZEM = r_f - r - v t_go - g t_go^2/2 and ZEV = v_f - v - g t_go,

    a = K_R/t_go^2 ZEM - K_V/t_go ZEV,

optimal for the integral of |a|^2/2 at K_R = 6, K_V = 2. The time to go is the smallest positive root of

    (W + |g|^2/2) t^4 - 2 (v.v + v_f.v + v_f.v_f) t^2 + 12 (r_f - r).(v + v_f) t - 18 |r_f - r|^2 = 0,

the stationarity condition of the integral of (|a|^2/2 + W) over the flight time (D'Souza 1997). The paper
prints it with |g|^2 in front of t^4, which is W = |g|^2/2 and not, as it says, the energy-optimal W = 0.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array
from guidance.constants import MOON_GRAVITY
from guidance.kernel import compile_kernel
from guidance.lander import Lander
from guidance.state import State
from guidance.thrust_limits import limit_into, pointing_angle
from guidance.validation import finite_number, finite_vector


class ZemZevGains(NamedTuple):
    """Gains of the acceleration command: position_gain is K_R, velocity_gain K_V, without unit."""

    position_gain: float
    velocity_gain: float


ENERGY_OPTIMAL = ZemZevGains(6.0, 2.0)
"""They minimise the integral of |a|^2/2."""


@compile_kernel
def _evaluate_quartic(t: float, beta: float, delta: float, epsilon: float) -> float:
    return ((t * t - beta) * t + delta) * t - epsilon


@compile_kernel
def _bracketed_root(low: float, high: float, beta: float, delta: float, epsilon: float) -> float:
    """Root of the monic quartic in [low, high], where it goes from negative to not negative."""
    t = 0.5 * (low + high)
    for _ in range(200):
        value = _evaluate_quartic(t, beta, delta, epsilon)
        if value < 0.0:
            low = t
        else:
            high = t
        slope = (4.0 * t * t - 2.0 * beta) * t + delta
        step = t - value / slope if slope != 0.0 else low
        t_next = step if low < step < high else 0.5 * (low + high)
        if t_next in (low, high) or abs(t_next - t) <= 1e-16 * t:
            return t_next
        t = t_next
    return t


@compile_kernel
def _first_rise(beta: float, delta: float, epsilon: float) -> float:
    """Smallest positive root of t^4 - beta t^2 + delta t - epsilon; beta >= 0, epsilon > 0.

    The quartic starts at -epsilon. Its stationary points solve t^3 - (beta/2) t + delta/4 = 0; with three of
    them the middle one is a local maximum, and the first root lies before it unless the quartic is negative
    there.
    """
    low = 0.0
    third = beta / 6.0
    half = delta / 8.0
    if third**3 > half * half:
        radius = 2.0 * math.sqrt(third)
        angle = math.acos(max(-1.0, min(1.0, -half / (third * math.sqrt(third))))) / 3.0
        # angle is in [0, pi/3]: of the three this is the middle one, and the least is negative
        maximum = radius * math.cos(angle - 2.0 * math.pi / 3.0)
        if maximum > 0.0 and _evaluate_quartic(maximum, beta, delta, epsilon) >= 0.0:
            return _bracketed_root(0.0, maximum, beta, delta, epsilon)
        low = radius * math.cos(angle)
    high = 1.0 + math.sqrt(beta) + abs(delta) ** (1.0 / 3.0) + epsilon**0.25
    return _bracketed_root(low, high, beta, delta, epsilon)


@compile_kernel
def solve_time_to_go(
    position: Array,
    velocity: Array,
    target: Array,
    target_velocity: Array,
    fourth_power: float,
) -> float:
    """Smallest positive root of the quartic; `fourth_power` is the factor of t^4, W + |g|^2/2, above zero."""
    speed_term = 0.0
    closing_term = 0.0
    distance_term = 0.0
    for axis in range(3):
        v = velocity[axis]
        w = target_velocity[axis]
        miss = target[axis] - position[axis]
        speed_term += v * v + w * v + w * w
        closing_term += miss * (v + w)
        distance_term += miss * miss
    if distance_term == 0.0:
        return math.sqrt(2.0 * max(speed_term, 0.0) / fourth_power)
    scale = (18.0 * distance_term / fourth_power) ** 0.25
    beta = 2.0 * max(speed_term, 0.0) / (fourth_power * scale * scale)
    delta = 12.0 * closing_term / (fourth_power * scale**3)
    return scale * _first_rise(beta, delta, 1.0)


@compile_kernel
def zem_zev_into(
    state: Array,
    target: Array,
    gains: tuple[float, float],
    time_to_go: float,
    gravity: Array,
    out: Array,
) -> None:
    """Write the commanded thrust acceleration [m/s^2] for a landing at rest into `out` (3,).

    `gains` are `ZemZevGains`, or a plain (K_R, K_V).
    """
    position_gain, velocity_gain = gains
    for axis in range(3):
        v = state[3 + axis]
        g = gravity[axis]
        miss = target[axis] - state[axis] - v * time_to_go - 0.5 * g * time_to_go * time_to_go
        velocity_miss = -v - g * time_to_go
        out[axis] = (
            position_gain * miss / (time_to_go * time_to_go) - velocity_gain * velocity_miss / time_to_go
        )


def quartic_fourth_power(gravity: Array, time_weight: float | None) -> float:
    """Factor of t^4 in the time-to-go quartic, [m^2/s^4]: W + |g|^2/2, with None for the paper's W = |g|^2/2.

    Raises:
        ValueError: the factor is zero (no gravity and no weight: the optimal flight never ends), or W < 0.
    """
    half_square = 0.5 * float(gravity @ gravity)
    weight = half_square if time_weight is None else finite_number("time_weight", time_weight, at_least=0.0)
    if weight + half_square <= 0.0:
        raise ValueError("time_weight must be above zero where there is no gravity: no time to go is finite")
    return weight + half_square


def time_to_go(
    state: State,
    target: ArrayLike,
    gravity: ArrayLike = MOON_GRAVITY,
    target_velocity: ArrayLike = (0.0, 0.0, 0.0),
    time_weight: float | None = None,
) -> float:
    """Time to go for a ZEM/ZEV flight to `target`: smallest positive root of the paper's quartic.

    Args:
        state: present state; its mass does not matter.
        target: [m] shape (3,), site frame.
        gravity: [m/s^2] shape (3,).
        target_velocity: [m/s] shape (3,).
        time_weight: [m^2/s^4] W in the minimised integral of (|a|^2/2 + W). None is the paper's |g|^2/2; 0 is
            energy-optimal. The root falls at unit rate along an undisturbed 6/2 flight, and jumps to a later
            one where the two smaller of three positive roots meet and vanish.

    Returns:
        [s]; zero only at rest on the target.

    Raises:
        ValueError: an argument is not finite or of the wrong shape, or gravity and weight are both zero.
    """
    g = finite_vector("gravity", gravity, 3)
    return solve_time_to_go(
        state.position,
        state.velocity,
        finite_vector("target", target, 3),
        finite_vector("target_velocity", target_velocity, 3),
        quartic_fourth_power(g, time_weight),
    )


def zem_zev_acceleration(
    state: State,
    target: ArrayLike,
    time_to_go: float,
    gains: tuple[float, float] = ENERGY_OPTIMAL,
    gravity: ArrayLike = MOON_GRAVITY,
    target_velocity: ArrayLike = (0.0, 0.0, 0.0),
) -> Array:
    """Commanded thrust acceleration of ZEM/ZEV guidance to `target` (the module's first equation).

    Args:
        state: present state.
        target: [m] shape (3,).
        time_to_go: [s] above zero.
        gains: (K_R, K_V), as `ZemZevGains`; 6 and 2 minimise the integral of |a|^2/2.
        gravity: [m/s^2] shape (3,).
        target_velocity: [m/s] shape (3,), v_f; rest unless given.

    Returns:
        [m/s^2] shape (3,), unsaturated.

    Raises:
        ValueError: an argument is not finite or of the wrong shape, or the time to go is not positive.
    """
    chosen = ZemZevGains(*finite_vector("gains", gains, 2).tolist())
    time = finite_number("time_to_go", time_to_go, above=0.0)
    arrival = finite_vector("target_velocity", target_velocity, 3)
    out = np.empty(3)
    zem_zev_into(
        state.as_array(),
        finite_vector("target", target, 3),
        chosen,
        time,
        finite_vector("gravity", gravity, 3),
        out,
    )
    return out - chosen.velocity_gain / time * arrival  # the kernel knows no velocity at the target


def saturate_thrust(thrust: ArrayLike, lander: Lander) -> Array:
    """What the vehicle gives for a commanded thrust: the nearest that keeps its bounds and pointing limit.

    Within the pointing limit the direction is kept. A zero command to an engine that cannot stop
    (min_thrust > 0) points up.

    Args:
        thrust: [N] shape (3,).
        lander: the vehicle.

    Returns:
        [N] shape (3,).

    Raises:
        ValueError: `thrust` is not finite or of the wrong shape.
    """
    limited = finite_vector("thrust", thrust, 3)
    limit_into(limited, lander.min_thrust, lander.max_thrust, pointing_angle(lander))
    return limited
