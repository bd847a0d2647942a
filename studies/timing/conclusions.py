"""What the timing study concludes: methods compared on the same cases, and the bars in words.

Methods are compared by the processor time of this process, all threads together: other jobs on the machine
disturb it little.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studies.bench.speed_ratios import FREE_TO_FIXED_LIMIT
from studies.peers.openscvx_process import FIRST_ORDER_HOLD, OPENSCVX_METHOD
from studies.timing.gfold_peer import PEER_METHOD
from studies.timing.measures import Call, Summary
from studies.timing.methods import FATROP_METHOD, IPOPT_METHOD, OWN_METHOD, PEER_NODES, Method
from studies.timing.openscvx_worker import WEIGHTS
from studies.timing.qoco_peer import CLARABEL_METHOD, QOCO_METHOD

PEER_BAR = 100.0
"""Least factor by which solve_pdg should beat gfold's free-time solve at 30 nodes."""


@dataclass(frozen=True)
class Comparison:
    """Two methods on the same feasible cases.

    Attributes:
        ratio: median processor time of the first over that of the second.
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
        times.append([np.median([call.processor for call in group]) for group in own])
        if all(call.keeps_limits for group in own for call in group):
            regrets.append([np.median([call.regret for call in group]) for group in own])
    spent = np.array(times)
    cost = np.median(regrets, axis=0) if regrets else (np.nan, np.nan)
    ratio = np.median(spent[:, 0]) / np.median(spent[:, 1])
    return Comparison(
        float(ratio), float(np.median(spent[:, 0] / spent[:, 1])), float(cost[0]), float(cost[1])
    )


def conclude(methods: Sequence[Method], calls: Sequence[Call], summaries: Sequence[Summary]) -> list[str]:
    """The bars in words, met or not, on the starts drawn from the preset."""
    starts = [call for call in calls if call.drawn]
    ours = {(m.nodes, m.free): m.label for m in methods if m.name == OWN_METHOD}
    meshes = sorted({nodes for nodes, _ in ours}, reverse=True)
    words = []
    for nodes in meshes:
        found = compare_methods(starts, ours[nodes, True], ours[nodes, False])
        met = "met" if found.ratio <= FREE_TO_FIXED_LIMIT else "NOT met"
        words.append(
            f"Drawn starts, solve_pdg at {nodes} nodes: a free-time solve costs {found.ratio:.2f} fixed-time "
            f"solves (medians; {found.paired:.2f} case by case); bar {FREE_TO_FIXED_LIMIT:g}: {met}."
        )
    words += _fatrop_against_ipopt(starts, {summary.method: summary for summary in summaries}, methods)
    peers = [m for m in methods if m.name == PEER_METHOD and m.free and m.nodes == PEER_NODES]
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
    by_label = {summary.method: summary for summary in summaries}
    words += _qoco_against_clarabel(starts, calls, by_label, methods)
    words += _openscvx(starts, calls, by_label, methods)
    return words


def _labels(methods: Sequence[Method], free: bool) -> dict[str, str]:
    """Name of each method with free or fixed time of flight -> its label; of several meshes, the last."""
    return {method.name: method.label for method in methods if method.free is free}


def _qoco_against_clarabel(
    starts: Sequence[Call], calls: Sequence[Call], summaries: dict[str, Summary], methods: Sequence[Method]
) -> list[str]:
    """The two conic solvers on the same programmes: time on the drawn starts, plans on all cases."""
    words = []
    for free in (True, False):
        labels = _labels(methods, free)
        if not {QOCO_METHOD, CLARABEL_METHOD} <= labels.keys():
            continue
        qoco, clarabel = labels[QOCO_METHOD], labels[CLARABEL_METHOD]
        found = compare_methods(starts, qoco, clarabel)
        theirs, ours = summaries[qoco], summaries[clarabel]
        endings = Counter(c.status.value for c in calls if c.method == qoco and not c.feasible)
        told = ", ".join(f"{count} x {ending}" for ending, count in endings.most_common()) or "none"
        words.append(
            f"Drawn starts, the same cone programmes, {'free' if free else 'fixed'} time: QOCO takes "
            f"{found.ratio:.2f} times as long as Clarabel ({found.paired:.2f} case by case). Of "
            f"{ours.feasible} feasible calls it solves {theirs.solved} within every limit, Clarabel "
            f"{ours.solved}; their plans are at most {1e3 * _apart(calls, qoco, clarabel):.2g} g apart. "
            f"Infeasible ones end for QOCO, which certifies none, as: {told} (a tank that does not suffice "
            f"is seen in a flight, without the solver's word); Clarabel refuses {ours.refused} of "
            f"{ours.infeasible}."
        )
    return words or ["QOCO is not installed (extra `peers`): no comparison with it was made."]


def _apart(calls: Sequence[Call], first: str, second: str) -> float:
    """[kg] greatest difference of what two methods burn, over cases where both keep every limit."""
    burnt = [{c.case: c.regret for c in calls if c.method == m and c.keeps_limits} for m in (first, second)]
    return max((abs(burnt[0][case] - burnt[1][case]) for case in burnt[0].keys() & burnt[1]), default=np.nan)


def _openscvx(
    starts: Sequence[Call], calls: Sequence[Call], summaries: dict[str, Summary], methods: Sequence[Method]
) -> list[str]:
    """OpenSCvx beside solve_pdg on the nearest mesh; its plans as it states them, and as they fly."""
    words = []
    for method in (m for m in methods if m.name == OPENSCVX_METHOD):
        near = min(
            (m for m in methods if m.name == OWN_METHOD and m.free is method.free),
            key=lambda m: abs(m.nodes - method.nodes),
        )
        found, summary = compare_methods(starts, method.label, near.label), summaries[method.label]
        ended = [c for c in calls if c.method == method.label and c.feasible and c.status.has_flight]
        regret = np.median([c.regret for c in ended]) if ended else np.nan
        miss = np.median([c.miss for c in ended]) if ended else np.nan
        words.append(
            f"Drawn starts: OpenSCvx, {'free' if method.free else 'fixed'} time, takes {found.ratio:.0f} "
            f"times as long as '{near.label}' ({found.paired:.0f} case by case), compiling left out. It "
            f"calls {len(ended)} of {summary.feasible} feasible calls converged, {1e3 * regret:.1f} g from "
            f"the tight optimum by its own masses (median). Flown by the thrust at its nodes, "
            f"{summary.solved} keep every limit, and they end {miss:.2f} m from where they say (median)."
        )
    if not words:
        return ["OpenSCvx is not installed (extra `peers`): no comparison with it was made."]
    weights = ", ".join(f"{name} {value:g}" for name, value in WEIGHTS.items())
    return [*words, f"OpenSCvx's weights: {weights}; its own tuner moves them. {FIRST_ORDER_HOLD}"]


def _fatrop_against_ipopt(
    starts: Sequence[Call], summaries: dict[str, Summary], methods: Sequence[Method]
) -> list[str]:
    """The two nonlinear solvers on the same programme: time on the drawn starts, plans on all cases."""
    words = []
    for free in (True, False):
        labels = _labels(methods, free)
        if not {FATROP_METHOD, IPOPT_METHOD} <= labels.keys():
            continue
        ipopt, fatrop = labels[IPOPT_METHOD], labels[FATROP_METHOD]
        found = compare_methods(starts, ipopt, fatrop)
        solved = " and ".join(f"{summaries[label].solved} by '{label}'" for label in (fatrop, ipopt))
        words.append(
            f"Drawn starts, CasADi, {'free' if free else 'fixed'} time: IPOPT takes {found.ratio:.2f} times "
            f"as long as fatrop ({found.paired:.2f} case by case); of all "
            f"{summaries[ipopt].feasible} feasible cases {solved} are solved within every limit."
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
