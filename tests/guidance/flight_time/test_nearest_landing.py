"""The nearest landing by the indirect method: affordable, nothing nearer is, the convex problem agrees."""

import math
from dataclasses import replace

import numpy as np
import pytest
from descents import GRAVITY, TARGET, harsh_start

from guidance import PAPER_LANDER, Cone, Limits, PlanStatus, State, solve_pdg
from guidance.descent.problem import LandingProblem
from guidance.flight_time.extremal import touches
from guidance.flight_time.nearest_landing import ERROR_SHARE, ERROR_SLACK, find_nearest_landing
from guidance.flight_time.path_limits import KEPT, PROPELLANT
from guidance.flight_time.primer_vector import find_extremal_flight
from guidance.planning.indirect_planner import TANK_ALL_BUT_EMPTY, plan_nearest_indirect

MESH = 0.01  # [m] of landing error that a mesh may save where it does not cut through the ground


def overdrawn_problems(seed, count):
    """Problems whose extremal burns more than there is, with that extremal."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        problem = LandingProblem(State.parse(harsh_start(rng)), TARGET, PAPER_LANDER, GRAVITY)
        flight = find_extremal_flight(problem)
        if flight is not None and flight.broken == PROPELLANT:
            yield problem, flight


def nearest_landings(seed, count):
    found = [
        (problem, find_nearest_landing(problem, flight))
        for problem, flight in overdrawn_problems(seed, count)
    ]
    return [(problem, nearest) for problem, nearest in found if nearest.flight is not None]


def test_it_lands_within_the_tank_and_the_primer_points_at_the_target():
    found, touching, costly = nearest_landings(71, 300), 0, 0
    assert len(found) > 25
    for problem, nearest in found:
        flight, miss = nearest.flight, nearest.problem.target - problem.target
        assert flight is not None
        assert flight.broken == KEPT
        assert miss[2] == 0.0
        error = math.hypot(miss[0], miss[1])
        assert error > 0.0
        assert flight.log_mass_ratio <= problem.log_mass_ratio
        slope = flight.extremal.primer[0, :2] - flight.extremal.primer[1, :2]
        assert slope @ miss[:2] == pytest.approx(-np.linalg.norm(slope) * error, rel=1e-9)
        touching += touches(flight.extremal)
        left = 1.0 - flight.log_mass_ratio / problem.log_mass_ratio
        assert (left > 1e-6) == nearest.cheapest
        if not nearest.cheapest:
            costly += 1
            plan = plan_nearest_indirect(problem, 31, nearest)
            assert plan.status is PlanStatus.NEAREST
            assert plan.message.endswith(TANK_ALL_BUT_EMPTY)
    assert touching > 0
    assert 0 < costly < 5  # of about fifty


def test_nothing_nearer_is_affordable():
    """A step within 60 degrees of the way to the target, of more than was granted, empties the tank."""
    compared = 0
    for problem, nearest in nearest_landings(72, 200):
        miss = nearest.problem.target - problem.target
        error = math.hypot(miss[0], miss[1])
        step = min(2.0 * (ERROR_SLACK + ERROR_SHARE * error) + 1.0, 0.5 * error)
        for turn in np.linspace(-math.pi / 3.0, math.pi / 3.0, 5):
            way = (
                -np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
                @ miss[:2]
                / error
            )
            there = replace(nearest.problem, target=nearest.problem.target + np.append(step * way, 0.0))
            dearer = find_extremal_flight(there)
            compared += dearer is not None
            assert dearer is None or dearer.broken == PROPELLANT
    assert compared > 50


def test_the_granted_error_is_what_it_says():
    """A point as much nearer as was granted is on the edge of what the tank pays for."""
    compared = 0
    for problem, nearest in nearest_landings(73, 60):
        miss = nearest.problem.target - problem.target
        least = (math.hypot(miss[0], miss[1]) - ERROR_SLACK) / (1.0 + ERROR_SHARE)
        scale = least / math.hypot(miss[0], miss[1])
        edge = find_extremal_flight(replace(problem, target=problem.target + scale * miss))
        if edge is not None and least > 0.0:
            compared += 1
            assert edge.log_mass_ratio == pytest.approx(problem.log_mass_ratio, rel=1e-5)
    assert compared > 3


def test_the_convex_problem_lands_no_nearer():
    rng, compared = np.random.default_rng(74), 0
    for _ in range(60):
        start = harsh_start(rng)
        plan = solve_pdg(start, TARGET, unreachable="nearest", throw=False)
        if plan.status is not PlanStatus.NEAREST or plan.method != "indirect":
            continue
        other = solve_pdg(start, TARGET, unreachable="nearest", throw=False, method="convex")
        assert plan.keeps_limits
        assert plan.position[-1, 2] == pytest.approx(TARGET[2], abs=1e-6)
        assert plan.message == "nearest" or plan.message.endswith(TANK_ALL_BUT_EMPTY)
        if other.residuals.altitude < 1e-3:
            compared += 1
            assert plan.landing_error < other.landing_error + MESH + ERROR_SHARE * other.landing_error
            assert plan.landing_error > other.landing_error - 2.0
    assert compared >= 5


def test_in_a_plane_it_stays_in_the_plane():
    start = [400.0, 0.0, 150.0, 10.0, 0.0, -5.0, 1165.0]
    plan = solve_pdg(start, TARGET, unreachable="nearest")
    assert plan.status is PlanStatus.NEAREST
    assert plan.method == "indirect"
    assert plan.position[:, 1] == pytest.approx(0.0, abs=1e-6)


def test_it_is_sought_only_where_the_tank_is_what_lacks():
    problem, flight = next(overdrawn_problems(75, 100))
    assert find_nearest_landing(problem, replace(flight, broken=KEPT)).flight is None
    sight = Limits(line_of_sight=Cone(1.5))
    assert find_nearest_landing(replace(problem, limits=sight), flight).flight is None
