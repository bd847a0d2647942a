"""The unrelaxed problem by IPOPT (CasADi): true mass, true thrust bounds, no slack, free time in one solve.

    minimise    -ln m(T)
    subject to  r' = v,  v' = u + g,  (ln m)' = -|u| / c      u linear between nodes
                T_min <= m |u| <= T_max  (nonconvex)          and the limits of `guidance.problem`

The burnt mass is integrated by Simpson's rule on |u| itself. |u| is smoothed near zero, where its derivative
has a kink. A local method: where it fails, nothing is said about feasibility.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from guidance.plan import Plan, PlanStatus
from guidance.problem import LandingProblem
from guidance.reference_units import Units
from guidance.time_window import guess_time, time_window

METHOD = "casadi"
_SMOOTHING = 2e-5  # of full thrust; an engine that cannot stop needs none of it
_GLIDE_SMOOTHING = 1e-6  # of the unit of length
_MOST_ITERATIONS = 500

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Program:
    """The assembled nonlinear programme: `solver` and the bounds of its constraints."""

    solver: Any
    lower: Array
    upper: Array


def _smooth_norm(ca: Any, u: Any, smoothing: Any) -> Any:
    return ca.sqrt(ca.sum2(u * u) + smoothing**2) - smoothing


def _constraints(ca: Any, nodes: int, x: dict[str, Any], p: dict[str, Any]) -> list[tuple[Any, float, float]]:
    """(expression, lower, upper) of every constraint, on column variables."""
    r, v, u, z, time = x["r"], x["v"], x["u"], x["z"], x["time"]
    h = time / (nodes - 1)
    ones = ca.DM.ones(nodes - 1, 1)
    here, there = slice(0, nodes - 1), slice(1, nodes)
    size = _smooth_norm(ca, u, p["smoothing"])
    middle = _smooth_norm(ca, 0.5 * (u[here, :] + u[there, :]), p["smoothing"])
    burnt = p["flow"] * h * (size[here] + 4.0 * middle + size[there]) / 6.0
    pull = ones @ p["gravity"].T
    travelled = h * v[here, :] + h**2 * (u[here, :] / 3 + u[there, :] / 6 + pull / 2)
    gained = h * ((u[here, :] + u[there, :]) / 2 + pull)
    thrust = ca.exp(z) * size
    return [
        (ca.vec(r[there, :] - r[here, :] - travelled), 0.0, 0.0),
        (ca.vec(v[there, :] - v[here, :] - gained), 0.0, 0.0),
        (z[there] - z[here] + burnt, 0.0, 0.0),
        (r[0, :].T - p["position"], 0.0, 0.0),
        (v[0, :].T - p["velocity"], 0.0, 0.0),
        (ca.vertcat(z[0], r[nodes - 1, :].T, v[nodes - 1, :].T), 0.0, 0.0),
        (thrust, -math.inf, 1.0),
        (thrust - p["least_thrust"], 0.0, math.inf),
        (ca.exp(0.5 * (z[here] + z[there])) * middle - p["least_thrust"], 0.0, math.inf),  # no chattering
        (z[nodes - 1] - p["dry"], 0.0, math.inf),
        (r[1 : nodes - 1, 2], 0.0, math.inf),
    ]


@lru_cache(maxsize=8)
def _program(nodes: int, pointing: bool, glide: bool, speed: bool) -> _Program:
    """Assemble for a mesh and a set of limits; every number of the case is a parameter."""
    import casadi as ca

    x = {name: ca.SX.sym(name, nodes, 3) for name in ("r", "v", "u")}
    x["z"], x["time"] = ca.SX.sym("z", nodes), ca.SX.sym("time")
    sizes = {"position": 3, "velocity": 3, "gravity": 3, "flow": 1, "least_thrust": 1, "dry": 1}
    sizes |= {"smoothing": 1, "pointing": 1, "glide": 1, "speed": 1}
    p = {name: ca.SX.sym(name, size) for name, size in sizes.items()}
    rows = _constraints(ca, nodes, x, p)
    if pointing:
        size = _smooth_norm(ca, x["u"], p["smoothing"])
        rows.append((x["u"][:, 2] - p["pointing"] * size, 0.0, math.inf))
    inner = slice(0, nodes - 1)
    if glide:
        across = _smooth_norm(ca, x["r"][inner, :2], _GLIDE_SMOOTHING)
        rows.append((ca.sin(p["glide"]) * x["r"][inner, 2] - ca.cos(p["glide"]) * across, 0.0, math.inf))
    if speed:
        rows.append((p["speed"] ** 2 - ca.sum2(x["v"] ** 2), 0.0, math.inf))
    decision = ca.vertcat(*(ca.vec(part) for part in x.values()))
    options = {
        "print_time": 0,
        "expand": True,
        "show_eval_warnings": False,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "ipopt.max_iter": _MOST_ITERATIONS,
        # monotone takes half the iterations, and does not converge along a glide slope
        "ipopt.mu_strategy": "adaptive" if glide else "monotone",
    }
    problem = {
        "x": decision,
        "p": ca.vertcat(*p.values()),
        "f": -x["z"][nodes - 1],
        "g": ca.vertcat(*(ca.vec(part) for part, _, _ in rows)),
    }
    solver = ca.nlpsol("descent", "ipopt", problem, options)
    lower = np.concatenate([np.full(part.numel(), low) for part, low, _ in rows])
    upper = np.concatenate([np.full(part.numel(), high) for part, _, high in rows])
    return _Program(solver, lower, upper)


def _parameters(problem: LandingProblem, units: Units) -> Array:
    lander = problem.lander
    return np.concatenate(
        [
            problem.offset / units.length,
            problem.state.velocity / units.speed,
            problem.gravity / units.acceleration,
            [units.speed / lander.exhaust_velocity, lander.min_thrust / lander.max_thrust],
            [-problem.log_mass_ratio, 1e-8 if lander.min_thrust > 0.0 else _SMOOTHING],
            [math.cos(lander.pointing_limit or math.pi)],
            [problem.glide_slope_limit or 0.0, (problem.speed_limit or 0.0) / units.speed],
        ]
    )


def _pack(units: Units, problem: LandingProblem, flight: dict[str, Array]) -> Array:
    """Decision vector of a trajectory in SI."""
    mass = flight["mass"]
    return np.concatenate(
        [
            ((flight["position"] - problem.target) / units.length).ravel(order="F"),
            (flight["velocity"] / units.speed).ravel(order="F"),
            (flight["thrust"] / mass[:, None] / units.acceleration).ravel(order="F"),
            np.log(mass / problem.state.mass),
            [flight["time"][-1] / units.time],
        ]
    )


def _unpack(units: Units, problem: LandingProblem, decision: Array, nodes: int) -> dict[str, Array]:
    position, velocity, push = (
        decision[3 * nodes * k : 3 * nodes * (k + 1)].reshape(nodes, 3, order="F") for k in range(3)
    )
    mass = problem.state.mass * np.exp(decision[9 * nodes : 10 * nodes])
    return {
        "time": np.linspace(0.0, float(decision[-1]) * units.time, nodes),
        "position": position * units.length + problem.target,
        "velocity": velocity * units.speed,
        "mass": mass,
        "thrust": push * units.acceleration * mass[:, None],
    }


def _least_energy(problem: LandingProblem, nodes: int, time: float) -> dict[str, Array]:
    """First guess: the flight of least thrust acceleration squared, a cubic in time: it keeps the motion."""
    share = np.linspace(0.0, 1.0, nodes)[:, None]
    start, speed = problem.offset, problem.state.velocity * time
    second, third = -3.0 * start - 2.0 * speed, 2.0 * start + speed
    push = (2.0 * second + 6.0 * third * share) / time**2 - problem.gravity
    push[:, 2] += 1e-3 * problem.lander.max_thrust / problem.state.mass  # a zero thrust has no direction
    burnt = np.linspace(0.0, 0.5 * problem.log_mass_ratio, nodes)
    mass = problem.state.mass * np.exp(-burnt)
    return {
        "time": time * share[:, 0],
        "position": problem.target + start + speed * share + second * share**2 + third * share**3,
        "velocity": (speed + 2.0 * second * share + 3.0 * third * share**2) / time,
        "mass": mass,
        "thrust": push * mass[:, None],
    }


def _resample(problem: LandingProblem, guess: Plan, nodes: int) -> dict[str, Array]:
    """What is left of an earlier plan, from its node nearest to the start, on `nodes` nodes."""
    gap = np.linalg.norm(guess.position - problem.state.position, axis=1)
    first = min(float(guess.time[int(gap.argmin())]), 0.98 * guess.time_of_flight)
    times = np.linspace(first, guess.time_of_flight, nodes)

    def at(values: Array) -> Array:
        return np.column_stack([np.interp(times, guess.time, column) for column in values.T])

    mass = np.interp(times, guess.time, guess.mass)
    return {
        "time": times - first,
        "position": at(guess.position),
        "velocity": at(guess.velocity),
        "mass": np.minimum(mass, problem.state.mass),
        "thrust": guess.thrust_at(times),
    }


def plan_casadi(
    problem: LandingProblem, nodes: int, time_of_flight: float | None = None, guess: Plan | None = None
) -> Plan:
    """Least propellant to the target, by IPOPT on the unrelaxed problem.

    Args:
        problem: what to solve.
        nodes: N.
        time_of_flight: [s] or None to leave it free.
        guess: an earlier plan to start from; None for the flight of least energy.

    Returns:
        A plan that is OPTIMAL (a local optimum); or LIMIT_REACHED or SOLVER_FAILED, without a flight;
        INFEASIBLE only where closed-form bounds leave no time of flight.
    """
    window = time_window(problem)
    if window.empty and time_of_flight is None:
        return Plan(PlanStatus.INFEASIBLE, problem, METHOD, message=window.cause)
    units = Units.of(problem)
    pointing = problem.lander.pointing_limit is not None
    program = _program(nodes, pointing, problem.has_glide_slope, problem.speed_limit is not None)
    if guess is not None and guess.nodes:
        start = _resample(problem, guess, nodes)
    else:
        start = _least_energy(problem, nodes, time_of_flight or guess_time(problem, window))
    first = _pack(units, problem, start)
    low, high = np.full(first.size, -math.inf), np.full(first.size, math.inf)
    ends = (window.low, window.high) if time_of_flight is None else (time_of_flight, time_of_flight)
    low[-1], high[-1] = ends[0] / units.time, ends[1] / units.time
    try:
        answer = program.solver(
            x0=first, p=_parameters(problem, units), lbx=low, ubx=high, lbg=program.lower, ubg=program.upper
        )
    except RuntimeError as error:
        return Plan(PlanStatus.SOLVER_FAILED, problem, METHOD, message=str(error), solves=1)
    stats = program.solver.stats()
    if not stats["success"]:
        limited_effort = stats["unified_return_status"] == "SOLVER_RET_LIMITED"
        status = PlanStatus.LIMIT_REACHED if limited_effort else PlanStatus.SOLVER_FAILED
        return Plan(status, problem, METHOD, message=str(stats["return_status"]), solves=1)
    flight = _unpack(units, problem, np.array(answer["x"]).ravel(), nodes)
    return Plan.of_flight(PlanStatus.OPTIMAL, problem, METHOD, flight, solves=1)
