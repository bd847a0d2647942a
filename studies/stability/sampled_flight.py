"""The ZEM/ZEV loop with its time to go counting down: exact solutions, and the sampled flight.

In t_go, which falls at unit rate, e'' = -(K_R/t_go^2) e - ((K_R - K_V)/t_go) e' + (1 - K_R/2 + K_V) g is
solved by e = g t_go^2/2 (free fall to rest, no thrust) plus powers t_go^n,

    n^2 - (1 + K_R - K_V) n + K_R = 0.

Speed falls as t_go^(Re n - 1) and thrust as t_go^(Re n - 2): the speed vanishes if every Re n > 1, thrust
stays bounded if every Re n >= 2. At n = 1 the left side is K_V > 0 and both roots lie above it if
K_R - K_V > 1; both have a real part of at least 2 if K_V + 3 <= K_R <= 2 K_V + 2.

Held over each period h, the same command moves (e, e') by [1 h; 0 1] and [h^2/2; h] times the acceleration.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from guidance.arrays import Array
from guidance.validation import finite_number
from studies.stability.held_loop import Gains


def flight_powers(gains: Gains) -> NDArray[np.complex128]:
    """Powers n of the time to go in the exact solutions, shape (2,), the least real part first."""
    middle = 0.5 * (1.0 + gains.damping)
    root = np.sqrt(complex(middle**2 - gains.position))
    if root.imag != 0.0:
        return np.array([middle - root, middle + root])
    # the product of the roots is K_R: no cancellation in the smaller
    return np.array([gains.position / (middle + root), middle + root])


def speed_vanishes(gains: Gains) -> bool:
    """Whether the continuous flight ends at rest whatever its start."""
    return bool(flight_powers(gains)[0].real > 1.0)


def thrust_bounded(gains: Gains) -> bool:
    """Whether the continuous flight's thrust stays bounded whatever its start."""
    return bool(flight_powers(gains)[0].real >= 2.0 - 1e-12)


@dataclass(frozen=True)
class Clock:
    """How the time to go runs down in a sampled flight.

    The command at t_go = (phase + periods - 1 - k) * period, k = 0 ... periods - 1, is held for one period;
    the engine is cut off once half a period or less is left.

    Attributes:
        period: [s] over which a thrust is held.
        periods: commands in the flight.
        phase: time to go at the last command over the period, in (0.5, 1.5]; a number, or shape (flights,)
            for as many flights at once.
        frozen_below: [s] the gains are those of this time to go once less is left; 0 freezes nothing.

    Raises:
        ValueError: an attribute is out of range.
    """

    period: float
    periods: int
    phase: ArrayLike
    frozen_below: float = 0.0

    def __post_init__(self) -> None:
        """Check every field."""
        finite_number("period", self.period, above=0.0)
        finite_number("periods", self.periods, at_least=1)
        phase = np.array(self.phase, dtype=np.float64)
        if not np.all((phase > 0.5) & (phase <= 1.5)):
            raise ValueError(f"phase must be above 0.5 and at most 1.5, got {self.phase!r}")
        finite_number("frozen_below", self.frozen_below, at_least=0.0)

    @classmethod
    def of(cls, time_to_go: float, period: float, frozen_below: float = 0.0) -> Clock:
        """The clock of a flight that starts with `time_to_go` [s], more than half a period."""
        finite_number("time_to_go", time_to_go, above=0.5 * period)
        periods = int(np.ceil(time_to_go / period - 0.5))
        return cls(period, periods, time_to_go / period - periods + 1.0, frozen_below)

    @property
    def times_to_go(self) -> Array:
        """[s] at each command, shape (periods,), or (periods, flights)."""
        phase = np.asarray(self.phase, dtype=np.float64)
        later = np.arange(self.periods - 1.0, -1.0, -1.0)
        return self.period * np.add.outer(later, phase)


@dataclass(frozen=True, eq=False)
class SampledFlight:
    """A sampled flight up to cut-off; thrust unsaturated, mass constant over each period.

    Where the clock holds several phases, an axis of flights follows the first.

    Attributes:
        position: [m] shape (periods + 1, axes), relative to the target.
        velocity: [m/s] shape (periods + 1, axes).
        acceleration: [m/s^2] shape (periods, axes), commanded thrust over mass.
    """

    position: Array
    velocity: Array
    acceleration: Array


def fly_sampled(
    gains: Gains, clock: Clock, position: ArrayLike, velocity: ArrayLike, gravity: ArrayLike
) -> SampledFlight:
    """Fly from `position` [m] relative to the target, `velocity` [m/s] under `gravity` [m/s^2], each (axes,).

    The equations are linear: with no gravity they carry a small deviation from any flight that saturates
    nothing.
    """
    h = clock.period
    times = np.maximum(clock.times_to_go, clock.frozen_below)[..., None]
    start = (np.array(value, dtype=np.float64, ndmin=1) for value in (position, velocity, gravity))
    r, v, g = (np.broadcast_to(value, (*times.shape[1:-1], value.size)) for value in start)
    positions, velocities, accelerations = [r], [v], []
    for time_to_go in times:
        a = -gains.position / time_to_go**2 * r - gains.damping / time_to_go * v
        a = a - (0.5 * gains.position - gains.velocity) * g
        r = r + h * v + 0.5 * h**2 * (a + g)
        v = v + h * (a + g)
        positions.append(r)
        velocities.append(v)
        accelerations.append(a)
    return SampledFlight(np.array(positions), np.array(velocities), np.array(accelerations))


def touch_down(flight: SampledFlight, period: float, gravity: ArrayLike) -> tuple[Array, Array]:
    """First crossing of the target's plane; after cut-off in free fall.

    Args:
        flight: axes x, y, z; starts above the plane.
        period: [s] over which thrust was held.
        gravity: [m/s^2] shape (3,), pointing down.

    Returns:
        Speed [m/s] and time since the start [s], each of shape (), or one for each flight.
    """
    free_fall = np.asarray(gravity, dtype=np.float64)
    held = np.diff(flight.velocity, axis=0) / period
    acceleration = np.concatenate([held, np.broadcast_to(free_fall, (1, *held.shape[1:]))])
    longest = np.full(flight.position.shape[:-1], period)
    longest[-1] = np.inf
    height, rise, upward = flight.position[..., 2], flight.velocity[..., 2], acceleration[..., 2]
    square = rise**2 - 2.0 * upward * height
    closing = np.sqrt(np.maximum(square, 0.0)) - rise
    crossing = np.divide(2.0 * height, closing, out=np.full_like(closing, np.inf), where=closing > 0.0)
    crosses = (square >= 0.0) & (crossing <= longest) & np.isfinite(crossing)
    first = crosses.argmax(axis=0)[None]
    time = np.take_along_axis(crossing, first, axis=0)
    velocity = np.take_along_axis(flight.velocity, first[..., None], axis=0)
    velocity = velocity + np.take_along_axis(acceleration, first[..., None], axis=0) * time[..., None]
    return np.linalg.norm(velocity[0], axis=-1), (first * period + time)[0]


@dataclass(frozen=True)
class Growth:
    """What is left at cut-off of a velocity error of 1 m/s, and what it cost.

    Attributes:
        position: [m] error at cut-off.
        velocity: [m/s] error at cut-off.
        thrust: largest correcting acceleration over the first one.
    """

    position: float
    velocity: float
    thrust: float


def error_growth(gains: Gains, clock: Clock) -> Growth:
    """Fly a velocity error of 1 m/s from the clock's first command to cut-off; worst of the phases."""
    flight = fly_sampled(gains, clock, 0.0, 1.0, 0.0)
    correction = np.abs(flight.acceleration)
    return Growth(
        float(np.abs(flight.position[-1]).max()),
        float(np.abs(flight.velocity[-1]).max()),
        float((correction.max(axis=0) / correction[0]).max()),
    )
