"""Closed-form bounds on the time of flight of a landing, and a first guess of the best one."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guidance.problem import LandingProblem

Array = NDArray[np.float64]
_ROUNDING = 1e-6  # relative: a start on the edge of a limit keeps it


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


def _square(*coefficients: Array) -> Array:
    """Coefficients (rising powers) of |sum_k c_k T^k|^2."""
    total = np.zeros(2 * len(coefficients) - 1)
    for i, first in enumerate(coefficients):
        for j, second in enumerate(coefficients):
            total[i + j] += float(np.dot(first, second))
    return total


def _necessary(problem: LandingProblem, free_landing_point: bool) -> dict[str, list[Array]]:
    """Polynomials in T (rising powers) that are >= 0 at every feasible time, by the limit they stem from.

    With the thrust acceleration u: int u = -(v + g T), int (T-t) u = R - v T - g T^2/2, int t u = -R - g
    T^2/2, while |u| <= max_thrust/dry_mass and int |u| <= exhaust_velocity ln(m/m_dry).
    """
    push = problem.lander.max_thrust / problem.lander.dry_mass
    supply = problem.lander.exhaust_velocity * problem.log_mass_ratio
    only = slice(2, 3) if free_landing_point else slice(0, 3)
    v, g, miss = problem.state.velocity, problem.gravity, -problem.offset
    speed = _square(v, g)
    first = _square(miss[only], -v[only], -0.5 * g[only])
    second = _square(miss[only], 0.0 * g[only], 0.5 * g[only])
    zero = np.zeros(5)
    out: dict[str, list[Array]] = {"maximum thrust": [], "propellant": []}
    for vector, power in ((speed, 1), (first, 2), (second, 2)):
        thrust, propellant = zero.copy(), zero.copy()
        thrust[: vector.size] -= vector
        propellant[: vector.size] -= vector
        thrust[2 * power] += (push / power) ** 2
        propellant[2 * power - 2] += supply**2
        out["maximum thrust"].append(thrust)
        out["propellant"].append(propellant)
    return out


def _hull(polynomials: list[Array], low: float, high: float) -> tuple[float, float]:
    """First and last time in [low, high] at which all polynomials are >= 0; (inf, -inf) if there is none."""
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
        return math.inf, -math.inf
    return float(edges[good[0]]), float(edges[good[-1] + 1])


def _broken_at_start(problem: LandingProblem, free_landing_point: bool) -> str:
    """The limit that the start itself breaks by more than rounding; empty if none."""
    speed = float(np.linalg.norm(problem.state.velocity))
    if problem.speed_limit is not None and speed > problem.speed_limit * (1.0 + _ROUNDING):
        return "speed"
    if problem.glide_slope_limit is None or not problem.has_glide_slope or free_landing_point:
        return ""
    across, height = float(np.linalg.norm(problem.offset[:2])), float(problem.offset[2])
    outside = math.cos(problem.glide_slope_limit) * across - math.sin(problem.glide_slope_limit) * height
    return "glide slope" if outside > _ROUNDING * (across + height) else ""


def time_window(problem: LandingProblem, free_landing_point: bool = False) -> TimeWindow:
    """Closed-form bounds on the time of flight.

    Where nothing bounds it from above (no gravity, no least thrust) the window ends at a hundred times the
    time that the engine needs to stop and to cross the distance.

    Args:
        problem: the landing problem.
        free_landing_point: bounds for a landing anywhere in the target's plane.

    Returns:
        The window; empty, with its cause, where these bounds already forbid every flight.
    """
    broken = _broken_at_start(problem, free_landing_point)
    if broken:
        return TimeWindow(math.inf, -math.inf, broken)
    lander, state = problem.lander, problem.state
    push = lander.max_thrust / lander.dry_mass
    supply = lander.exhaust_velocity * problem.log_mass_ratio
    lift = push + float(problem.gravity[2])
    sink, height = min(0.0, float(state.velocity[2])), float(problem.offset[2])
    if sink < 0.0 and sink * sink > 2.0 * lift * height:
        return TimeWindow(math.inf, -math.inf, "altitude" if lift > 0.0 else "maximum thrust")
    speed, distance = float(np.linalg.norm(state.velocity)), float(np.linalg.norm(problem.offset))
    pace = max(speed / push + math.sqrt(2.0 * distance / push), 1e-3)
    high = 100.0 * pace
    pull = float(np.linalg.norm(problem.gravity))
    if pull > 0.0:
        high = max(high, 2.0 * (supply + speed) / pull)
    if lander.min_thrust > 0.0:
        high = min(high, (state.mass - lander.dry_mass) * lander.exhaust_velocity / lander.min_thrust)
    limits = _necessary(problem, free_landing_point)
    low = 1e-3 * pace
    window = _hull(limits["maximum thrust"] + limits["propellant"], low, high)
    if window[0] <= window[1]:
        return TimeWindow(*window)
    alone = [name for name, parts in limits.items() if _hull(parts, low, high)[0] == math.inf]
    return TimeWindow(*window, cause=" and ".join(alone or limits))


def guess_time(problem: LandingProblem, window: TimeWindow) -> float:
    """[s] first guess: coast, then brake at full thrust, along the vertical alone."""
    lift = problem.lander.max_thrust / problem.state.mass + float(problem.gravity[2])
    pull, height = -float(problem.gravity[2]), float(problem.offset[2])
    climb = float(problem.state.velocity[2])
    if pull <= 0.0 or lift <= 0.0:
        return math.sqrt(window.low * min(window.high, 10.0 * window.low))
    coast = (2.0 * lift * height - climb * climb) / (2.0 * (lift + pull))
    turn = math.sqrt(max(climb * climb + 2.0 * pull * coast, 0.0))
    time = max((turn + climb) / pull, 0.0) + turn / lift
    return min(max(time, 1.05 * window.low), window.high)
