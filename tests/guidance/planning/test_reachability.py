"""Reachable sites: both sides of the edge against `solve_pdg`, symmetry, and what makes the set grow."""

from dataclasses import replace

import numpy as np
import pytest
from descents import GRAVITY

from guidance import PAPER_LANDER, PlanStatus, State, solve_pdg
from guidance.descent.problem import LandingProblem
from guidance.planning.reachability import DEFAULT_NODES, ReachableSet, reachable_set

PLANE = np.array([0.0, 0.0, 50.0])


def low(velocity=(6.0, -3.0, -40.0), mass: float = 1185.0) -> LandingProblem:
    """Well into the last burn, where reach is short."""
    state = State(np.array([30.0, 10.0, 250.0]), np.array(velocity), mass)
    return LandingProblem(state, PLANE, PAPER_LANDER, GRAVITY)


@pytest.fixture(scope="module")
def reach() -> ReachableSet:
    return reachable_set(low(), directions=8)


def feasible(problem: LandingProblem, site: np.ndarray, time: float) -> bool:
    plan = solve_pdg(
        problem.state,
        [site[0], site[1], 50.0],
        gravity=GRAVITY,
        time_of_flight=time,
        nodes=DEFAULT_NODES,
        throw=False,
    )
    return plan.status is PlanStatus.OPTIMAL


def test_sites_inside_are_reached_and_sites_outside_are_not(reach):
    problem = low()
    assert len(reach.slices) == 2
    for part in reach.slices:
        middle = part.vertices.mean(axis=0)
        for vertex in part.vertices[::2]:
            assert feasible(problem, middle + 0.97 * (vertex - middle), part.time)
        for facet, vertex in zip(part.outer[1::2], part.vertices[1::2], strict=True):
            assert not feasible(
                problem, vertex + facet[:2] * (0.02 * np.linalg.norm(vertex - middle)), part.time
            )


def test_the_inner_bound_lies_within_the_outer_one(reach):
    rng = np.random.default_rng(0)
    sites = np.concatenate([rng.uniform(-400.0, 400.0, (4000, 2)), rng.uniform(-60.0, 80.0, (500, 2))])
    inside, possible = reach.contains(sites), reach.may_contain(sites)
    assert inside.sum() > 50
    assert (~possible).sum() > 50
    assert possible[inside].all()
    for part in reach.slices:
        gap = part.vertices @ part.outer[:, :2].T + part.outer[:, 2]
        assert gap.max() < 0.02 * np.ptp(part.vertices)  # no reachable point outside


def test_it_is_symmetric_about_a_vertical_fall():
    reach = reachable_set(low(velocity=(0.0, 0.0, -40.0)), directions=8)
    for part in reach.slices:
        radius = np.linalg.norm(part.vertices - [30.0, 10.0], axis=1)
        assert np.ptp(radius) < 0.01 * radius.mean()


def test_less_propellant_and_less_thrust_shrink_it():
    problem = low()
    time = [12.0]
    full = reachable_set(problem, times=time)
    weak = reachable_set(replace(problem, lander=replace(PAPER_LANDER, max_thrust=10000.0)), times=time)
    lean = reachable_set(low(mass=1172.0), times=time)
    assert weak.slices
    assert full.contains(weak.slices[0].vertices * 0.99 + 0.01 * full.slices[0].vertices.mean(axis=0)).all()
    area = [np.ptp(part.slices[0].vertices, axis=0).prod() for part in (full, weak)]
    assert area[1] < area[0]
    assert not lean.slices or np.ptp(lean.slices[0].vertices) < np.ptp(full.slices[0].vertices)


def test_a_fall_that_cannot_be_stopped_reaches_nothing():
    state = State(np.array([0.0, 0.0, 70.0]), np.array([0.0, 0.0, -60.0]), 1180.0)
    reach = reachable_set(LandingProblem(state, PLANE, PAPER_LANDER, GRAVITY))
    assert reach.slices == ()
    assert not reach.contains(np.zeros((3, 2))).any()


def test_wrong_arguments_are_named():
    with pytest.raises(ValueError, match="directions"):
        reachable_set(low(), directions=2)
    with pytest.raises(ValueError, match="times"):
        reachable_set(low(), times=[-1.0])
