"""A late change of landing point: deform the descent in flight instead of planning another.

In the last burn a fresh plan to a site a few metres off is often infeasible or long: the engine is near its
limit, and a state a little below the old plan cannot be stopped in the old time. But a sideways shift that
starts and ends at rest, added to the reference, keeps its time and its vertical motion, and costs little.
"""

from __future__ import annotations

import numpy as np

from guidance.arrays import Array
from guidance.lander import Lander
from guidance.tracking.reference import TrackingReference, make_reference
from guidance.validation import finite_vector

_UNFELT = 0.05
"""[m/s^2] beyond the pointing limit that the feedback makes up for: sampled, a coasting engine's thrust is
not quite nothing, and points anywhere."""


def shift_landing_point(reference: TrackingReference, site: Array, gravity: Array) -> TrackingReference:
    """Move the end of a descent to `site` by a quintic of least jerk with rest at both ends.

    The shift after the share s of the time is (10 s^3 - 15 s^4 + 6 s^5) of the whole; its greatest
    acceleration is 5.77 times the whole over the squared time.

    Args:
        reference: what is left of a descent.
        site: [m] shape (3,), new landing point.
        gravity: [m/s^2] shape (3,).

    Returns:
        The deformed descent, with the same duration.
    """
    offset = finite_vector("site", site, 3) - reference.position[-1]
    s = np.linspace(0.0, 1.0, reference.position.shape[0])[:, None]
    shifted = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    shift_rate = 30.0 * s**2 * (1.0 - s) ** 2 / reference.duration
    return make_reference(
        reference.position + shifted * offset,
        reference.velocity + shift_rate * offset,
        reference.control_period,
        finite_vector("gravity", gravity, 3),
    )


def velocity_change(reference: TrackingReference) -> float:
    """[m/s] that flying a reference asks of the engine."""
    return reference.control_period * float(np.linalg.norm(reference.thrust_acceleration, axis=1).sum())


def within_thrust(reference: TrackingReference, lander: Lander, mass: float, reserve: float) -> bool:
    """Whether a reference asks for no more than the greatest thrust less a share `reserve`, at most `mass`.

    Args:
        reference: what would be flown.
        lander: the vehicle.
        mass: [kg] at its start; it only falls afterwards.
        reserve: share of the thrust that is left to the feedback.
    """
    thrust = np.linalg.norm(reference.thrust_acceleration, axis=1) * mass
    return bool(thrust.max() <= (1.0 - reserve) * lander.max_thrust)


def within_pointing(reference: TrackingReference, lander: Lander, reserve: float) -> bool:
    """Whether a reference points no further from the vertical than the limit less a share `reserve`.

    Args:
        reference: what would be flown.
        lander: the vehicle; without a pointing limit every reference keeps it.
        reserve: share of the limit that is left to the feedback.
    """
    if lander.pointing_limit is None:
        return True
    limit = lander.pointing_limit * (1.0 - reserve)
    u = reference.thrust_acceleration
    size = np.linalg.norm(u, axis=1)
    beyond = np.arctan2(np.hypot(u[:, 0], u[:, 1]), u[:, 2]) - limit
    taken = size * np.sin(np.clip(beyond, 0.0, 0.5 * np.pi))  # distance from the nearest thrust within it
    return bool(taken.max() <= _UNFELT)
