"""Where a rigid body points: along its thrust, ahead of a plan, and upright in time for the touchdown."""

from __future__ import annotations

import math

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from guidance.rigid_body.motion import turning_acceleration
from guidance.zem_zev import ZemZevGains
from hda.flight.rigid.turning import Turning

_RIGHTING_SHARE = 0.6  # of the torque that the body is righted with before the touchdown
_LEAST_LIFT = 1.0  # [m/s^2] upward, against which a sideways correction is weighed at least
_STEEPEST = 1.5  # [rad]
_LEAN = math.radians(10.0)
_LOOP_TIMES = 4.5  # over the loop's natural frequency: until it has turned all but some percent
_UPRIGHT_SHARE = 0.65  # of the leaning time: so long before the touchdown a body has arrived by ZEM/ZEV
_LEAST_SHARE = 2.0  # of the leaning time: for so long at least its gains are worked out
_LEAST_BURN = 0.3  # [m/s^2] thrust acceleration below which a plan coasts


@compile_kernel
def righting_tilt(turning: Turning, remaining: float) -> float:
    """[rad] from which the body can be righted, and stopped, in a time: a t^2/4, as of two equal torques.

    Args:
        turning: the body.
        remaining: [s].
    """
    acceleration = _RIGHTING_SHARE * turning_acceleration(turning.state[13], turning.body)
    return 0.25 * acceleration * max(remaining, 0.0) ** 2


@compile_kernel
def leaning_time(turning: Turning) -> float:
    """[s] that the body takes to lean by some degrees: what torques allow, or the loop where it is slower."""
    fastest = 2.0 * math.sqrt(_LEAN / turning_acceleration(turning.state[13], turning.body))
    return max(fastest, _LOOP_TIMES / turning.loop.natural_frequency)


@compile_kernel
def steer_across(
    turning: Turning | None, seen: Array, site: Array, gains: ZemZevGains, remaining: float, out: Array
) -> None:
    """ZEM/ZEV of a body across the vertical: it has arrived before the touchdown, and stands upright there.

    Args:
        turning: the body; None for a point mass, whose acceleration stays as it is.
        seen: estimated state, shape (7,).
        site: [m] shape (3,).
        gains: K_R and K_V.
        remaining: [s] to the touchdown.
        out: [m/s^2] shape (3,), thrust acceleration; its horizontal components are written.
    """
    if turning is None:
        return
    lean = leaning_time(turning)
    left = max(remaining - _UPRIGHT_SHARE * lean, _LEAST_SHARE * lean)
    for axis in range(2):
        speed = seen[3 + axis]
        miss = site[axis] - seen[axis] - speed * left
        out[axis] = gains.position_gain * miss / (left * left) + gains.velocity_gain * speed / left


@compile_kernel
def aim_along(turning: Turning | None, commanded: Array, remaining: float) -> None:
    """Lean a body along its thrust, no further than the time to go allows to right it.

    Args:
        turning: the body; None for a point mass.
        commanded: [N] shape (3,), site frame; what is too much of it across the vertical is taken away.
        remaining: [s] to the touchdown.
    """
    if turning is None:
        return
    _keep_upright(turning, commanded, remaining)
    for axis in range(3):
        turning.aim[axis] = commanded[axis]


@compile_kernel
def _keep_upright(turning: Turning, vector: Array, remaining: float) -> None:
    """Shorten what a vector has across the vertical to the tilt from which the body can still be righted."""
    limit = min(righting_tilt(turning, remaining), turning.body.tilt_limit)
    across = math.sqrt(vector[0] ** 2 + vector[1] ** 2)
    most = math.tan(min(limit, _STEEPEST)) * max(vector[2], turning.state[13] * _LEAST_LIFT)
    if across > most:
        vector[0] *= most / across
        vector[1] *= most / across


@compile_kernel
def aim_ahead(
    turning: Turning | None, commanded: Array, planned: Array, node: int, period: float, estimate: float
) -> None:
    """Point a body along the thrust that its plan will have by the time that it has turned.

    While the plan coasts the body turns to the burn that follows.

    Args:
        turning: the body; None for a point mass.
        commanded: [N] shape (3,), site frame: what plan and feedback ask for now, before any limit. How much
            of it is upward is the throttle's business.
        planned: [m/s^2] shape (n, 3), thrust acceleration of the plan in its periods.
        node: number of the present period.
        period: [s].
        estimate: error ratio of the engine that `commanded` makes up for; where the body points it is no
            matter.
    """
    if turning is None:
        return
    mass, last = turning.state[13], planned.shape[0] - 1
    ahead = node + turning.lead / period
    first = min(int(ahead), last)
    while first < last and _size(planned[first]) < _LEAST_BURN:
        first += 1
    second = min(first + 1, last)
    share = min(max(ahead - first, 0.0), 1.0)
    for axis in range(2):
        then = (1.0 - share) * planned[first, axis] + share * planned[second, axis]
        turning.aim[axis] = commanded[axis] * (1.0 + estimate) + mass * (then - planned[node, axis])
    upward = (1.0 - share) * planned[first, 2] + share * planned[second, 2]
    turning.aim[2] = mass * max(upward, _LEAST_LIFT)
    _keep_upright(turning, turning.aim, (planned.shape[0] - node) * period)


@compile_kernel
def _size(vector: Array) -> float:
    return math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
