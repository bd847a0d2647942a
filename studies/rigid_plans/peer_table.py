"""The table of `solve_pdg_6dof` beside OpenSCvx.

Numbers of the example have no units; those of our starts are SI.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from studies.columns import Column
from studies.peers.openscvx_process import FIRST_ORDER_HOLD, OPENSCVX_METHOD

OWN_METHOD = "solve_pdg_6dof"
LEAST_EXCESS = 1e-3
"""Share by which a limit is left before it is named."""


class FlownPlan(NamedTuple):
    """A plan that was flown; nan without a flight.

    Attributes:
        burnt: propellant, flown.
        share: the same, of the mass at the start.
        time_of_flight: planned.
        gap: flown end from the planned one.
        miss: flown end from the target.
        speed: flown velocity at the end from the asked one.
        fastest: greatest speed, flown.
        excess: greatest share by which a limit is left, flown.
        limit: which one; empty where none is left by more than `LEAST_EXCESS`.
    """

    burnt: float
    share: float
    time_of_flight: float
    gap: float
    miss: float
    speed: float
    fastest: float
    excess: float
    limit: str


NO_FLIGHT = FlownPlan(math.nan, math.nan, math.nan, math.nan, math.nan, math.nan, math.nan, math.nan, "")
"""Where nothing was planned."""


@dataclass(frozen=True)
class PeerAnswer:
    """One problem asked of one method; numbers are nan without a flight.

    Attributes:
        problem: its name.
        start: number of the start; 0 for the example.
        method: who planned.
        status: how planning ended.
        seconds: [s] processor time.
        first_seconds: [s] that of the first question, which compiles.
        solves: programmes.
        burnt, share, time_of_flight, gap, miss, speed, fastest, excess, limit: as `FlownPlan` has them.
    """

    problem: str
    start: int
    method: str
    status: str
    seconds: float
    first_seconds: float
    solves: int
    burnt: float
    share: float
    time_of_flight: float
    gap: float
    miss: float
    speed: float
    fastest: float
    excess: float
    limit: str


@dataclass(frozen=True)
class PeerRow:
    """One method on one kind of problem; medians where nothing else is said, nan without a flight.

    Attributes:
        problem: name.
        method: who planned.
        count: problems.
        flights: with a flight; the numbers below but the times are of these.
        seconds: [s] processor time: median, greatest.
        first_seconds: [s] of the first question.
        solves: programmes.
        share: propellant over the mass at the start.
        miss: the greatest.
        speed: the greatest.
        fastest: the greatest.
        excess: the greatest.
        limit: which one.
    """

    problem: str
    method: str
    count: int
    flights: int
    seconds: tuple[float, float]
    first_seconds: float
    solves: float
    share: float
    miss: float
    speed: float
    fastest: float
    excess: float
    limit: str


ANSWER_COLUMNS: tuple[Column[PeerAnswer], ...] = (
    Column("problem", "problem", lambda a: a.problem, words=True),
    Column("start", "start", lambda a: a.start),
    Column("method", "method", lambda a: a.method, words=True),
    Column("status", "status", lambda a: a.status, words=True),
    Column("cpu_s", "processor", lambda a: a.seconds),
    Column("first_cpu_s", "first", lambda a: a.first_seconds),
    Column("solves", "solves", lambda a: a.solves),
    Column("propellant", "propellant", lambda a: a.burnt),
    Column("time_of_flight", "time of flight", lambda a: a.time_of_flight),
    Column("gap", "from the plan", lambda a: a.gap),
    Column("miss", "miss", lambda a: a.miss),
    Column("landing_speed", "speed", lambda a: a.speed),
    Column("fastest", "fastest", lambda a: a.fastest),
    Column("excess_percent", "excess", lambda a: 100.0 * a.excess),
    Column("limit", "limit", lambda a: a.limit, words=True),
)
"""Every answer, as answers.csv has it."""

PEER_COLUMNS: tuple[Column[PeerRow], ...] = (
    Column("problem", "problem", lambda r: r.problem, words=True),
    Column("method", "method, nodes", lambda r: r.method, words=True),
    Column("asked", "asked", lambda r: r.count),
    Column("flights", "flights", lambda r: r.flights),
    Column("cpu_s_p50", "processor", lambda r: r.seconds[0], digits=2, unit="s"),
    Column("cpu_s_max", "max", lambda r: r.seconds[1], digits=2, unit="s"),
    Column("first_cpu_s", "first", lambda r: r.first_seconds, digits=1, unit="s"),
    Column("solves_p50", "solves", lambda r: r.solves, digits=0),
    Column("propellant_percent_p50", "propellant", lambda r: 100.0 * r.share, digits=3, unit="%"),
    Column("miss_max", "miss", lambda r: r.miss, digits=4),
    Column("landing_speed_max", "speed error", lambda r: r.speed, digits=4),
    Column("fastest_max", "fastest", lambda r: r.fastest, digits=2),
    Column("excess_percent_max", "limit left by", lambda r: 100.0 * r.excess, digits=1, unit="%"),
    Column("limit", "which", lambda r: r.limit, words=True),
)
"""The methods: table.csv, table.md and the console read this list."""


def sum_up_peers(answers: Sequence[PeerAnswer]) -> list[PeerRow]:
    """A line for each kind of problem and method, in the order of the answers."""
    rows = []
    for problem, method in dict.fromkeys((a.problem, a.method) for a in answers):
        mine = [a for a in answers if (a.problem, a.method) == (problem, method)]
        flown = [a for a in mine if not math.isnan(a.burnt)]
        worst = max(flown, key=lambda a: a.excess, default=None)
        rows.append(
            PeerRow(
                problem,
                method,
                len(mine),
                len(flown),
                (float(np.median([a.seconds for a in mine])), max(a.seconds for a in mine)),
                mine[0].first_seconds,
                float(np.median([a.solves for a in mine])),
                float(np.median([a.share for a in flown])) if flown else math.nan,
                max((a.miss for a in flown), default=math.nan),
                max((a.speed for a in flown), default=math.nan),
                max((a.fastest for a in flown), default=math.nan),
                math.nan if worst is None else worst.excess,
                "" if worst is None else worst.limit,
            )
        )
    return rows


def conclude_peers(answers: Sequence[PeerAnswer]) -> list[str]:
    """How answers without a flight ended; what more the peer burns and takes than each method of ours.

    Flown propellant is compared on the problems that both plan, and our methods, one a mesh, apart.
    """
    words = [f"{a.method}, {a.problem}: {a.status}." for a in answers if math.isnan(a.burnt)]
    for row in sum_up_peers(answers):
        if row.method.startswith(OPENSCVX_METHOD):
            planned = [a for a in answers if a.problem == row.problem and not math.isnan(a.burnt)]
            theirs = {a.start: a for a in planned if a.method == row.method}
            for method in dict.fromkeys(a.method for a in planned if a.method.startswith(OWN_METHOD)):
                ours = {a.start: a for a in planned if a.method == method}
                words += _compare(row, method, [(theirs[s], ours[s]) for s in theirs if s in ours])
    words.append(f"Where {OPENSCVX_METHOD}'s controls are not held they are linear. {FIRST_ORDER_HOLD}")
    return words


def _compare(row: PeerRow, method: str, both: Sequence[tuple[PeerAnswer, PeerAnswer]]) -> list[str]:
    """A sentence on the peer's answers of a row beside those of a method of ours; none without any."""
    if not both:
        return []
    more = [theirs.burnt - ours.burnt for theirs, ours in both]
    longer = np.median([theirs.seconds / ours.seconds for theirs, ours in both])
    return [
        f"{row.problem}: {row.method} burns {min(more):+.4f} to {max(more):+.4f} more than {method} on "
        f"{len(both)} that both plan, {float(np.median(more)):+.4f} in the median, and takes {longer:.1f} "
        "times as long."
    ]
