"""Dispersed starts planned by both methods of `guidance.solve_pdg_6dof`, and what their lines say.

Starts are those of a preset's episodes on the tuning tiles, each to its first target, the body upright and at
rest. A plan is flown open loop by the true motion; one that misses a limit has no flight. Times are of the
processor, on one core.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import process_time
from typing import get_args

import numpy as np
from rich.progress import track

from guidance import solve_pdg_6dof
from guidance.rigid_body import DEFAULT_BODY, RigidState
from guidance.rigid_descent import RigidLandingProblem, RigidPlan
from guidance.successive.solve import RigidPlanningMethod
from hda.task.scenario import sample_scenario
from studies.campaign.journal import Journal
from studies.columns import Column

STUDY_SEED, SPLIT = 0, "tuning"
"""Of the episodes whose starts are planned."""
METHODS: tuple[RigidPlanningMethod, ...] = get_args(RigidPlanningMethod)


@dataclass(frozen=True)
class PlannedStart:
    """One start planned by one method; numbers are nan without a flight.

    Attributes:
        start: its number.
        method: who planned.
        status: how planning ended.
        seconds: [s] processor time.
        propellant: [kg].
        time_of_flight: [s].
        relaxation_gap: [kg] above what no point mass undercuts.
        miss: [m] flown, from the target.
        speed: [m/s] flown, at the end.
        solves: programmes, with those of the point mass.
    """

    start: int
    method: str
    status: str
    seconds: float
    propellant: float
    time_of_flight: float
    relaxation_gap: float
    miss: float
    speed: float
    solves: int


@dataclass(frozen=True)
class MethodRow:
    """One method over all starts.

    Attributes:
        method: who planned.
        count: starts.
        flights: starts with a flight; the numbers below but `seconds` are of these, nan without one.
        seconds: [s] processor time of a plan: median, 99 % quantile, greatest.
        gap: [kg] propellant above what no point mass undercuts: median, greatest.
        miss: [m] flown, from the target, the greatest.
        speed: [m/s] flown, at the end, the greatest.
    """

    method: str
    count: int
    flights: int
    seconds: tuple[float, float, float]
    gap: tuple[float, float]
    miss: float
    speed: float


PLAN_COLUMNS: tuple[Column[PlannedStart], ...] = (
    Column("start", "start", lambda p: p.start),
    Column("method", "method", lambda p: p.method, words=True),
    Column("status", "status", lambda p: p.status, words=True),
    Column("cpu_s", "processor", lambda p: p.seconds),
    Column("propellant_kg", "propellant", lambda p: p.propellant),
    Column("time_of_flight_s", "time of flight", lambda p: p.time_of_flight),
    Column("relaxation_gap_kg", "relaxation gap", lambda p: p.relaxation_gap),
    Column("miss_m", "miss", lambda p: p.miss),
    Column("speed_m_s", "speed", lambda p: p.speed),
    Column("solves", "solves", lambda p: p.solves),
)
"""Every plan, as plans.csv has it."""

COLUMNS: tuple[Column[MethodRow], ...] = (
    Column("method", "method", lambda r: r.method, words=True),
    Column("starts", "starts", lambda r: r.count),
    Column("flights", "flights", lambda r: r.flights),
    Column("cpu_s_p50", "processor", lambda r: r.seconds[0], digits=2, unit="s"),
    Column("cpu_s_p99", "99 %", lambda r: r.seconds[1], digits=2, unit="s"),
    Column("cpu_s_max", "max", lambda r: r.seconds[2], digits=2, unit="s"),
    Column("gap_kg_p50", "relaxation gap", lambda r: r.gap[0], digits=3, unit="kg"),
    Column("gap_kg_max", "max", lambda r: r.gap[1], digits=3, unit="kg"),
    Column("miss_m_max", "greatest miss", lambda r: r.miss, digits=4, unit="m"),
    Column("speed_m_s_max", "greatest speed", lambda r: r.speed, digits=5, unit="m/s"),
)
"""The methods: table.csv, table.md and the console read this list."""


def draw_start(preset: str, start: int) -> RigidLandingProblem:
    """The start of a preset's episode on the tuning tiles, to its first target, upright and at rest."""
    scenario = sample_scenario(preset, STUDY_SEED, start, SPLIT)
    return RigidLandingProblem(
        RigidState.parse(scenario.initial_state),
        np.array(scenario.nominal_target),
        replace(DEFAULT_BODY, lander=scenario.preset.lander),
        np.array(scenario.preset.gravity),
    )


def plan_problem(
    problem: RigidLandingProblem, nodes: int, method: RigidPlanningMethod = "successive"
) -> tuple[RigidPlan, float]:
    """Ask `solve_pdg_6dof`; a plan without a flight is returned, not raised.

    Returns:
        The plan, and the processor time [s] that it took.
    """
    begun = process_time()
    plan = solve_pdg_6dof(
        problem.state,
        problem.target,
        problem.body,
        gravity=problem.gravity,
        target_velocity=problem.target_velocity,
        glide_slope_limit=problem.glide_slope,
        free_attitude=problem.free_attitude,
        objective=problem.objective,
        nodes=nodes,
        method=method,
        throw=False,
    )
    return plan, process_time() - begun


def plan_start(start: int, method: RigidPlanningMethod, preset: str, nodes: int) -> PlannedStart:
    """Plan a start, and fly the plan."""
    plan, seconds = plan_problem(draw_start(preset, start), nodes, method)
    return _row(start, method, seconds, plan)


def _row(start: int, method: str, seconds: float, plan: RigidPlan) -> PlannedStart:
    flown = plan.residuals if plan.nodes else None
    return PlannedStart(
        start,
        method,
        plan.status.value,
        seconds,
        plan.propellant,
        plan.time_of_flight,
        plan.relaxation_gap,
        math.nan if flown is None else flown.landing_position,
        math.nan if flown is None else flown.landing_velocity,
        plan.solves,
    )


def plan_all(starts: int, preset: str, nodes: int, journal: Journal[PlannedStart]) -> list[PlannedStart]:
    """Plan every start by each method in turn; what the journal has is not planned again."""
    for method in METHODS:
        if any(journal.find((method, start)) is None for start in range(starts)):
            plan_start(starts, method, preset, nodes)  # compiled and assembled on first use: not counted
    out = []
    for start in track(range(starts), "plans", transient=True):
        for method in METHODS:
            key = (method, start)
            out.append(journal.finish(key, lambda s=start, m=method: plan_start(s, m, preset, nodes)))
    return out


def sum_up(method: str, plans: Sequence[PlannedStart]) -> MethodRow:
    """One method's line."""
    mine = [plan for plan in plans if plan.method == method]
    flown = [plan for plan in mine if not math.isnan(plan.propellant)]
    marks = np.quantile([plan.seconds for plan in mine], (0.5, 0.99, 1.0), method="higher")
    gaps = [plan.relaxation_gap for plan in flown] or [math.nan]
    return MethodRow(
        method,
        len(mine),
        len(flown),
        (float(marks[0]), float(marks[1]), float(marks[2])),
        (float(np.median(gaps)), max(gaps)),
        max((plan.miss for plan in flown), default=math.nan),
        max((plan.speed for plan in flown), default=math.nan),
    )


def conclude(plans: Sequence[PlannedStart]) -> list[str]:
    """How planning ended, and how far the methods are apart where both have a flight."""
    words = []
    for (method, status), count in sorted(Counter((p.method, p.status) for p in plans).items()):
        words.append(f"{method}: {count} {status}.")
    burnt = {(p.method, p.start): p.propellant for p in plans}
    first, second = METHODS
    apart = [burnt[first, p.start] - burnt[second, p.start] for p in plans if p.method == first]
    both = [each for each in apart if not math.isnan(each)]
    if both:
        words.append(
            f"On {len(both)} starts that both planned, {first} burns {min(both):+.3f} to {max(both):+.3f} kg "
            f"more than {second}, {float(np.median(both)):+.3f} in the median."
        )
    return words
