"""A fuel-optimal plan that ends gently: convex guidance to a gate, then a bounded deceleration.

A least-propellant descent ends at full thrust, where a few centimetres of altitude are a metre per second of
touchdown speed. Here the planner aims at a gate above the site: the point from which a constant deceleration
d over a time t_d stops at the site, d t_d^2 / 2 above it, passed at the speed d t_d downward. the planner
plans to rest; in a frame that moves with the gate's velocity the gate is passed at rest, and the equations of
motion are the same.

The plan keeps a margin of thrust, so that the feedback can make up for a weak engine, and a margin of the
lander's pointing limit, so that it can lean over a little further.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array
from guidance.constants import MOON_GRAVITY
from guidance.descent.limits import Limits
from guidance.descent.plan import Plan, PlanStatus
from guidance.descent.problem import LandingProblem, lies_below
from guidance.lander import Lander
from guidance.pdg.solve import PlanningMethod, replan
from guidance.state import State
from guidance.tracking.reference import TrackingReference, hold_thrust, make_reference
from guidance.validation import finite_number, finite_vector


@dataclass(frozen=True)
class SoftLandingOptions:
    """How a plan is made for the closed loop.

    Attributes:
        thrust_margin: share of the greatest thrust that the plan leaves to the feedback.
        pointing_margin: share of the lander's pointing limit, if it has one, that it leaves to the feedback.
        terminal_periods: control periods of the terminal phase.
        terminal_deceleration: [m/s^2] net deceleration in it.
        speed_limit: [m/s] greatest speed, or the present speed and a little where that is faster; None for
            none. A slower descent sees more before it commits.
        nodes: nodes of the plan to the gate.
        method: planner, as in `solve_pdg`.
    """

    thrust_margin: float = 0.1
    terminal_periods: int = 4
    terminal_deceleration: float = 1.5
    speed_limit: float | None = None
    nodes: int = 31
    method: PlanningMethod = "auto"
    pointing_margin: float = 0.1

    def __post_init__(self) -> None:
        """Check every field that no planner checks."""
        finite_number("thrust_margin", self.thrust_margin, at_least=0.0, at_most=0.9)
        finite_number("pointing_margin", self.pointing_margin, at_least=0.0, at_most=0.9)
        finite_number("terminal_periods", self.terminal_periods, at_least=1)
        finite_number("terminal_deceleration", self.terminal_deceleration, above=0.0)


DEFAULT_OPTIONS = SoftLandingOptions()

_SPEED_EASE = 1.02
_LANDING_ERROR_SLACK = 0.5
"""[m] by which whole control periods may move the landing point."""


@dataclass(frozen=True, eq=False)
class SoftLanding:
    """A planned descent that the vehicle can track.

    Attributes:
        status: OPTIMAL, NEAREST (the site was out of reach), or why there is no flight.
        reference: the whole descent at the control instants, to the ground; None without a flight.
        plan: the planner's answer for the way to the gate, in the frame in which the gate is passed at rest;
            None where no flight near an earlier one was found, or the planner could not be asked.
    """

    status: PlanStatus
    reference: TrackingReference | None
    plan: Plan | None


@dataclass(frozen=True, eq=False)
class _Approach:
    """One question to the planner, but for the time of flight: the way to the gate."""

    state: State
    gate: Array
    engine: Lander
    gravity: Array
    options: SoftLandingOptions

    @property
    def speed_limit(self) -> float | None:
        """[m/s] the limit asked for, eased where the vehicle is faster already: it cannot brake at once."""
        asked = self.options.speed_limit
        if asked is None:
            return None
        return max(asked, _SPEED_EASE * float(np.linalg.norm(self.state.velocity)))

    def solve(self, time_of_flight: float | None, sinking: float = 0.0, nearest: bool = True) -> Plan | None:
        """Plan to pass the gate at `sinking` [m/s] downward; None where the frame starts below the gate."""
        drift = np.array([0.0, 0.0, -sinking])
        start = self.state.position + drift * (time_of_flight or 0.0)
        if lies_below(start, self.gate):
            return None
        drifting = State(start, self.state.velocity - drift, self.state.mass)
        problem = LandingProblem(
            drifting, self.gate, self.engine, self.gravity, Limits(speed=self.speed_limit)
        )
        unreachable = "nearest" if nearest else "raise"
        return replan(problem, self.options.nodes, time_of_flight, self.options.method, unreachable)

    def cheapest(self, start: int, sinking: float, period: float) -> Plan | None:
        """Cheapest plan over whole numbers of control periods, searched downhill from `start` of them.

        The propellant is convex in the time of flight, so the first rise on each side ends the search.
        """

        def plan_of(periods: int) -> Plan | None:
            plan = self.solve(periods * period, sinking, nearest=False) if periods > 0 else None
            return plan if plan is not None and plan.status is PlanStatus.OPTIMAL else None

        best = plan_of(start)
        for direction in (-1, 1):
            periods = start + direction
            while (plan := plan_of(periods)) is not None and (
                best is None or plan.propellant < best.propellant
            ):
                best = plan
                periods += direction
            if best is not None and best.time_of_flight < (start - 0.5) * period:
                break
        return best


def plan_soft_landing(
    state: State,
    site: Array,
    lander: Lander,
    control_period: float,
    options: SoftLandingOptions = DEFAULT_OPTIONS,
    gravity: ArrayLike = MOON_GRAVITY,
    periods: int | None = None,
) -> SoftLanding:
    """Plan from `state` to a gentle touchdown at `site`, or at the reachable point nearest to it.

    The flight takes a whole number of control periods: the cheapest one near the best time of flight.

    Args:
        state: start of the plan, not below the gate.
        site: [m] shape (3,).
        lander: the vehicle; the plan keeps the options' margins of its thrust and its pointing limit.
        control_period: [s] time over which a thrust is held.
        options: how the plan is made.
        gravity: [m/s^2] shape (3,), along -z.
        periods: control periods that are left of an earlier plan to the same site: only flights near it are
            searched, and LIMIT_REACHED says that there is none.

    Returns:
        The landing; its status says how planning ended. No exception of a solver escapes.

    Raises:
        ValueError: an argument is out of range, such as a start below the gate.
    """
    approach, speed = _approach_gate(state, site, lander, control_period, options, gravity)
    gate = approach.gate
    if periods is not None:
        plan = approach.cheapest(periods - options.terminal_periods, speed, control_period)
        if plan is None:
            return SoftLanding(PlanStatus.LIMIT_REACHED, None, None)
        return SoftLanding(PlanStatus.OPTIMAL, sample_descent(plan, speed, control_period, options), plan)
    search = approach.solve(None)
    if search is None:
        raise ValueError(f"state: altitude {state.position[2]:g} m lies below the gate, {gate[2]:g} m")
    if not search.status.has_flight:
        return SoftLanding(search.status, None, search)
    if search.status is PlanStatus.OPTIMAL:
        plan = approach.cheapest(math.floor(search.time_of_flight / control_period), speed, control_period)
        if plan is not None:
            return SoftLanding(PlanStatus.OPTIMAL, sample_descent(plan, speed, control_period, options), plan)
    flight_time = control_period * math.ceil(search.time_of_flight / control_period - 1e-9)
    for sinking in (speed, 0.0):
        plan = approach.solve(flight_time, sinking)
        if plan is not None and plan.landing_error <= search.landing_error + _LANDING_ERROR_SLACK:
            return SoftLanding(search.status, sample_descent(plan, sinking, control_period, options), plan)
    return SoftLanding(PlanStatus.LIMIT_REACHED, None, search)


def plan_timed_landing(
    state: State,
    site: Array,
    lander: Lander,
    timing: tuple[float, int],
    options: SoftLandingOptions = DEFAULT_OPTIONS,
    gravity: ArrayLike = MOON_GRAVITY,
) -> SoftLanding:
    """Plan a gentle touchdown at `site` after a given time, be it longer than the best.

    Args:
        state: start of the plan.
        site: [m] shape (3,).
        lander: as in `plan_soft_landing`.
        timing: [s] control period, and how many of them the whole flight takes.
        options: how the plan is made.
        gravity: [m/s^2] shape (3,), along -z.

    Returns:
        The landing; without a flight of this time, with the planner's status and plan. As of `replan`,
        INFEASIBLE is then what the solver found, without a certificate. Where the planner cannot be asked, as
        no time is left before the gate or the moving frame starts below it, LIMIT_REACHED and no plan.

    Raises:
        ValueError: an argument is out of range.
    """
    control_period, periods = timing
    approach, speed = _approach_gate(state, site, lander, control_period, options, gravity)
    before_gate = (periods - options.terminal_periods) * control_period
    plan = approach.solve(before_gate, speed, nearest=False) if before_gate > 0.0 else None
    if plan is None:
        return SoftLanding(PlanStatus.LIMIT_REACHED, None, None)
    if not plan.status.has_flight:
        return SoftLanding(plan.status, None, plan)
    return SoftLanding(PlanStatus.OPTIMAL, sample_descent(plan, speed, control_period, options), plan)


def _approach_gate(
    state: State,
    site: Array,
    lander: Lander,
    control_period: float,
    options: SoftLandingOptions,
    gravity: ArrayLike,
) -> tuple[_Approach, float]:
    """The question how to come to the gate above a site, and the speed [m/s] at which it is passed."""
    engine = _with_margins(lander, options)
    duration = options.terminal_periods * control_period
    speed = options.terminal_deceleration * duration
    gate = finite_vector("site", site, 3) + np.array([0.0, 0.0, 0.5 * speed * duration])
    return _Approach(state, gate, engine, finite_vector("gravity", gravity, 3), options), speed


def _with_margins(lander: Lander, options: SoftLandingOptions) -> Lander:
    """The vehicle that plans are made for: what the feedback may use is left out."""
    limit = lander.pointing_limit
    return replace(
        lander,
        max_thrust=lander.max_thrust * (1.0 - options.thrust_margin),
        pointing_limit=None if limit is None else limit * (1.0 - options.pointing_margin),
    )


def sample_descent(
    plan: Plan, sinking: float, control_period: float, options: SoftLandingOptions
) -> TrackingReference:
    """Sample the way to the gate, and the terminal phase from it to the ground, at the control instants.

    The terminal phase decelerates at d over n periods if the gate is passed sinking, else it speeds up at
    d/2 for n periods and slows down at d/2 for n more: both end at rest on the same ground.
    """
    periods = round(plan.time_of_flight / control_period)
    times = control_period * np.arange(periods + 1)
    flown = plan.states_at(np.minimum(times, plan.time_of_flight))
    position, velocity = hold_thrust(*flown, control_period, plan.problem.gravity)
    drift = np.array([0.0, 0.0, -sinking])
    position = position + drift * (times - plan.time_of_flight)[:, None]
    velocity = velocity + drift
    count, deceleration = options.terminal_periods, options.terminal_deceleration
    rate = np.full(count, deceleration) if sinking else np.repeat([-0.5, 0.5], count) * deceleration
    below = np.zeros((rate.size, 3))
    speed = np.zeros((rate.size, 3))
    speed[:, 2] = -sinking + control_period * np.cumsum(rate)
    before = speed[:, 2] - control_period * rate
    below[:, 2] = control_period * np.cumsum(0.5 * (before + speed[:, 2]))
    return make_reference(
        np.vstack([position, position[-1] + below]),
        np.vstack([velocity, speed]),
        control_period,
        plan.problem.gravity,
    )
