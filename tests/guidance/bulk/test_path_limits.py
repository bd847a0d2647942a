"""Limits on a flown extremal, compiled: they refuse what the indirect method refuses, and say which limit."""

import math
from dataclasses import replace

import numpy as np
import pytest
from descents import GRAVITY, TARGET, harsh_start, paper_start

from guidance import PAPER_LANDER, State
from guidance.bulk.certified_flight import Finding, answer_start, vehicle_of
from guidance.descent.limits import Limits
from guidance.descent.problem import LandingProblem
from guidance.flight_time.extremal import LEGS, PrimerPath, new_extremal
from guidance.flight_time.path_limits import (
    ALTITUDE,
    GLIDE_SLOPE,
    KEPT,
    POINTING,
    SPEED,
    PathLimits,
    broken_limit,
)
from guidance.flight_time.primer_vector import find_extremal_flight, find_primer_flight

FREE = PathLimits(-math.inf, math.inf, math.inf)
NODES = 3 * LEGS + 1
OF_LIMIT = {
    Finding.LEANS: "pointing",
    Finding.BELOW_GROUND: "altitude",
    Finding.TOO_FAST: "speed",
    Finding.OFF_GLIDE_SLOPE: "glide slope",
}


def straight_down():
    """From 100 m at 10 m/s, thrust upward."""
    position, velocity, direction = np.zeros((NODES, 3)), np.zeros((NODES, 3)), np.zeros((NODES, 3))
    position[:, 2], velocity[:, 2] = np.linspace(100.0, 0.0, NODES), -10.0
    direction[:, 2] = 1.0
    return PrimerPath(position, velocity, direction)


def test_each_limit_is_broken_by_what_breaks_it():
    path = straight_down()
    assert broken_limit(path, FREE, 1.0) == KEPT
    assert broken_limit(path, PathLimits(1.0, 10.0, 1e-3), 1.0) == KEPT
    assert broken_limit(path, PathLimits(-math.inf, 9.99, math.inf), 1.0) == SPEED
    assert broken_limit(path, PathLimits(-math.inf, 19.99, math.inf), 2.0) == SPEED
    path.position[4, 2] = -1.0
    assert broken_limit(path, FREE, 1.0) == ALTITUDE
    path.position[4, 2] = -1e-5
    assert broken_limit(path, FREE, 1.0) == KEPT
    path = straight_down()
    path.position[9, 0] = 1.01 * path.position[9, 2]
    assert broken_limit(path, PathLimits(-math.inf, math.inf, math.pi / 4), 1.0) == GLIDE_SLOPE
    path.position[9, 0] = 0.99 * path.position[9, 2]
    assert broken_limit(path, PathLimits(-math.inf, math.inf, math.pi / 4), 1.0) == KEPT


def test_pointing_counts_where_the_engine_burns():
    limits = PathLimits(math.cos(0.5), math.inf, math.inf)
    for node in range(NODES):
        path = straight_down()
        path.direction[node] = [math.sin(0.6), 0.0, math.cos(0.6)]
        coasting = LEGS < node < 2 * LEGS
        assert broken_limit(path, limits, 1.0) == (KEPT if coasting else POINTING)


def test_limits_refuse_what_the_indirect_method_refuses():
    rng, seen, left = np.random.default_rng(71), dict.fromkeys(Finding, 0), 0
    for k in range(900):
        start = (paper_start, harsh_start)[k % 2](rng)
        lander = replace(PAPER_LANDER, pointing_limit=rng.uniform(0.3, 1.8)) if k % 3 == 0 else PAPER_LANDER
        glide = float(rng.uniform(0.3, math.pi / 2)) if k % 3 == 1 else None
        speed = float(rng.uniform(30.0, 90.0)) if k % 3 == 2 else None
        problem = LandingProblem(
            State.parse(start), TARGET, lander, GRAVITY, Limits(glide_slope=glide, speed=speed)
        )
        vehicle = vehicle_of(lander, GRAVITY, problem.limits)
        answer, _ = answer_start(np.array(start), TARGET, vehicle, new_extremal())
        seen[Finding(answer.finding)] += 1
        flight = find_primer_flight(problem)
        if answer.finding == Finding.OPTIMAL:
            assert flight is not None
            assert answer.propellant == pytest.approx(
                start[6] * -math.expm1(-flight.log_mass_ratio), rel=1e-9
            )
        if answer.finding == Finding.INFEASIBLE:
            assert flight is None
        left += flight is not None and answer.finding in (Finding.NO_FLIGHT, Finding.BELOW_GROUND)
        if flight is not None:
            assert answer.finding in (Finding.OPTIMAL, Finding.NO_FLIGHT, Finding.BELOW_GROUND)
        if answer.finding in OF_LIMIT and OF_LIMIT[Finding(answer.finding)] != "altitude":
            freed = replace(problem, lander=replace(lander, pointing_limit=None), limits=Limits())
            assert find_extremal_flight(freed) is not None
    assert left < 10  # of 900: what a single call finds in more than one attempt
    assert all(seen[finding] > 5 for finding in (Finding.OPTIMAL, Finding.INFEASIBLE, Finding.NO_FLIGHT))
    assert all(seen[finding] > 5 for finding in (Finding.LEANS, Finding.TOO_FAST, Finding.OFF_GLIDE_SLOPE))
