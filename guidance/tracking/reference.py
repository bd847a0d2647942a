"""Flying a plan with thrust held over control periods: a sampled reference, and feedback about it.

The reference is sampled at the control instants. Over each period the feedforward is the mean thrust
acceleration that takes the reference's velocity from one instant to the next, so that a held thrust has its
velocity at each. The feedback is a discrete linear-quadratic regulator of the double integrator that
remains, the same on each axis:

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
    held = _fly_held(position[0], velocity[0], feedforward + gravity, control_period)
    left = control_period * (np.arange(len(feedforward), 0.0, -1.0) - 0.5)
    lever = (left - left.mean())[:, None]
    missing = position[-1] - held[0][-1]
    feedforward = feedforward + lever * missing / max(control_period * float((lever**2).sum()), 1e-12)
    flown = _fly_held(position[0], velocity[0], feedforward + gravity, control_period)
    return TrackingReference(control_period, *flown, feedforward)


def _fly_held(
    position: Array, velocity: Array, acceleration: Array, control_period: float
) -> tuple[Array, Array]:
    """States at the control instants under accelerations that are held between them."""
    speed = np.vstack([velocity, velocity + control_period * np.cumsum(acceleration, axis=0)])
    steps = 0.5 * control_period * (speed[1:] + speed[:-1])
    return np.vstack([position, position + np.cumsum(steps, axis=0)]), speed
