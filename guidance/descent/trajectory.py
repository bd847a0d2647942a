"""A flight on nodes: state and thrust in time, and what lies between the nodes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array, Index
from guidance.kernel import compile_kernel


@dataclass(frozen=True, eq=False)
class Trajectory:
    """States and thrusts on N nodes (N - 1 intervals), in SI and the site frame; or none.

    The intervals are equal, and between nodes the thrust *acceleration* is linear in time (first-order hold);
    a kind of flight whose thrust between nodes is known otherwise says so. Arrays are read-only.

    Attributes:
        time: [s] shape (N,), from 0.
        position: [m] shape (N, 3).
        velocity: [m/s] shape (N, 3).
        mass: [kg] shape (N,).
        thrust: [N] shape (N, 3).
        exhaust_velocity: [m/s] of the engine that burns it.
    """

    time: Array
    position: Array
    velocity: Array
    mass: Array
    thrust: Array
    exhaust_velocity: float

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("time", "position", "velocity", "mass", "thrust"):
            getattr(self, name).flags.writeable = False

    @property
    def nodes(self) -> int:
        """N; zero without a flight."""
        return int(self.time.size)

    @property
    def duration(self) -> float:
        """[s] from the first node to the last; nan without a flight."""
        return float(self.time[-1]) if self.time.size else float("nan")

    def thrust_at(self, time: ArrayLike) -> Array:
        """Thrust; before the start that of the start, after the end none (engine cut-off).

        Args:
            time: [s] since the start; a number, or shape (k,).

        Returns:
            [N] shape (3,), or (k, 3).

        Raises:
            ValueError: there is no flight.
        """
        if self.nodes == 0:
            raise ValueError("an empty trajectory has no thrust")
        t = np.asarray(time, dtype=np.float64)
        after = t > self.time[-1] * (1.0 + 1e-12)
        return np.where(after[..., None], 0.0, self._thrust_within(np.clip(t, 0.0, self.time[-1])))

    def states_at(self, time: Array, gravity: Array) -> tuple[Array, Array]:
        """Position and velocity, exact for the thrust acceleration between nodes.

        Args:
            time: [s] shape (k,), from 0 to the end.
            gravity: [m/s^2] shape (3,).

        Returns:
            Position [m] and velocity [m/s], shape (k, 3) each.
        """
        step = self.time[1]
        k = np.clip((time / step).astype(np.int64), 0, self.nodes - 2)
        s = (time - k * step)[:, None]
        now = self.acceleration[k] + gravity
        rise = (self.acceleration[k + 1] - self.acceleration[k]) / step
        position = self.position[k] + self.velocity[k] * s + now * s**2 / 2.0 + rise * s**3 / 6.0
        velocity = self.velocity[k] + now * s + rise * s**2 / 2.0
        return position, velocity

    def mass_at(self, time: Array) -> Array:
        """Mass, exact for the hold where the thrust keeps its direction.

        Args:
            time: [s] shape (k,), from 0 to the end.

        Returns:
            [kg] shape (k,).
        """
        k, fraction = self._place(np.asarray(time, dtype=np.float64))
        return self._mass_between(k, fraction)

    def sample_thrust(self, parts: int) -> Array:
        """Thrust at the ends of equal parts of each interval, from within it where the thrust jumps.

        Args:
            parts: of each interval.

        Returns:
            [N] shape (N - 1, parts + 1, 3).
        """
        out = np.empty((self.nodes - 1, parts + 1, 3))
        _sample_held(float(self.time[1]), self.mass, self.acceleration, self.exhaust_velocity, out)
        return out

    def _thrust_within(self, time: Array) -> Array:
        """[N] thrust at times between the start and the end, shape (..., 3)."""
        k, fraction = self._place(time)
        mass = self._mass_between(k, fraction)
        weight = fraction[..., None]
        return mass[..., None] * ((1.0 - weight) * self.acceleration[k] + weight * self.acceleration[k + 1])

    def _place(self, time: Array) -> tuple[Index, Array]:
        """Interval of each time, and the share of it that has passed."""
        at = np.clip(time / self.time[1], 0.0, self.nodes - 1.0)
        k = np.minimum(at.astype(np.int64), self.nodes - 2)
        return k, at - k

    @cached_property
    def acceleration(self) -> Array:
        """[m/s^2] of the thrust at the nodes, shape (N, 3)."""
        return self.thrust / self.mass[:, None]

    @cached_property
    def _flow(self) -> Array:
        """[1/s] share of the mass burnt per second at each node."""
        return np.linalg.norm(self.acceleration, axis=1) / self.exhaust_velocity

    def _mass_between(self, k: Index, fraction: Array) -> Array:
        """Mass in interval k: its logarithm is quadratic where the magnitude of acceleration is linear."""
        bend = 0.5 * self.time[1] * (self._flow[k + 1] - self._flow[k]) * fraction * (1.0 - fraction)
        return self.mass[k] * (self.mass[k + 1] / self.mass[k]) ** fraction * np.exp(bend)


@compile_kernel
def _sample_held(step: float, mass: Array, acceleration: Array, exhaust_velocity: float, out: Array) -> None:
    """Write the thrust of a first-order hold to `out`, shape (N - 1, parts + 1, 3)."""
    parts = out.shape[1] - 1
    flow = np.empty(mass.size)
    for k in range(mass.size):
        x, y, z = acceleration[k, 0], acceleration[k, 1], acceleration[k, 2]
        flow[k] = math.sqrt(x * x + y * y + z * z) / exhaust_velocity
    for k in range(mass.size - 1):
        slope = math.log(mass[k + 1] / mass[k])
        bend = 0.5 * step * (flow[k + 1] - flow[k])
        for part in range(parts + 1):
            fraction = part / parts
            planned = mass[k] * math.exp(fraction * (slope + bend * (1.0 - fraction)))
            for axis in range(3):
                rise = acceleration[k + 1, axis] - acceleration[k, axis]
                out[k, part, axis] = planned * (acceleration[k, axis] + fraction * rise)


def no_trajectory() -> Trajectory:
    """That of a plan without a flight."""
    vectors = np.empty((0, 3))
    return Trajectory(np.empty(0), vectors, vectors.copy(), np.empty(0), vectors.copy(), float("nan"))
