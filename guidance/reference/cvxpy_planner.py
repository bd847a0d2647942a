"""The convex problem once more, in cvxpy, written for reading: a check that shares no code with the first.

    minimise    -z_N                                     z = ln(m / m_start)
    subject to  r' = v,  v' = u + g,  z' = -s / c        u, s linear between nodes (first-order hold)
                |u| <= s,   T_min/m <= s <= T_max/m      (the last two linearised in z about a reference)
                r_z >= 0,   u_z >= s cos(pointing),  |r_xy| <= r_z tan(glide slope),  |v| <= speed limit
                r(T) = 0,  v(T) = v_f

Its units (fixed by the start, not by the time of flight), its linearisation (tangents, repeated) and its
search over the time of flight (golden section on a grid's best cell) share nothing with the fast solver.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.descent.plan import Plan, PlanStatus
from guidance.descent.problem import LandingProblem
from guidance.descent.rotating_frame import transition
from guidance.descent.trajectory import Trajectory, no_trajectory
from guidance.flight_time.time_window import forbidden_by, time_window
from guidance.golden_section import divide, keep_lower, keep_upper
from guidance.reference.units import Units

METHOD = "cvxpy"
_LINEARISATIONS = 6
_SETTLED = 2e-4  # greatest square of a change of ln(mass), in which the thrust bounds are wrong by half of it
_SETTLED_RATE = 1e-5  # the same, where its root is wrong in the rate of the thrust
_TIME_TOLERANCE = 2e-3  # relative; the optimum is flat in time


class _Structure(NamedTuple):
    """Which limits a problem has beyond the full thrust and the altitude."""

    min_thrust: bool
    pointing: bool
    glide_slope: bool
    speed: bool
    final_thrust: bool = False
    sight: bool = False
    rate: bool = False
    rotates: bool = False


class _Model(NamedTuple):
    """A problem of cvxpy, its parameters and its variables by name."""

    problem: Any
    parameters: dict[str, Any]
    variables: dict[str, Any]


@lru_cache(maxsize=8)
def _model(nodes: int, structure: _Structure) -> _Model:
    """Disciplined-parametrised problem of some nodes and limits."""
    import cvxpy as cp

    r, v, u = (cp.Variable((nodes, 3), name=name) for name in "rvu")
    z, s = cp.Variable(nodes), cp.Variable(nodes)
    p = {
        "r0": cp.Parameter(3),
        "v0": cp.Parameter(3),
        "vf": cp.Parameter(3),
        "dt": cp.Parameter(nonneg=True),
        "dt2": cp.Parameter(nonneg=True),
        "g_dt": cp.Parameter(3),
        "g_dt2": cp.Parameter(3),
        "burn": cp.Parameter(nonneg=True),  # dt / (2 c)
        "mass": cp.Parameter(nodes, nonneg=True),  # exp(z_ref)
        "offset": cp.Parameter(nodes),  # 1 + z_ref
        "ratio": cp.Parameter(nonneg=True),  # T_min / T_max
        "pointing": cp.Parameter(),
        "glide": cp.Parameter(nonneg=True),
        "speed": cp.Parameter(nonneg=True),
        "final_axis": cp.Parameter(3),
        "final_cosine": cp.Parameter(),
        "sight_along": cp.Parameter(3),
        "sight_across": cp.Parameter((3, 2)),
        "thrust_step": cp.Parameter(nonneg=True),
        "step": cp.Parameter((6, 6)),  # of the state, transposed; then of the thrust
        "first": cp.Parameter((3, 6)),
        "last": cp.Parameter((3, 6)),
        "fall": cp.Parameter((1, 6)),
    }
    ones = np.ones((nodes - 1, 1))
    g_dt, g_dt2 = (cp.reshape(p[name], (1, 3), order="C") for name in ("g_dt", "g_dt2"))
    rules = [
        r[0] == p["r0"],
        v[0] == p["v0"],
        z[0] == 0,
        r[-1] == 0,
        v[-1] == p["vf"],
        z[1:] == z[:-1] - p["burn"] * (s[:-1] + s[1:]),
        cp.norm(u, axis=1) <= s,
        cp.multiply(p["mass"], s) <= p["offset"] - z,
        r[1:-1, 2] >= 0,
    ]
    if structure.rotates:
        before, after = cp.hstack([r[:-1], v[:-1]]), cp.hstack([r[1:], v[1:]])
        pushed = u[:-1] @ p["first"] + u[1:] @ p["last"]
        rules.append(after == before @ p["step"] + pushed + ones @ p["fall"])
    else:
        rules += [
            r[1:] == r[:-1] + p["dt"] * v[:-1] + p["dt2"] * (u[:-1] / 3 + u[1:] / 6) + ones @ g_dt2 / 2,
            v[1:] == v[:-1] + p["dt"] * (u[:-1] + u[1:]) / 2 + ones @ g_dt,
        ]
    if structure.min_thrust:
        floor = cp.Variable(nodes)  # keeps each product to one parameter
        rules += [floor == p["offset"] - z, cp.multiply(p["mass"], s) >= p["ratio"] * floor]
    if structure.pointing:
        rules.append(u[:, 2] >= p["pointing"] * s)
    if structure.glide_slope:
        rules.append(cp.norm(r[:-1, :2], axis=1) <= p["glide"] * r[:-1, 2])
    if structure.speed:
        rules.append(cp.norm(v, axis=1) <= p["speed"])
    if structure.final_thrust:
        rules.append(u[-1] @ p["final_axis"] >= p["final_cosine"] * s[-1])
    if structure.sight:
        rules.append(cp.norm(r[:-1] @ p["sight_across"], axis=1) <= r[:-1] @ p["sight_along"])
    if structure.rate:
        thrust = cp.multiply(cp.reshape(p["mass"], (nodes, 1), order="C") @ np.ones((1, 3)), u)
        rules.append(cp.norm(thrust[1:] - thrust[:-1], axis=1) <= p["thrust_step"])
    return _Model(cp.Problem(cp.Minimize(-z[-1]), rules), p, {"r": r, "v": v, "u": u, "z": z, "s": s})


def forget_models() -> None:
    """Drop every compiled model; the next call of each kind states and compiles its problem anew."""
    _model.cache_clear()


def _structure(problem: LandingProblem) -> _Structure:
    return _Structure(
        problem.lander.min_thrust > 0.0,
        problem.lander.pointing_limit is not None,
        problem.has_glide_slope,
        problem.speed_limit is not None,
        problem.limits.final_thrust_direction is not None,
        problem.limits.line_of_sight is not None,
        problem.limits.thrust_rate is not None,
        problem.rotates,
    )


@dataclass(frozen=True, eq=False)
class _Flight:
    """A fixed-time answer: ln(m / m_start) at the nodes and the trajectory in SI; or bad news.

    `solves` counts the solves behind it.
    """

    time: float
    status: str
    log_mass: Array
    trajectory: Trajectory = field(default_factory=no_trajectory)
    solves: int = 1

    @property
    def log_mass_ratio(self) -> float:
        """ln(start mass / final mass); infinite without a flight."""
        return -float(self.log_mass[-1]) if self.log_mass.size else math.inf


def _solve_once(problem: LandingProblem, nodes: int, time: float, reference: Array) -> _Flight:
    """One conic solve with thrust bounds linearised at `reference`."""
    import cvxpy as cp

    units = Units.of(problem)
    model, p, x = _model(nodes, _structure(problem))
    dt = time / (nodes - 1) / units.time
    gravity = problem.pull_at_target / units.acceleration
    p["r0"].value, p["v0"].value = problem.offset / units.length, problem.state.velocity / units.speed
    p["vf"].value = problem.target_velocity / units.speed
    p["dt"].value, p["dt2"].value = dt, dt**2
    p["g_dt"].value, p["g_dt2"].value = gravity * dt, gravity * dt**2
    p["burn"].value = 0.5 * dt * units.speed / problem.lander.exhaust_velocity
    p["mass"].value, p["offset"].value = np.exp(reference), 1.0 + reference
    p["ratio"].value = problem.lander.min_thrust / problem.lander.max_thrust
    p["pointing"].value = math.cos(problem.lander.pointing_limit or math.pi)
    p["glide"].value = math.tan(problem.glide_slope_limit or 0.0)
    p["speed"].value = (problem.speed_bound or 0.0) / units.speed
    final = problem.limits.final_thrust_direction
    if final is not None:
        p["final_axis"].value, p["final_cosine"].value = final.direction, math.cos(final.angle)
    sight = problem.limits.line_of_sight
    if sight is not None:
        p["sight_along"].value = math.sin(sight.angle) * sight.direction
        p["sight_across"].value = math.cos(sight.angle) * sight.across.T
    if problem.rotates:
        turned = transition(problem.angular_velocity * units.time, dt)
        p["step"].value, p["first"].value, p["last"].value = turned.state.T, turned.first.T, turned.last.T
        p["fall"].value = ((turned.first + turned.last) @ gravity)[None]
    p["thrust_step"].value = (problem.limits.thrust_rate or 0.0) / problem.lander.max_thrust * dt * units.time
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of an inaccurate solution, which its status tells
            model.solve(solver=cp.CLARABEL, warm_start=False, ignore_dpp=False)
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # SolverError, or a panic of the solver below
        return _Flight(time, f"{type(error).__name__}: {error}", np.empty(0))
    if model.status != cp.OPTIMAL:
        return _Flight(time, str(model.status), np.empty(0))
    mass = problem.state.mass * np.exp(x["z"].value)
    trajectory = Trajectory(
        np.linspace(0.0, time, nodes),
        x["r"].value * units.length + problem.target,
        x["v"].value * units.speed,
        mass,
        x["u"].value * units.acceleration * mass[:, None],
        problem.lander.exhaust_velocity,
    )
    return _Flight(time, "optimal", np.array(x["z"].value), trajectory)


def _solve_time(problem: LandingProblem, nodes: int, time: float) -> _Flight:
    """Linearise about the last answer until it no longer moves."""
    reference = np.linspace(0.0, -0.5 * problem.log_mass_ratio, nodes)
    settled = _SETTLED if problem.limits.thrust_rate is None else _SETTLED_RATE
    flight = _solve_once(problem, nodes, time, reference)
    for solves in range(1, _LINEARISATIONS + 1):
        if not flight.log_mass.size or float(np.max((flight.log_mass - reference) ** 2)) < settled:
            break
        reference = flight.log_mass
        flight = replace(_solve_once(problem, nodes, time, reference), solves=solves + 1)
    return flight


def _solve_best_time(problem: LandingProblem, nodes: int) -> _Flight:
    """Golden section between the neighbours of the best time on a grid."""
    window = time_window(problem)
    if window.empty:
        return _Flight(math.nan, window.cause, np.empty(0), solves=0)
    grid = window.grid()
    flights = [_solve_time(problem, nodes, float(time)) for time in grid]
    solves = sum(flight.solves for flight in flights)
    at = int(np.argmin([flight.log_mass_ratio for flight in flights]))
    best = flights[at]
    if not best.log_mass.size:
        return replace(best, solves=solves)
    bracket = divide(float(grid[max(at - 1, 0)]), float(grid[min(at + 1, grid.size - 1)]))
    a, b = _solve_time(problem, nodes, bracket.first), _solve_time(problem, nodes, bracket.second)
    solves += a.solves + b.solves
    while bracket.high - bracket.low > _TIME_TOLERANCE * bracket.high:
        neither = not a.log_mass.size and not b.log_mass.size
        if a.log_mass_ratio < b.log_mass_ratio or (neither and best.time < b.time):
            bracket, b = keep_lower(bracket), a
            a = _solve_time(problem, nodes, bracket.first)
            solves += a.solves
        else:
            bracket, a = keep_upper(bracket), b
            b = _solve_time(problem, nodes, bracket.second)
            solves += b.solves
        best = min(best, a, b, key=lambda flight: flight.log_mass_ratio)
    return replace(best, solves=solves)


def plan_cvxpy(problem: LandingProblem, nodes: int, time_of_flight: float | None = None) -> Plan:
    """Least propellant to the target, by cvxpy.

    Args:
        problem: what to solve.
        nodes: N.
        time_of_flight: [s] or None to search for the best.

    Returns:
        A plan that is OPTIMAL; or INFEASIBLE (not yet proved) or SOLVER_FAILED, without a flight.
    """
    if time_of_flight is None:
        flight = _solve_best_time(problem, nodes)
    elif cause := forbidden_by(problem, time_of_flight):
        return Plan(PlanStatus.INFEASIBLE, problem, METHOD, message=cause)
    else:
        flight = _solve_time(problem, nodes, time_of_flight)
    if flight.log_mass.size and flight.log_mass_ratio <= problem.log_mass_ratio + 1e-7:
        trajectory = flight.trajectory
        least = float(np.linalg.norm(trajectory.thrust, axis=1).min())
        if least < (1.0 - 1e-3) * problem.lander.min_thrust:
            message = "the relaxed optimum thrusts below min_thrust"
            return Plan(PlanStatus.LIMIT_REACHED, problem, METHOD, message=message, solves=flight.solves)
        return Plan.of_flight(PlanStatus.OPTIMAL, problem, METHOD, trajectory, flight.solves)
    if flight.log_mass.size:
        needed = problem.state.mass * -math.expm1(-flight.log_mass_ratio)
        message = f"propellant: the cheapest flight found needs {needed:.2f} kg"
        return Plan(PlanStatus.INFEASIBLE, problem, METHOD, message=message, solves=flight.solves)
    failed = "Error" in flight.status or "Panic" in flight.status
    status = PlanStatus.SOLVER_FAILED if failed else PlanStatus.INFEASIBLE
    return Plan(status, problem, METHOD, message=flight.status, solves=flight.solves)
