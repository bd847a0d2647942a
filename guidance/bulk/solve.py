"""`solve_pdg_many`: the least-propellant descents from many starts, or to many targets."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numpy.typing import ArrayLike

from guidance.arrays import Array
from guidance.bulk.answers import INFEASIBLE, OPTIMAL, STATUSES, UNDECIDED, Descents
from guidance.bulk.certified_flight import Finding, Vehicle, answer_start, scale_start, vehicle_of
from guidance.bulk.cones import Cones, cones_of, keeps_cones
from guidance.bulk.sampling import Nodes, no_nodes, sample_extremal, sample_plan, set_thrust
from guidance.bulk.starts import Starts
from guidance.constants import MOON_GRAVITY
from guidance.descent.certificate import Certificate
from guidance.descent.limits import NO_LIMITS, Limits
from guidance.descent.plan import Plan
from guidance.flight_time.extremal import new_extremal
from guidance.flight_time.primer_vector import find_primer_flight
from guidance.kernel import compile_kernel
from guidance.lander import PAPER_LANDER, Lander
from guidance.lower_bound.proof import prove_least_propellant
from guidance.pdg.solve import solve_pdg, with_shorthands
from guidance.state import State
from guidance.validation import finite_number, whole_number

_CHUNK = 64  # starts that a thread takes at once
_WEAK = 4e-6  # of the start mass, 4.8 g of 1200 kg: a bound so far below its flight is searched for
_FEWEST_NODES = 2
_INDIRECT = "indirect"
_OPTIMAL_FOUND, _INFEASIBLE_FOUND = int(Finding.OPTIMAL), int(Finding.INFEASIBLE)


class _Rows(NamedTuple):
    """What is written in place, a row for each start; see `Descents`."""

    status: npt.NDArray[np.int8]
    propellant: Array
    time_of_flight: Array
    lower_bound: Array
    first_thrust: Array
    nodes: Nodes


@compile_kernel
def _answer_rows(
    span: tuple[int, int], states: Array, targets: Array, vehicle: Vehicle, cones: Cones, rows: _Rows
) -> None:
    """Answer the starts of some rows, from the first of a span to before the last."""
    x = new_extremal()
    for k in range(span[0], span[1]):
        answer, _ = answer_start(states[k], targets[k], vehicle, x)
        problem = scale_start(states[k], targets[k], vehicle)
        if answer.finding == _OPTIMAL_FOUND and not keeps_cones(x, problem, cones):
            continue
        rows.lower_bound[k] = answer.lower_bound
        if answer.finding == _INFEASIBLE_FOUND:
            rows.status[k] = INFEASIBLE
        if answer.finding != _OPTIMAL_FOUND:
            continue
        rows.status[k] = OPTIMAL
        rows.propellant[k], rows.time_of_flight[k] = answer.propellant, x.times[2]
        set_thrust(x, 0.0, vehicle.max_thrust, rows.first_thrust[k])
        if rows.nodes.time.shape[1] > 0:
            engine = vehicle.max_thrust, states[k, 6]
            sample_extremal(x, problem, engine, targets[k], k, rows.nodes)


def solve_pdg_many(
    states: State | ArrayLike,
    targets: ArrayLike,
    *,
    lander: Lander = PAPER_LANDER,
    gravity: ArrayLike = MOON_GRAVITY,
    angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
    target_velocity: ArrayLike = (0.0, 0.0, 0.0),
    limits: Limits = NO_LIMITS,
    glide_slope_limit: float | None = None,
    speed_limit: float | None = None,
    nodes: int | None = None,
    fallback: bool = True,
    threads: int | None = None,
) -> Descents:
    """Plan the descents of least propellant from N states to one target, from one to N, or from N to N.

    Compiled code answers the starts whose flight the indirect method finds, within every limit, and proves
    what no flight undercuts; `solve_pdg` answers the rest, one after another on one core. That is every start
    with a target velocity, a turning site, a least thrust or a limited thrust rate, without gravity, at its
    target's altitude, or with an engine that hardly lifts it or does not. Of other starts it is those for
    which the compiled code finds no flight, finds one that breaks a limit, or finds one that burns more than
    there is and cannot prove that all do.

    Args:
        states: State or (x, y, z, vx, vy, vz, mass), shape (7,) or (N, 7).
        targets: [m] shape (3,) or (N, 3), site frame; no flight goes below its target's altitude.
        lander: the vehicle. Its pointing limit is measured from the z axis.
        gravity: [m/s^2] shape (3,).
        angular_velocity: [rad/s] shape (3,), of the site frame about an axis through its origin.
        target_velocity: [m/s] shape (3,), at the targets.
        limits: what the paths have to keep.
        glide_slope_limit: [rad] shorthand for `limits.glide_slope`.
        speed_limit: [m/s] shorthand for `limits.speed`.
        nodes: n at least 2, for each flight at n equal steps of its time; None for none.
        fallback: whether `solve_pdg` is asked where the compiled code has no answer; those starts are else
            'limit reached': nothing is known of them.
        threads: that share the work; None for one a core. The answers do not depend on it.

    Returns:
        A row for each start, in order; its `method` says who answered.

    Raises:
        ValueError: an argument is out of range, not finite or of the wrong shape, or a start lies below its
            target's altitude or has no propellant; the first such row is named.
    """
    limits = with_shorthands(limits, glide_slope=glide_slope_limit, speed=speed_limit)
    vectors = {"gravity": gravity, "target_velocity": target_velocity, "angular_velocity": angular_velocity}
    starts = Starts.parse(states, targets, lander, limits, **vectors)
    rows, threads = _no_rows(len(starts), _node_count(nodes)), _thread_count(threads)
    certificates = _answer_all(starts, rows, threads) if starts.in_bulk else {}
    method = np.full(len(starts), "", "<U8")
    method[rows.status != UNDECIDED] = _INDIRECT
    if fallback:
        for k in np.flatnonzero(rows.status == UNDECIDED).tolist():
            plan = _ask(starts, k)
            _write_plan(plan, k, rows)
            method[k], certificates[k] = plan.method, plan.certificate
    return Descents(
        starts,
        rows.status,
        rows.propellant,
        rows.time_of_flight,
        rows.lower_bound,
        rows.first_thrust,
        method,
        None if nodes is None else rows.nodes,
        certificates,
    )


def _no_rows(starts: int, nodes: int) -> _Rows:
    """Rows to be written."""
    propellant, time_of_flight, lower_bound = (np.full(starts, np.nan) for _ in range(3))
    status, first_thrust = np.full(starts, UNDECIDED, np.int8), np.full((starts, 3), np.nan)
    return _Rows(status, propellant, time_of_flight, lower_bound, first_thrust, no_nodes(starts, nodes))


def _node_count(nodes: int | None) -> int:
    if nodes is None:
        return 0
    return whole_number("nodes", nodes, _FEWEST_NODES)


def _thread_count(threads: int | None) -> int:
    return os.cpu_count() or 1 if threads is None else int(finite_number("threads", threads, at_least=1))


def _answer_all(starts: Starts, rows: _Rows, threads: int) -> dict[int, Certificate | None]:
    """Answer every start that compiled code can; it holds no lock, so that threads work at once.

    Returns:
        Certificates of the bounds that had to be searched for, by row.
    """
    vehicle, cones = vehicle_of(starts.lander, starts.gravity, starts.limits), cones_of(starts.limits)
    spans = [(k, min(k + _CHUNK, len(starts))) for k in range(0, len(starts), _CHUNK)]

    def answer(span: tuple[int, int]) -> dict[int, Certificate | None]:
        begin, end = span
        _answer_rows(span, starts.states, starts.targets, vehicle, cones, rows)
        gap = rows.propellant[begin:end] - rows.lower_bound[begin:end]
        weak = begin + np.flatnonzero(gap > _WEAK * starts.states[begin:end, 6])
        better = {k: _tighten(starts, k, rows) for k in weak.tolist()}
        return {k: certificate for k, certificate in better.items() if certificate is not None}

    found = [answer(span) for span in spans[:1]]  # compiles
    if min(threads, len(spans)) <= 1:
        found += [answer(span) for span in spans[1:]]
    else:
        with ThreadPoolExecutor(min(threads, len(spans))) as pool:
            found += pool.map(answer, spans[1:])
    return {k: certificate for part in found for k, certificate in part.items()}


def _tighten(starts: Starts, row: int, rows: _Rows) -> Certificate | None:
    """Search for a better bound of a flight that was found, and write it; None where it is none."""
    problem = starts.problem(row)
    known = float(rows.propellant[row]), float(rows.time_of_flight[row])
    certificate = prove_least_propellant(problem, *known, find_primer_flight(problem))
    if not certificate.lower_bound > rows.lower_bound[row]:
        return None
    rows.lower_bound[row] = certificate.lower_bound
    return certificate


def _ask(starts: Starts, index: int) -> Plan:
    return solve_pdg(
        starts.states[index],
        starts.targets[index],
        lander=starts.lander,
        gravity=starts.gravity,
        angular_velocity=starts.angular_velocity,
        target_velocity=starts.target_velocity,
        limits=starts.limits,
        throw=False,
    )


def _write_plan(plan: Plan, row: int, rows: _Rows) -> None:
    rows.status[row] = STATUSES.index(plan.status)
    if plan.certificate is not None:
        rows.lower_bound[row] = plan.certificate.lower_bound
    if plan.status.has_flight:
        rows.propellant[row], rows.time_of_flight[row] = plan.propellant, plan.time_of_flight
        rows.first_thrust[row] = plan.thrust[0]
        if rows.nodes.time.shape[1] > 0:
            sample_plan(plan, row, rows.nodes)
