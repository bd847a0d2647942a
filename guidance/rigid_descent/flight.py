"""A flight of a rigid body on its nodes, and the commands that fly it."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from guidance.arrays import Array


@dataclass(frozen=True, eq=False)
class RigidFlight:
    """Motion and controls on N nodes; thrust and torque are linear in time between them.

    Attributes:
        time: [s] shape (N,), from 0, increasing.
        position: [m] shape (N, 3), site frame.
        velocity: [m/s] shape (N, 3), site frame.
        attitude: quaternions, scalar first, shape (N, 4).
        rates: [rad/s] shape (N, 3), body frame.
        mass: [kg] shape (N,).
        thrust: [N] shape (N, 3), body frame: what the engine gives.
        torque: [N m] shape (N, 3), body frame: couple of the reaction control.
    """

    time: Array
    position: Array
    velocity: Array
    attitude: Array
    rates: Array
    mass: Array
    thrust: Array
    torque: Array

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for each in fields(self):
            array = np.array(getattr(self, each.name), dtype=np.float64)
            array.flags.writeable = False
            object.__setattr__(self, each.name, array)

    @property
    def nodes(self) -> int:
        """N."""
        return self.time.size

    @property
    def states(self) -> Array:
        """Shape (N, 14): position, velocity, attitude, rates, mass."""
        return np.column_stack([self.position, self.velocity, self.attitude, self.rates, self.mass])

    def thrust_commands(self, lag: float) -> Array:
        """[N] shape (N - 1, 2, 3): what to command at both ends of each interval for the planned thrust.

        An engine of time constant `lag` [s] gives F where F + lag F' is commanded.
        """
        ends = np.stack([self.thrust[:-1], self.thrust[1:]], axis=1)
        change = np.diff(self.thrust, axis=0) / np.diff(self.time)[:, None]
        return ends + lag * change[:, None, :]

    def torque_commands(self) -> Array:
        """[N m] shape (N - 1, 2, 3): at both ends of each interval."""
        return np.stack([self.torque[:-1], self.torque[1:]], axis=1)


def no_flight() -> RigidFlight:
    """A flight without nodes."""
    empty = np.empty((0, 3))
    return RigidFlight(np.empty(0), empty, empty, np.empty((0, 4)), empty, np.empty(0), empty, empty)
