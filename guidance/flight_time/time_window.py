"""Closed-form bounds on the time of flight of a landing, and a first guess of the best one."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from guidance.arrays import Array
from guidance.descent.problem import ROUNDING, LandingProblem
from guidance.flight_time.ground_contact import GroundContact, find_ground_contact


@dataclass(frozen=True)
class TimeWindow:
    """Times outside [low, high] admit no flight, by closed-form bounds.

    Attributes:
        low: [s].
        high: [s]; below `low` if no time is admitted.
        cause: the limit that closes the window, in words; empty if it is open.
    """

    low: float
    high: float
    cause: str = ""

    @property
    def empty(self) -> bool:
        """Whether no time is admitted."""
        return self.high < self.low

    def grid(self) -> Array:
        """Times from end to end in geometric progression: 6 % apart, at least 4 and at most 24."""
        count = math.ceil(math.log(self.high / self.low) / math.log(1.06)) + 1
        return np.geomspace(self.low, self.high, min(max(count, 4), 24))


_NO_TIME = TimeWindow(math.inf, -math.inf)


def _square(*coefficients: Array) -> Array:
    """Coefficients (rising powers) of |sum_k c_k T^k|^2."""
    total = np.zeros(2 * len(coefficients) - 1)
    for i, first in enumerate(coefficients):
        for j, second in enumerate(coefficients):
            total[i + j] += float(np.dot(first, second))
    return total


def _necessary(problem: LandingProblem, free_landing_point: bool) -> dict[str, list[Array]]:
    """Polynomials in T (rising powers) that are >= 0 at every feasible time, by the limit they stem from.

    With the thrust acceleration u and the velocity w at the target: int u = w - v - g T, int (T-t) u = R -
    v T - g T^2/2, int t u = w T - R - g T^2/2, while |u| <= max_thrust/dry_mass and int |u| <=
    exhaust_velocity ln(m/m_dry).
    """
    thrust_acceleration = problem.lander.max_thrust / problem.lander.dry_mass
    supply = problem.lander.exhaust_velocity * problem.log_mass_ratio
    only = slice(2, 3) if free_landing_point else slice(0, 3)
    v, w, g, miss = problem.state.velocity, problem.target_velocity, problem.gravity, -problem.offset
    speed = _square(v - w, g)
    first = _square(miss[only], -v[only], -0.5 * g[only])
    second = _square(miss[only], -w[only], 0.5 * g[only])
    zero = np.zeros(5)
    out: dict[str, list[Array]] = {"maximum thrust": [], "propellant": []}
    for vector, power in ((speed, 1), (first, 2), (second, 2)):
        thrust, propellant = zero.copy(), zero.copy()
        thrust[: vector.size] -= vector
        propellant[: vector.size] -= vector
        thrust[2 * power] += (thrust_acceleration / power) ** 2
        propellant[2 * power - 2] += supply**2
        out["maximum thrust"].append(thrust)
        out["propellant"].append(propellant)
    return out


def _hull(polynomials: list[Array], low: float, high: float) -> TimeWindow:
    """From the first to the last time in [low, high] at which all polynomials are >= 0."""
    if high <= low:
        return _NO_TIME
    marks = [low, high]
    for polynomial in polynomials:
        roots = np.roots(polynomial[::-1])
        real = roots.real[np.abs(roots.imag) < 1e-7 * (1.0 + np.abs(roots.real))]
        marks += [float(t) for t in real if low < t < high]
    edges = np.unique(np.array(marks))
    middle = 0.5 * (edges[1:] + edges[:-1])
    powers = middle[:, None] ** np.arange(5)
    good = np.flatnonzero((powers @ np.array(polynomials).T >= 0.0).all(axis=1))
    if good.size == 0:
        return _NO_TIME
    return TimeWindow(float(edges[good[0]]), float(edges[good[-1] + 1]))


def _broken_at_ends(problem: LandingProblem, free_landing_point: bool, contact: GroundContact | None) -> str:
    """The limit that start and target velocity break by themselves, by more than rounding; empty if none."""
    limit, w, still = problem.speed_bound, problem.target_velocity, problem.speed_rounding
    speed = max(float(np.linalg.norm(problem.state.velocity)), float(np.linalg.norm(w)))
    if limit is not None and speed > limit:
        return "speed"
    if w[2] > still:  # it comes from below
        return "altitude"
    outside = 0.0 if free_landing_point else problem.outside_glide_slope(problem.offset)
    distance = float(np.linalg.norm(problem.offset))
    if outside > ROUNDING * max(1.0, distance) or problem.outside_glide_slope(-w) > still:
        return "glide slope"
    sight = problem.limits.line_of_sight
    if sight is not None:
        leaves = not free_landing_point and sight.outside(-w) > still
        if leaves or sight.outside(problem.offset) > ROUNDING * max(1.0, distance):
            return "line of sight"
    if contact is None or contact.sink <= -float(w[2]):
        return ""
    return _too_fast(problem)


def _lift(problem: LandingProblem) -> float:
    """[m/s^2] greatest acceleration upward that the vehicle could ever have."""
    return problem.lander.max_thrust / problem.lander.dry_mass + float(problem.gravity[2])


def _too_fast(problem: LandingProblem) -> str:
    """The limit that a start breaks which cannot stop above the target."""
    return "altitude" if _lift(problem) > 0.0 else "maximum thrust"


def _latest_contact(problem: LandingProblem) -> GroundContact | None:
    """Where a start too fast to stop meets the target's altitude at the latest; None where it may stop.

    By full thrust straight up; where that does not lift the vehicle at first, by the lift of the dry one.
    """
    contact = find_ground_contact(problem)
    sink, height = -float(problem.state.velocity[2]), float(problem.offset[2])
    if contact is not None or problem.rotates or not sink > problem.speed_rounding:
        return contact
    square = sink * sink - 2.0 * _lift(problem) * height
    if square <= 0.0:
        return None
    slowed = math.sqrt(square)
    return GroundContact(2.0 * height / (slowed + sink), slowed)


def forbidden_by(problem: LandingProblem, time: float, free_landing_point: bool = False) -> str:
    """The limit by which start and target velocity alone forbid a flight of `time` [s]; empty if none."""
    contact = _latest_contact(problem)
    late = contact is not None and time > (1.0 + ROUNDING) * contact.time
    return _broken_at_ends(problem, free_landing_point, contact) or (_too_fast(problem) if late else "")


def _crossing_time(problem: LandingProblem, thrust_acceleration: float) -> float:
    """[s] time to cross the distance at full thrust from rest, or faster, by the speed at the target."""
    still = math.sqrt(2.0 * float(np.linalg.norm(problem.offset)) / thrust_acceleration)
    if still == 0.0:
        return 0.0
    ratio = float(np.linalg.norm(problem.target_velocity)) / (thrust_acceleration * still)
    return still / (ratio + math.hypot(ratio, 1.0))


def time_window(problem: LandingProblem, free_landing_point: bool = False) -> TimeWindow:
    """Closed-form bounds on the time of flight.

    Where nothing bounds it from above (no gravity, no least thrust) the window ends at a hundred times the
    time that the engine needs to stop and to cross the distance. In a frame that turns these are no bounds
    on the time but where to look for it; what the two ends forbid by themselves is forbidden there too.

    Args:
        problem: the landing problem.
        free_landing_point: bounds for a landing anywhere in the target's plane.

    Returns:
        The window; empty, with its cause, where these bounds already forbid every flight.
    """
    contact = _latest_contact(problem)
    broken = _broken_at_ends(problem, free_landing_point, contact)
    if broken:
        return replace(_NO_TIME, cause=broken)
    lander, state = problem.lander, problem.state
    thrust_acceleration = lander.max_thrust / lander.dry_mass
    supply = lander.exhaust_velocity * problem.log_mass_ratio
    speed = float(np.linalg.norm(state.velocity - problem.target_velocity))
    engine_time = max(speed / thrust_acceleration + _crossing_time(problem, thrust_acceleration), 1e-3)
    high = 100.0 * engine_time
    gravity = float(np.linalg.norm(problem.gravity))
    if gravity > 0.0:
        high = max(high, 2.0 * (supply + speed) / gravity)
    if lander.min_thrust > 0.0:
        high = min(high, (state.mass - lander.dry_mass) * lander.exhaust_velocity / lander.min_thrust)
    limits = _necessary(problem, free_landing_point)
    low, latest = 1e-3 * engine_time, math.inf if contact is None else contact.time
    window = _hull(limits["maximum thrust"] + limits["propellant"], low, min(high, latest))
    if problem.rotates:
        around = TimeWindow(0.5 * window.low, 2.0 * window.high)
        return TimeWindow(low, high) if window.empty else around
    if not window.empty:
        return window
    if latest < high and not _hull(limits["maximum thrust"] + limits["propellant"], low, high).empty:
        return replace(window, cause="altitude")
    alone = [name for name, parts in limits.items() if _hull(parts, low, high).empty]
    return replace(window, cause=" and ".join(alone or limits))


def guess_time(problem: LandingProblem, window: TimeWindow) -> float:
    """[s] first guess: coast, then brake to the target velocity at full thrust, along the vertical alone."""
    lift = problem.lander.max_thrust / problem.state.mass + float(problem.gravity[2])
    gravity, height = -float(problem.gravity[2]), float(problem.offset[2])
    climb = float(problem.state.velocity[2])
    if gravity <= 0.0 or lift <= 0.0:
        return math.sqrt(window.low * min(window.high, 10.0 * window.low))
    arrival = max(0.0, -float(problem.target_velocity[2]))
    coast = (2.0 * lift * height - climb * climb + arrival * arrival) / (2.0 * (lift + gravity))
    turn = math.sqrt(max(climb * climb + 2.0 * gravity * min(coast, height), 0.0))
    time = max((turn + climb) / gravity, 0.0) + max(turn - arrival, 0.0) / lift
    return min(max(time, 1.05 * window.low), window.high)
