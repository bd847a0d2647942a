"""The nearest thrust that a vehicle can give: its bounds of magnitude and its pointing limit.

The admissible thrusts are those with least <= |T| <= greatest, no further than the limit from the vertical.
For a command at the angle A from the vertical the nearest of them stands at the angle B = min(A, limit),
whatever its size, in the same vertical plane; of that direction the nearest size is |T| cos(A - B), brought
into the bounds. This holds for limits beyond a right angle too, where the set is not convex.
"""

from __future__ import annotations

import math

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from guidance.lander import Lander

_ROUNDING = 1e-12  # [rad] beyond the limit that a command on it may stand by rounding


@compile_kernel
def saturate_into(thrust: Array, min_thrust: float, max_thrust: float) -> None:
    """Bring |thrust| into [min_thrust, max_thrust] in place, direction kept; a zero vector points up."""
    largest = max(abs(thrust[0]), abs(thrust[1]), abs(thrust[2]))
    if largest == 0.0:
        thrust[2] = min_thrust
        return
    # relative to the largest component nothing overflows, however large the command
    relative = math.sqrt((thrust[0] / largest) ** 2 + (thrust[1] / largest) ** 2 + (thrust[2] / largest) ** 2)
    magnitude = largest * relative
    if magnitude > max_thrust:
        for axis in range(3):
            thrust[axis] = thrust[axis] / largest * (max_thrust / relative)
    elif magnitude < min_thrust:
        for axis in range(3):
            thrust[axis] = thrust[axis] / largest * (min_thrust / relative)


@compile_kernel
def limit_into(thrust: Array, min_thrust: float, max_thrust: float, pointing_limit: float) -> bool:
    """Replace a thrust by the nearest admissible one; say whether the pointing limit acted.

    A zero vector points up. A command straight down has a ring of nearest thrusts; the eastern one is taken.
    """
    largest = max(abs(thrust[0]), abs(thrust[1]), abs(thrust[2]))
    if pointing_limit >= math.pi or largest == 0.0:
        saturate_into(thrust, min_thrust, max_thrust)
        return False
    # relative to the largest component nothing overflows, however large the command
    east, north, up = thrust[0] / largest, thrust[1] / largest, thrust[2] / largest
    across = math.sqrt(east * east + north * north)
    sine, cosine = math.sin(pointing_limit), math.cos(pointing_limit)
    beyond = across * cosine - up * sine
    along = across * sine + up * cosine
    if beyond <= 0.0 or (along > 0.0 and beyond <= _ROUNDING * along):
        saturate_into(thrust, min_thrust, max_thrust)
        return False
    size = min(max(largest * max(along, 0.0), min_thrust), max_thrust)
    thrust[0] = size * sine * (east / across if across > 0.0 else 1.0)
    thrust[1] = size * sine * (north / across if across > 0.0 else 0.0)
    thrust[2] = size * cosine
    return True


def pointing_angle(lander: Lander) -> float:
    """[rad] the lander's pointing limit; pi, which no thrust exceeds, where it has none."""
    return math.pi if lander.pointing_limit is None else lander.pointing_limit
