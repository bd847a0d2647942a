"""Lower bounds on the propellant of a landing, over all times of flight, with their proofs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from guidance.arrays import Array, Index
from guidance.descent.certificate import Certificate
from guidance.descent.dual_bound import DualBound, DualPiece
from guidance.descent.outer_bound import OuterBound
from guidance.descent.problem import LandingProblem
from guidance.flight_time.extremal import touches
from guidance.flight_time.primer_vector import PrimerFlight
from guidance.lower_bound.dual_ascent import two_impulse_primer
from guidance.lower_bound.dual_case import dual_case
from guidance.lower_bound.dual_function import AFFINE, THETA, linear_part
from guidance.lower_bound.neighbour_cover import NEIGHBOUR_TOLERANCE, bound_by_neighbours, kinked_primer_of
from guidance.lower_bound.time_cover import (
    GRANTED,
    CoverAim,
    TimeCover,
    best_primer,
    bound_at,
    claimed_bound,
    cover_times,
    join_cover,
)
from guidance.lower_bound.time_grid import time_grid

_CELLS = 240  # of the grid of times, up to the time to begin with
_DECISIVE = 1e-8  # of the exhaust velocity: tolerance of a bound that shall lie above the tank's content
_SCOPE = "every time of flight, in continuous time"
_CAUSES = ("maximum thrust", "propellant")
GAP_TOLERANCE = 1e-6
"""Share of the start mass that a bound may lie below the best one: 1.2 g of 1200 kg."""


def prove_least_propellant(
    problem: LandingProblem,
    propellant: float,
    time: float,
    flight: PrimerFlight | None = None,
    this_time_alone: bool = False,
) -> Certificate:
    """Bound what any flight of a landing burns, in continuous time and over all times of flight.

    The bound is tight (a few grams of the paper's 25 kg) where no limit on the path binds, and where the
    altitude or the glide slope binds at one time.

    Args:
        problem: the landing problem.
        propellant: [kg] what a known flight burns.
        time: [s] its time of flight.
        flight: what the indirect method found, to begin with.
        this_time_alone: bound the flights that last `time`, and no others.
    """
    exhaust, mass = problem.lander.exhaust_velocity, problem.state.mass
    most = -exhaust * math.log1p(-propellant / mass)
    if this_time_alone:
        bound = _bound_at(problem, most, time)
        return Certificate(f"time of flight {time:g} s, in continuous time", (), (bound,), bound.propellant)
    aim = CoverAim(most, GAP_TOLERANCE * exhaust, -math.inf)
    bound = _bound_by_cover(problem, most, *_cover(problem, most, time, flight, aim))
    return Certificate(_SCOPE, (), (bound,), bound.propellant)


def prove_no_flight(
    problem: LandingProblem, time: float, flight: PrimerFlight | None = None
) -> Certificate | None:
    """Proof that the tank does not pay for any flight of a landing; None where this bound does not show it.

    Args:
        problem: the landing problem.
        time: [s] a likely time of flight, to begin with.
        flight: an extremal of that time, to begin with.
    """
    bound = _bound_above_tank(problem, time, flight)
    if bound is None:
        return None
    causes = [name for name, without in _relaxed(problem) if _bound_above_tank(without, time) is None]
    found = certify_bound(bound)
    return replace(found, causes=(*causes, *found.causes))


def prove_no_landing(problem: LandingProblem, time: float) -> Certificate | None:
    """Proof that the tank pays for no landing anywhere in the target's plane; None where none is shown.

    Args:
        problem: the landing problem.
        time: [s] a likely time of flight, to begin with.
    """
    exhaust = problem.lander.exhaust_velocity
    most = exhaust * problem.log_mass_ratio
    target = most + 2.0 * GRANTED * exhaust
    aim = CoverAim(target, _DECISIVE * exhaust, target)
    times, cover = _cover(problem, most, time, None, aim, anywhere=True)
    return certify_bound(_bound_by_cover(problem, most, times, cover)) if cover.level >= target else None


def certify_bound(bound: DualBound) -> Certificate:
    """What a bound above the tank's content says, over all times of flight."""
    limited = any(piece.path_multiplier.any() for piece in bound.pieces)
    slope = bound.problem.has_glide_slope and not bound.anywhere
    path = ("glide slope" if slope else "altitude",) if limited else ()
    where = "every landing point in the target's plane, " if bound.anywhere else ""
    return Certificate(f"{where}{_SCOPE}: dual bound on the propellant", (*path, *_CAUSES), (bound,))


def bound_outside(
    problem: LandingProblem, time: float, anywhere: bool = False
) -> OuterBound | DualBound | None:
    """Proof that the tank pays for no flight outside a span of times, or for none; None without either.

    Args:
        problem: the landing problem.
        time: [s] a likely time of flight, to begin with.
        anywhere: whether it may land anywhere in the target's plane.
    """
    exhaust = problem.lander.exhaust_velocity
    most = exhaust * problem.log_mass_ratio
    target = most + 2.0 * GRANTED * exhaust
    aim = CoverAim(target, GAP_TOLERANCE * exhaust, -math.inf)
    times, cover = _cover(problem, most, time, None, aim, anywhere)
    case = dual_case(problem, most, anywhere)
    envelope, owner = np.full(times.size - 1, -np.inf), np.zeros(times.size - 1, np.int64)
    for number, primer in enumerate(cover.primers):
        join_cover(primer, number, times, case, envelope, owner)
    below = np.flatnonzero(envelope < target)
    beyond = linear_part(cover.primers[0], float(times[-1]), case)
    claim = claimed_bound(target, most, exhaust)
    if beyond < target:  # too little gravity: nothing forbids the times beyond the grid
        return None
    if below.size == 0:
        return DualBound(problem, most, claim, _pieces(times, owner, cover.primers))
    if below[0] == 0 or below[-1] == envelope.size - 1:
        return None
    first, last = int(below[0]), int(below[-1]) + 1
    before, after = _pieces(times, owner, cover.primers, 0, first), _pieces(times, owner, cover.primers, last)
    return OuterBound(
        DualBound(problem, most, claim, before, 0.0, float(times[first])),
        DualBound(problem, most, claim, after, float(times[last]), math.inf),
    )


def certify_cover(
    problem: LandingProblem, most: float, times: Array, cover: TimeCover, infeasible: bool = False
) -> Certificate:
    """The certificate that a cover makes.

    Args:
        problem: the landing problem.
        most: [m/s] it speaks of flights that spend no more.
        times: [s] grid of times of flight, rising from 0.
        cover: the primers that bound its cells.
        infeasible: whether the bound lies above what the tank holds: there is no flight then.
    """
    bound = _bound_by_cover(problem, most, times, cover)
    return certify_bound(bound) if infeasible else Certificate(_SCOPE, (), (bound,), bound.propellant)


def _bound_above_tank(
    problem: LandingProblem, time: float, flight: PrimerFlight | None = None
) -> DualBound | None:
    """A bound that no tank pays for, by neighbours of an extremal or by a search; None without one."""
    exhaust = problem.lander.exhaust_velocity
    most = exhaust * problem.log_mass_ratio
    target = most + 2.0 * GRANTED * exhaust
    if flight is not None and not touches(flight.extremal):
        case = dual_case(problem, most)
        level = target + NEIGHBOUR_TOLERANCE * exhaust  # so that no cell is left below the target
        times, cover = bound_by_neighbours(flight.extremal, flight.scaled, case, level, exhaust)
        if cover.level >= target:
            return _bound_by_cover(problem, most, times, cover)
    aim = CoverAim(target, _DECISIVE * exhaust, target)
    times, cover = _cover(problem, most, time, flight, aim)
    if cover.level < target <= cover.best_value and flight is not None:  # a kink may lead the search astray
        times, cover = _cover(problem, most, time, None, aim)
    return _bound_by_cover(problem, most, times, cover) if cover.level >= target else None


def _relaxed(problem: LandingProblem) -> list[tuple[str, LandingProblem]]:
    """The problem without one of its limits on the thrust, and the name of that limit."""
    lander, out = problem.lander, []
    if lander.pointing_limit is not None:
        out.append(("pointing", replace(problem, lander=replace(lander, pointing_limit=None))))
    if lander.min_thrust > 0.0:
        out.append(("minimum thrust", replace(problem, lander=replace(lander, min_thrust=0.0))))
    return out


def _cover(
    problem: LandingProblem,
    most: float,
    time: float,
    flight: PrimerFlight | None,
    aim: CoverAim,
    anywhere: bool = False,
) -> tuple[Array, TimeCover]:
    case = dual_case(problem, most, anywhere)
    times = time_grid(case, aim.target * (1.0 + 1e-12), time, _CELLS)
    start = two_impulse_primer(time, case) if flight is None else kinked_primer_of(flight.extremal, case)
    return times, cover_times(times, case, start, time, aim)


def _bound_at(problem: LandingProblem, most: float, time: float) -> DualBound:
    """What flights of one duration spend at least."""
    case = dual_case(problem, most)
    aim = CoverAim(most, GAP_TOLERANCE * problem.lander.exhaust_velocity, -math.inf)
    found = best_primer(two_impulse_primer(time, case), 0.0, time, case, aim)
    pieces = (_piece(time, time, found.primer),)
    level = bound_at(found.primer, time, case)
    return DualBound(problem, most, _claim(problem, level, most), pieces, time, time)


def _piece(begin: float, end: float, primer: Array) -> DualPiece:
    """A primer, shape (6,) or (10,), for a span of times of flight [s]."""
    if primer.size == AFFINE or not primer[AFFINE:THETA].any():
        return DualPiece(begin, end, primer[:AFFINE])
    return DualPiece(begin, end, primer[:AFFINE], primer[AFFINE:THETA], float(primer[THETA]))


def _bound_by_cover(problem: LandingProblem, most: float, times: Array, cover: TimeCover) -> DualBound:
    """What a cover of a grid of times [s] proves of the flights that spend at most `most` [m/s]."""
    pieces = _pieces(times, cover.owner, cover.primers)
    return DualBound(problem, most, _claim(problem, cover.level, most), pieces)


def _pieces(
    times: Array, owner: Index, primers: Array, first: int = 0, last: int | None = None
) -> tuple[DualPiece, ...]:
    """The cells from one to another, one piece for neighbours with one primer; None: and all times beyond."""
    owned = owner[first:last]
    starts = first + np.flatnonzero(np.diff(owned, prepend=-1))
    ends = np.append(times[starts[1:]], times[first + owned.size])
    pieces = [
        _piece(float(times[start]), float(end), primers[owner[start]])
        for start, end in zip(starts, ends, strict=True)
    ]
    if last is None:
        pieces.append(_piece(float(times[-1]), math.inf, primers[0]))
    return tuple(pieces)


def _claim(problem: LandingProblem, level: float, most: float) -> float:
    return claimed_bound(level, most, problem.lander.exhaust_velocity)
