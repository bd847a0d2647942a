"""What a plan leaves to the feedback for an engine that gives less, or more, than is commanded of it.

The relative error e of the thrust is bounded, |e| <= b, and constant between two looks. The feedback learns
it from the first control period of a burn; until then it must assume something.

At full command the thrust is (1 + e) T >= (1 - b) T. So every engine within the bound can fly a plan that
asks for no more than (1 - m) T with m >= b, once its error is known. What the first period of a burn lacks
must be made up for by the next. Where these have nothing to spare, in the midst of the last burn, the engine
is taken for a weak one until it is felt. Elsewhere it is taken as it is: an early thrust that turns out too
great costs propellant, and a weak one can be mended.
"""

from __future__ import annotations

import numpy as np

from guidance.tracking.reference import TrackingReference
from guidance.validation import finite_number

_GREATEST_MARGIN = 0.75
"""Share of the thrust beyond which no margin is widened: what is left must still carry the vehicle."""
_RECOVERY_PERIODS = 3
"""Control periods within which the feedback makes up for what the first one of a burn lacked."""
_LEAST_BURN = 0.05
"""[m/s^2] thrust acceleration below which a plan's engine is off."""


def bearing_margin(error_bound: float, least: float) -> float:
    """Share of the greatest thrust that a plan leaves out for an engine whose error is bounded.

    Args:
        error_bound: bound b of the relative error of the thrust.
        least: share that the feedback needs of any engine.

    Returns:
        The greater of the two, b at most 0.75.
    """
    return max(least, min(error_bound, _GREATEST_MARGIN))


def assumed_error(
    reference: TrackingReference, greatest: float, error_bound: float, margin: float, periods: int
) -> float:
    """Relative error of the thrust that the feedback assumes until a control period has told, from -b to 0.

    With e assumed to be h, an engine at -b lacks the share x = (b + h) / (1 + h) of what the first burning
    period asks for. h is the greatest for which the next three periods can give that on top of their own.
    Those of the three that lie beyond the next look count too. The engine's error is another one there and
    is not known in the first of them, so that a burn which begins that shortly before a look may get less.

    Args:
        reference: what is flown.
        greatest: [m/s^2] acceleration at the greatest thrust and the present mass.
        error_bound: bound b of the relative error of the thrust, below 1.
        margin: share of the greatest thrust that plans leave out; from 2 b / (1 + b) on the very next period
            makes up for everything, and nothing is assumed.
        periods: control periods to the next look, at which the engine's error may change.
    """
    bound = finite_number("error_bound", error_bound, at_least=0.0, at_most=0.9)
    if margin >= 2.0 * bound / (1.0 + bound):
        return 0.0
    asked = np.linalg.norm(reference.thrust_acceleration, axis=1)
    burning = np.flatnonzero(asked[:periods] > _LEAST_BURN)
    if burning.size == 0:
        return 0.0
    first = int(burning[0])
    following = asked[first + 1 : first + 1 + _RECOVERY_PERIODS]
    spare = float(np.maximum((1.0 - bound) * greatest - following, 0.0).sum())
    lacking = min(bound, spare / float(asked[first]))
    return (lacking - bound) / (1.0 - lacking)
