"""Flying a plan with thrust held over control periods: a sampled reference, and feedback about it.

The reference is sampled at the control instants. Over each period the feedforward is the mean thrust
acceleration that takes the reference's velocity from one instant to the next, so that a held thrust has its
velocity at each; a plan's flight is first made one that held thrusts fly, so that it has its position too.
The feedback is a discrete linear-quadratic regulator of the double integrator that remains, the same on each
axis:

    u_k = a_k - K_r (r - r_k) - K_v (v - v_k),    thrust = m u_k / (1 + e),

with e the engine's present error ratio, estimated from the last period's change of velocity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array


@dataclass(frozen=True, eq=False)
class TrackingReference:
    """A descent at the control instants. n nodes have n - 1 control periods.

    Attributes:
        control_period: [s] time between nodes.
        position: [m] shape (n, 3).
        velocity: [m/s] shape (n, 3).
        thrust_acceleration: [m/s^2] shape (n - 1, 3), mean over each period.
    """

    control_period: float
    position: Array
    velocity: Array
    thrust_acceleration: Array

    def __post_init__(self) -> None:
        """Check that the parts belong together, and freeze them."""
        nodes = self.position.shape[0]
        shapes = {"position": (nodes, 3), "velocity": (nodes, 3), "thrust_acceleration": (nodes - 1, 3)}
        for name, shape in shapes.items():
            part = getattr(self, name)
            if part.shape != shape or nodes < 2:
                raise ValueError(f"{name} must have shape {shape} with at least 2 nodes, got {part.shape}")
            part.flags.writeable = False

    @property
    def duration(self) -> float:
        """[s] from the first node to the last."""
        return self.control_period * self.thrust_acceleration.shape[0]

    def after(self, periods: int) -> TrackingReference | None:
        """What is left after a number of control periods; None where nothing is."""
        if periods >= self.thrust_acceleration.shape[0]:
            return None
        return TrackingReference(
            self.control_period,
            self.position[periods:].copy(),
            self.velocity[periods:].copy(),
            self.thrust_acceleration[periods:].copy(),
        )


def hold_thrust(
    position: Array, velocity: Array, control_period: float, gravity: Array
) -> tuple[Array, Array]:
    """What thrusts held over control periods make of a flight that is known at the control instants.

    Held over a period in which the engine switches, the mean thrust leads to the flight's velocity but not to
    its position. Each held thrust is the mean of its period and a correction, the least that leads to the
    flight's end (squares weighted by one over the squared mean: an engine that is off stays off).

    Args:
        position: [m] shape (n, 3).
        velocity: [m/s] shape (n, 3).
        control_period: [s] between nodes.
        gravity: [m/s^2] shape (3,).

    Returns:
        Position [m] and velocity [m/s] at the control instants, shape (n, 3) each; as they came where less
        than two periods have thrust.
    """
    mean = np.diff(velocity, axis=0) / control_period
    weight = ((mean - gravity) ** 2).sum(axis=1)
    left = control_period * (np.arange(len(mean), 0.0, -1.0) - 0.5)
    lever = left - float(weight @ left) / max(float(weight.sum()), 1e-12)
    gain = control_period * float(weight @ lever**2)
    if gain < 1e-6 * control_period * float(weight.sum()) * control_period**2:
        return position, velocity
    flown, _ = _fly_held(position[0], velocity[0], mean, control_period)
    missing = position[-1] - flown[-1]
    return _fly_held(
        position[0], velocity[0], mean + (weight * lever)[:, None] * (missing / gain), control_period
    )


def _fly_held(
    position: Array, velocity: Array, acceleration: Array, control_period: float
) -> tuple[Array, Array]:
    """States at the control instants under accelerations that are held between them."""
    speed = np.vstack([velocity, velocity + control_period * np.cumsum(acceleration, axis=0)])
    steps = 0.5 * control_period * (speed[1:] + speed[:-1])
    return np.vstack([position, position + np.cumsum(steps, axis=0)]), speed


def make_reference(
    position: Array, velocity: Array, control_period: float, gravity: Array
) -> TrackingReference:
    """Reference through states at the control instants, with the mean thrust acceleration of each period.

    Args:
        position: [m] shape (n, 3).
        velocity: [m/s] shape (n, 3).
        control_period: [s] between nodes.
        gravity: [m/s^2] shape (3,).
    """
    feedforward = np.diff(velocity, axis=0) / control_period - gravity
    return TrackingReference(control_period, position, velocity, feedforward)
