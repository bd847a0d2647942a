"""A flight on nodes: state and thrust in time, and what lies between the nodes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array, Index


@dataclass(frozen=True, eq=False)
class Trajectory:
    """States and thrusts on N nodes (N - 1 equal intervals), in SI and the site frame; or none.

    Between nodes the thrust *acceleration* is linear in time (first-order hold). Arrays are read-only.

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
        step = self.time[1]
        at = np.clip(t / step, 0.0, self.nodes - 1.0)
        k = np.minimum(at.astype(np.int64), self.nodes - 2)
        fraction = at - k
        mass = self._mass_between(k, fraction)
        weight = fraction[..., None]
        thrust = mass[..., None] * ((1.0 - weight) * self.acceleration[k] + weight * self.acceleration[k + 1])
        after = t > self.time[-1] * (1.0 + 1e-12)
        return np.where(after[..., None], 0.0, thrust)

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


def no_trajectory() -> Trajectory:
    """That of a plan without a flight."""
    vectors = np.empty((0, 3))
    return Trajectory(np.empty(0), vectors, vectors.copy(), np.empty(0), vectors.copy(), float("nan"))
