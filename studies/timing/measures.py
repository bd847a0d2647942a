"""Calls of planners measured and summed up: time, propellant regret, solves, limits kept."""

from __future__ import annotations

import math
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter

import numpy as np
from rich.progress import track

from guidance import PlanStatus
from studies.campaign.journal import Journal
from studies.timing.methods import Case, Method


@dataclass(frozen=True)
class Call:
    """One measured call.

    Attributes:
        method: its label.
        case: name of the case.
        drawn: whether the case is a start drawn from a preset.
        feasible: whether a flight exists.
        status: how planning ended.
        seconds: wall time.
        processor: [s] processor time.
        regret: [kg] propellant beyond the tight optimum; nan without a flight.
        solves: fixed-time optimisations; 0 where the method does not count them.
        keeps_limits: whether the flown plan respects every limit; False without a flight.
        miss: [m] between where the plan, flown, lands and where it says; nan without a flight.
    """

    method: str
    case: str
    drawn: bool
    feasible: bool
    status: PlanStatus
    seconds: float
    processor: float
    regret: float
    solves: int
    keeps_limits: bool
    miss: float = math.nan


@dataclass(frozen=True)
class Summary:
    """One method over all cases; regret over plans that keep every limit, times over feasible cases.

    Attributes:
        method: its label.
        feasible: calls on feasible cases.
        solved: of them, plans that keep every limit.
        broken: of them, plans that break one.
        infeasible: calls on infeasible cases.
        refused: of them, called infeasible.
        processor: [s] median, 99 % and maximum of the processor time.
        wall: [s] median of the wall time.
        regret: [kg] median and maximum.
        solves: mean; nan where the method does not count them.
    """

    method: str
    feasible: int
    solved: int
    broken: int
    infeasible: int
    refused: int
    processor: tuple[float, float, float]
    wall: float
    regret: tuple[float, float]
    solves: float


def time_quantiles(seconds: Sequence[float]) -> tuple[float, float, float]:
    """Median, 99 % quantile (a measured value, the next one up) and maximum."""
    if not seconds:
        return (np.nan, np.nan, np.nan)
    values = np.array(seconds)
    return (
        float(np.median(values)),
        float(np.quantile(values, 0.99, method="higher")),
        float(values.max()),
    )


def measure_call(method: Method, case: Case) -> Call:
    """Plan once against both clocks, then check the plan."""
    if method.prepare is not None:
        method.prepare()
    start, started = perf_counter(), method.clock()
    plan = method.run(case)
    processor, seconds = method.clock() - started, perf_counter() - start
    return Call(
        method.label,
        case.name,
        case.drawn,
        case.feasible,
        plan.status,
        seconds,
        processor,
        plan.propellant - case.propellant,
        plan.solves,
        plan.keeps_limits,
        plan.residuals.landing_position if plan.nodes else math.nan,
    )


def measure_calls(
    methods: Sequence[Method], cases: Sequence[Case], repeats: int, journal: Journal[Call]
) -> list[Call]:
    """Every method on every case in turn; a call that compiles for a new set of limits is not counted.

    Calls that stand in the journal are not made again, and each goes there at once.
    """
    calls: list[Call] = []
    warm: set[tuple[bool, ...]] = set()
    for case in track(cases, "cases", transient=True):
        turns = [(turn, method) for turn in range(repeats) for method in methods]
        kept = [journal.find((case.name, method.label, turn)) for turn, method in turns]
        if None in kept and case.limits not in warm:
            warm.add(case.limits)
            for method in methods:
                method.run(case)
        calls += [
            journal.finish((case.name, method.label, turn), partial(measure_call, method, case))
            for turn, method in turns
        ]
    return calls


def name_processor() -> str:
    """What the times were measured on, as far as the system tells."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:  # not Linux
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor()


def summarize_calls(label: str, calls: Sequence[Call]) -> Summary:
    """Reduce the calls of one method."""
    own = [call for call in calls if call.method == label]
    asked = [call for call in own if call.feasible]
    good = [call.regret for call in asked if call.keeps_limits]
    solves = [call.solves for call in asked]
    return Summary(
        label,
        len(asked),
        len(good),
        sum(call.status.has_flight and not call.keeps_limits for call in asked),
        len(own) - len(asked),
        sum(call.status is PlanStatus.INFEASIBLE for call in own if not call.feasible),
        time_quantiles([call.processor for call in asked]),
        float(np.median([call.seconds for call in asked])) if asked else np.nan,
        (float(np.median(good)), max(good)) if good else (np.nan, np.nan),
        float(np.mean(solves)) if solves and min(solves) > 0 else np.nan,
    )
