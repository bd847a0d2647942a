"""Calls of planners measured and summed up: wall time, propellant regret, solves, limits kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from rich.progress import track

from guidance import Plan, PlanStatus
from studies.timing_methods import PEER_NODES, Case, Method

FREE_TO_FIXED_BAR = 4.0
"""Most that a free-time solve may cost, in fixed-time solves of the same nodes."""
PEER_BAR = 100.0
"""Least factor by which solve_pdg should beat gfold's free-time solve at 30 nodes."""


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
        regret: [kg] propellant beyond the tight optimum; nan without a flight.
        solves: fixed-time optimisations; 0 where the method does not count them.
        keeps_limits: whether the flown plan respects every limit; False without a flight.
    """

    method: str
    case: str
    drawn: bool
    feasible: bool
    status: PlanStatus
    seconds: float
    regret: float
    solves: int
    keeps_limits: bool


@dataclass(frozen=True)
class Summary:
    """One method over all cases; regret over plans that keep every limit, wall time over feasible cases.

    Attributes:
        method: its label.
        feasible: calls on feasible cases.
        solved: of them, plans that keep every limit.
        broken: of them, plans that break one.
        infeasible: calls on infeasible cases.
        refused: of them, called infeasible.
        wall: [s] median, 99 % and maximum.
        regret: [kg] median and maximum.
        solves: mean; nan where the method does not count them.
    """

    method: str
    feasible: int
    solved: int
    broken: int
    infeasible: int
    refused: int
    wall: tuple[float, float, float]
    regret: tuple[float, float]
    solves: float


def keeps_limits(plan: Plan) -> bool:
    """Whether the plan, flown through the true motion, lands where it says and keeps every limit."""
    if not plan.status.has_flight:
        return False
    flown, lander = plan.residuals, plan.problem.lander
    return (
        max(flown.position, flown.glide_slope) < 0.5
        and flown.altitude < 0.2
        and flown.velocity < 0.1
        and flown.thrust_above <= 1e-3 * lander.max_thrust
        and flown.thrust_below <= 1e-3 * lander.min_thrust + 1e-9
        and flown.pointing < 1e-2
        and flown.propellant < 1e-3
    )


def wall_quantiles(seconds: Sequence[float]) -> tuple[float, float, float]:
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
    """Plan once against the wall clock, then check the plan."""
    if method.prepare is not None:
        method.prepare()
    start = perf_counter()
    plan = method.run(case)
    seconds = perf_counter() - start
    return Call(
        method.label,
        case.name,
        case.drawn,
        case.feasible,
        plan.status,
        seconds,
        plan.propellant - case.propellant,
        plan.solves,
        keeps_limits(plan),
    )


def measure_calls(methods: Sequence[Method], cases: Sequence[Case], repeats: int) -> list[Call]:
    """Every method on every case in turn; a call that compiles for a new set of limits is not counted."""
    calls: list[Call] = []
    warm: set[tuple[bool, ...]] = set()
    for case in track(cases, "cases", transient=True):
        if case.limits not in warm:
            warm.add(case.limits)
            for method in methods:
                method.run(case)
        calls += [measure_call(method, case) for _ in range(repeats) for method in methods]
    return calls


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
        wall_quantiles([call.seconds for call in asked]),
        (float(np.median(good)), max(good)) if good else (np.nan, np.nan),
        float(np.mean(solves)) if solves and min(solves) > 0 else np.nan,
    )


@dataclass(frozen=True)
class Comparison:
    """Two methods on the same feasible cases.

    Attributes:
        ratio: median wall time of the first over that of the second.
        paired: median over cases of the ratio of the two.
        first_regret: [kg] median of the first, over cases where both keep every limit.
        second_regret: [kg] of the second.
    """

    ratio: float
    paired: float
    first_regret: float
    second_regret: float


def compare_methods(calls: Sequence[Call], first: str, second: str) -> Comparison:
    """Compare two methods by their labels; repeated calls of a case count by their medians."""
    times, regrets = [], []
    for name in dict.fromkeys(call.case for call in calls if call.feasible):
        own = [[call for call in calls if call.case == name and call.method == m] for m in (first, second)]
        times.append([np.median([call.seconds for call in group]) for group in own])
        if all(call.keeps_limits for group in own for call in group):
            regrets.append([np.median([call.regret for call in group]) for group in own])
    wall = np.array(times)
    cost = np.median(regrets, axis=0) if regrets else (np.nan, np.nan)
    ratio = np.median(wall[:, 0]) / np.median(wall[:, 1])
    return Comparison(float(ratio), float(np.median(wall[:, 0] / wall[:, 1])), float(cost[0]), float(cost[1]))


def conclude(methods: Sequence[Method], calls: Sequence[Call], summaries: Sequence[Summary]) -> list[str]:
    """The bars in words, met or not, on the starts drawn from the preset."""
    starts = [call for call in calls if call.drawn]
    ours = {(m.nodes, m.free): m.label for m in methods if m.name == "solve_pdg"}
    meshes = sorted({nodes for nodes, _ in ours}, reverse=True)
    words = []
    for nodes in meshes:
        found = compare_methods(starts, ours[nodes, True], ours[nodes, False])
        met = "met" if found.ratio <= FREE_TO_FIXED_BAR else "NOT met"
        words.append(
            f"Drawn starts, solve_pdg at {nodes} nodes: a free-time solve costs {found.ratio:.2f} fixed-time "
            f"solves (medians; {found.paired:.2f} case by case); bar {FREE_TO_FIXED_BAR:g}: {met}."
        )
    peers = [m for m in methods if m.name == "gfold" and m.free and m.nodes == PEER_NODES]
    if not peers:
        words.append("gfold is not installed (extra `peers`): no comparison with it was made.")
    for peer in peers:
        words += [_against_peer(starts, peer, ours[nodes, True]) for nodes in meshes]
        broken = sum(summary.broken for summary in summaries if summary.method == peer.label)
        words.append(
            f"gfold plans that break a limit: {broken} (a pointing limit is accepted and not kept). Its "
            "steps are t/n on n nodes, so a flight asked to last t lasts t (n - 1)/n; here it is asked for "
            "the longer time and judged on the steps it flew."
        )
    return words


def _against_peer(starts: Sequence[Call], peer: Method, ours: str) -> str:
    found = compare_methods(starts, peer.label, ours)
    better = found.second_regret < found.first_regret
    met = "met" if found.ratio >= PEER_BAR and better else "NOT met"
    return (
        f"Drawn starts: gfold's free-time solve at {peer.nodes} nodes takes {found.ratio:.1f} times as long "
        f"as '{ours}' ({found.paired:.1f} case by case) and burns {1e3 * found.first_regret:.1f} g too much "
        f"against {1e3 * found.second_regret:.1f} g; bar {PEER_BAR:g} times with less regret: {met}."
    )
