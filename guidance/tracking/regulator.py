"""The feedback about a tracked reference: the gains of a discrete linear-quadratic regulator."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from guidance.validation import finite_number


@dataclass(frozen=True)
class TrackingWeights:
    """Errors that the regulator counts as equally bad (Bryson's rule).

    Attributes:
        position: [m].
        velocity: [m/s].
        acceleration: [m/s^2] of correction.
    """

    position: float = 0.2
    velocity: float = 0.2
    acceleration: float = 1.0

    def __post_init__(self) -> None:
        """Refuse weights that mean nothing."""
        for name in ("position", "velocity", "acceleration"):
            finite_number(name, getattr(self, name), above=0.0)


DEFAULT_WEIGHTS = TrackingWeights()


class TrackingGains(NamedTuple):
    """Gains of the feedback about a reference: position_gain is K_r [1/s^2], velocity_gain K_v [1/s]."""

    position_gain: float
    velocity_gain: float


@lru_cache(maxsize=32)
def tracking_gains(control_period: float, weights: TrackingWeights) -> TrackingGains:
    """Gains of the discrete regulator of a double integrator with held input.

    Args:
        control_period: [s] above zero.
        weights: the regulator's weights.
    """
    from scipy.linalg import solve, solve_discrete_are  # python-control's `dlqr` gives the same bits, in 2 s

    h = finite_number("control_period", control_period, above=0.0)
    motion = np.array([[1.0, h], [0.0, 1.0]])
    held_input = np.array([[0.5 * h * h], [h]])
    state_cost = np.diag([weights.position**-2, weights.velocity**-2])
    input_cost = np.array([[weights.acceleration**-2]])
    cost_to_go = solve_discrete_are(motion, held_input, state_cost, input_cost)
    gain = solve(held_input.T @ cost_to_go @ held_input + input_cost, held_input.T @ cost_to_go @ motion)
    return TrackingGains(float(gain[0, 0]), float(gain[0, 1]))
