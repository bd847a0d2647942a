"""What a sensor that is fixed to a body will see of the landing site on its way there.

Such a sensor looks along the body, and the body along its thrust. A flight's looks come at set times; each
shows the less of the site's surroundings the farther the site is from the axis, and nothing where the two
fields of view, about the axis and about the site, no longer overlap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from guidance.validation import finite_number

_DETOURS = (0.0, -50.0, -25.0, -10.0, 10.0, 25.0, 50.0)  # [m] along the present course, halfway through
_BUMP = 64.0 * np.array(
    [0.0, 0.0, 0.0, 1.0, -3.0, 3.0, -1.0]
)  # (4 s (1 - s))^3: 1 halfway, smooth at the ends


@dataclass(frozen=True)
class LooksAhead:
    """The looks to come, and what one is worth.

    Attributes:
        interval: [s] between looks; the next comes so long after the plan is made.
        half_angle: [rad] half the sensor's field of view about the body's axis.
        least_time: [s] before the touchdown; a look with less time to go is of no use.
        price: [m/s] that a look which shows nothing may cost to avoid (chosen on tuning episodes).

    Raises:
        ValueError: a field is out of range.
    """

    interval: float
    half_angle: float
    least_time: float
    price: float = 10.0

    def __post_init__(self) -> None:
        """Refuse what means nothing."""
        finite_number("interval", self.interval, above=0.0)
        finite_number("half_angle", self.half_angle, above=0.0)
        finite_number("least_time", self.least_time, at_least=0.0)
        finite_number("price", self.price, at_least=0.0)


def bend_flights(coefficients: Array, course: Array) -> Array:
    """Each flight, and the same with detours: ahead of it or behind it halfway, with its own ends.

    Args:
        coefficients: of the powers 0 to 5 of the share of the time, shape (6, n, k, 3).
        course: shape (2,), horizontal direction of the detours, of any length; none where it is zero.

    Returns:
        Of the powers 0 to 6, shape (7, n, 7 k, 3).
    """
    length = float(np.hypot(*course))
    ahead = np.append(course / length if length > 0.0 else course, 0.0)
    detours = _BUMP[:, None, None] * np.array(_DETOURS)[:, None] * ahead
    _, durations, thrusts, axes = coefficients.shape
    straight = np.concatenate([coefficients, np.zeros((1, durations, thrusts, axes))])
    bent = straight[:, :, :, None, :] + detours[:, None, None]
    return bent.reshape(7, durations, thrusts * len(_DETOURS), axes)


def price_missed_looks(sight: Array, thrust: Array, time: Array, landing: float, looks: LooksAhead) -> Array:
    """[m/s] what the looks that miss the site cost each flight, shape (n, k).

    Args:
        sight: [m] shape (m, n, k, 3), from the site to the lander at m instants evenly over each flight.
        thrust: shape (m, n, k, 3), along the body's axis, of any size.
        time: [s] shape (n,), length of each flight.
        landing: [s] from the end of a flight to the touchdown.
        looks: which come, and what they are worth.
    """
    sizes = np.linalg.norm(sight, axis=-1) * np.linalg.norm(thrust, axis=-1)
    cosine = np.einsum("mnki,mnki->mnk", sight, thrust) / np.maximum(sizes, 1e-9)
    shown = np.clip(1.0 - np.arccos(np.clip(cosine, -1.0, 1.0)) / (2.0 * looks.half_angle), 0.0, 1.0)
    missed, flights, last = np.zeros(shown.shape[1:]), np.arange(time.size), sight.shape[0] - 1
    for number in range(1, int((float(time.max()) + landing) / looks.interval) + 1):
        at = number * looks.interval
        place = np.minimum(at / time, 1.0) * last
        before = np.minimum(place.astype(np.int64), last - 1)
        beyond = (place - before)[:, None]
        seen = (1.0 - beyond) * shown[before, flights] + beyond * shown[before + 1, flights]
        useful = at <= time + landing - looks.least_time
        missed += useful[:, None] * (1.0 - seen)
    return looks.price * missed
