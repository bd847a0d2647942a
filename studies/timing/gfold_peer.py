"""The PyPI package `gfold` (Rust, on Clarabel) asked the same landing problem.

Its mesh has n nodes and steps of t/n, so that a flight asked to last t lasts t (n - 1)/n: asked for a fixed
time, it is asked for t n/(n - 1) here, and its plans are laid on the steps it flew. With no least thrust it
divides by it and fails; 0.1 % of the full thrust is asked instead. Its own bracket
of the time of flight (up to all propellant burnt at the least thrust) holds no feasible sample then; it is
given the closed-form window. Its log-mass bounds are linearised once, at full thrust from the start, hence a
little too tight. It reads positions from the origin, so the target stands there. Version 0.3.2 takes a
pointing limit and does not keep it: whoever compares must look at the flown residuals.
"""

from __future__ import annotations

import importlib
import importlib.util
import math
from typing import Any

import numpy as np

from guidance.descent.plan import Plan, PlanStatus
from guidance.descent.problem import LandingProblem
from guidance.descent.trajectory import Trajectory
from guidance.flight_time.time_window import time_window

PEER_METHOD = "gfold"
"""Its name in tables, and the package's."""
FREE_TIME_SOLVES = 36
"""A sweep of 13 times, golden section with 2 + 20, and the last one: fixed in its source."""
_LEAST_THRUST = 1e-3  # of the full thrust, where the lander can stop its engine
_FASTEST = 1e4  # [m/s] no speed limit


def gfold_present() -> bool:
    """Whether the package is installed (optional extra `peers`)."""
    return importlib.util.find_spec(PEER_METHOD) is not None


def gfold_config(problem: LandingProblem, nodes: int, time_of_flight: float | None) -> Any:
    """The package's description of a problem; the flight lasts `time_of_flight` [s], None to search."""
    gfold = importlib.import_module(PEER_METHOD)
    lander, glide = problem.lander, problem.glide_slope_limit
    window = time_window(problem)
    stretch = nodes / (nodes - 1)
    spacecraft = gfold.Spacecraft(
        wet_mass=problem.state.mass,
        fuel=problem.state.mass - lander.dry_mass,
        real_max_thrust=lander.max_thrust,
        min_thrust_pct=max(lander.min_thrust / lander.max_thrust, _LEAST_THRUST),
        max_thrust_pct=1.0,
        max_velocity=_FASTEST if problem.speed_limit is None else problem.speed_limit,
        initial_position=problem.offset.tolist(),
        initial_velocity=problem.state.velocity.tolist(),
        target_position=[0.0, 0.0, 0.0],
        target_velocity=[0.0, 0.0, 0.0],
        fuel_consumption=1.0 / lander.exhaust_velocity,
    )
    environment = gfold.Environment(
        gravity=problem.gravity.tolist(),
        glide_slope_angle_deg=0.0 if glide is None else 90.0 - math.degrees(glide),
        max_angle_deg=180.0 if lander.pointing_limit is None else math.degrees(lander.pointing_limit),
    )
    solver = gfold.Solver(
        n=nodes,
        time_of_flight=None if time_of_flight is None else time_of_flight * stretch,
        tof_min=window.low * stretch,
        tof_max=window.high * stretch,
    )
    return gfold.Config(spacecraft=spacecraft, environment=environment, solver=solver)


def plan_gfold(problem: LandingProblem, nodes: int, time_of_flight: float | None = None) -> Plan:
    """Least propellant to the target, by the package.

    Returns:
        A plan that is OPTIMAL on the steps that the package flew; INFEASIBLE (unproved) or SOLVER_FAILED,
        with its words, without a flight.

    Raises:
        ImportError: the package is not installed.
    """
    gfold = importlib.import_module(PEER_METHOD)
    solves = FREE_TIME_SOLVES if time_of_flight is None else 1
    try:
        answer = gfold.solve(gfold_config(problem, nodes, time_of_flight))
    except ValueError as error:
        refused = "infeasible" in str(error).lower()  # its word; it gives no proof
        status = PlanStatus.INFEASIBLE if refused else PlanStatus.SOLVER_FAILED
        return Plan(status, problem, PEER_METHOD, message=str(error), solves=solves)
    mass = np.exp(np.array(answer.z_values))
    flight = Trajectory(
        np.array(answer.time_points),
        np.array(answer.positions) + problem.target,
        np.array(answer.velocities),
        mass,
        np.array(answer.u_values) * mass[:, None],
        problem.lander.exhaust_velocity,
    )
    return Plan.of_flight(PlanStatus.OPTIMAL, problem, PEER_METHOD, flight, solves)
