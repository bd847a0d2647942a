"""Extremals that no first guess reaches, followed from problems with more thrust or from lower starts."""

import numpy as np
import pytest
from descents import GRAVITY, TARGET, harsh_start, paper_start

import guidance
from guidance import PAPER_LANDER, PlanStatus, State
from guidance.descent.problem import LandingProblem
from guidance.flight_time.continuation import (
    _set_lowest,
    raise_touch,
    solve_from_impulses,
    solve_touching_from_edge,
)
from guidance.flight_time.extremal import Burn, Extremal, add_burn, blank_extremal, fly_extremal
from guidance.flight_time.path_limits import burnt_share
from guidance.flight_time.primer_equations import TOUCHING, solve_primer, solve_touching
from guidance.flight_time.primer_vector import scale_landing

BY_MORE_THRUST = [
    [-21.0, -0.3, 235.3, -19.1, 27.1, -47.9, 1189.9],
    [28.7, 7.0, 227.0, -11.8, -24.6, -46.5, 1197.5],
    [-114.6, -1.2, 277.5, 24.4, -20.9, -52.5, 1191.2],
    [58.7, 57.5, 203.2, -4.0, -10.1, -50.0, 1182.5],  # its coast is short
]
"""Their first burns last longer than half the flight: none of the first guesses leads to these."""
FROM_LOWER_STARTS = [
    [-4.6, -8.7, 192.4, -12.1, 5.2, -47.0, 1179.0],
    [-3.7, 58.0, 189.8, 10.2, -16.4, -46.8, 1175.7],  # hops over a decimetre
    [-21.2, 3.1, 238.8, 25.3, 0.6, -51.2, 1189.6],
]


FROM_BELOW = [
    [-4.4, 63.4, 116.3, -1.0, -16.3, -33.5, 1179.5],
    [-144.9, 58.7, 145.5, 22.6, -8.9, -40.1, 1196.1],
]
"""Their extremals that ignore the ground cut through it; nothing else leads to those that touch it."""


def scaled(start):
    return scale_landing(LandingProblem(State.parse(start), TARGET, PAPER_LANDER, GRAVITY))


def numbers(x: Extremal):
    return np.concatenate([x.primer.ravel(), x.times, np.where(np.isfinite(x.touch), x.touch, 0.0)])


@pytest.mark.parametrize("start", [*BY_MORE_THRUST, *FROM_LOWER_STARTS, *FROM_BELOW])
def test_the_cones_find_the_same_flight_on_a_fine_mesh(start):
    plan = guidance.solve_pdg(start, TARGET)
    convex = guidance.solve_pdg(start, TARGET, method="convex", nodes=201)
    assert plan.method == "indirect"
    assert plan.propellant == pytest.approx(convex.propellant, abs=0.01)
    assert plan.keeps_limits
    assert plan.certificate is not None
    assert plan.certificate.verified


@pytest.mark.parametrize("start", BY_MORE_THRUST)
def test_no_first_guess_leads_there_and_more_thrust_does(start):
    x = blank_extremal()
    assert not solve_primer(scaled(start), x)
    assert solve_from_impulses(scaled(start), x)


@pytest.mark.parametrize("start", FROM_LOWER_STARTS)
def test_no_first_guess_touches_the_ground_there_and_lower_starts_lead_to_one_that_does(start):
    x = blank_extremal()
    assert not solve_touching(scaled(start), x)
    assert solve_touching_from_edge(scaled(start), x)
    assert x.touch[1] > 0.0


@pytest.mark.parametrize("start", FROM_BELOW)
def test_the_lowest_altitude_of_a_first_burn_is_that_of_the_burn_sampled_finely(start):
    problem, x = scaled(start), blank_extremal()
    assert solve_primer(problem, x)
    assert _set_lowest(problem, x)
    time, lowest = x.touch[0], x.touch[2]
    state, mass, step = np.hstack([problem.position, problem.velocity]), 1.0, x.times[0] / 1000
    heights = [state[2]]
    x.touch[:] = -np.inf, 0.0, 0.0
    for k in range(1000):
        state[:3] += step * state[3:] + 0.5 * step**2 * problem.gravity
        state[3:] += step * problem.gravity
        add_burn(x, Burn(k * step, (k + 1) * step, mass), problem.mass_flow, (k + 1) * step, state)
        mass -= problem.mass_flow * step
        heights.append(state[2])
    assert lowest < 0.0
    assert lowest == pytest.approx(min(heights), rel=5e-3)  # the acceleration changes within a part
    assert time == pytest.approx(step * int(np.argmin(heights)), abs=x.times[0] / 200)


@pytest.mark.parametrize("start", FROM_BELOW)
def test_an_extremal_that_cuts_through_the_ground_is_raised_until_it_touches_it(start):
    problem, x = scaled(start), blank_extremal()
    assert solve_primer(problem, x)
    free = burnt_share(x, problem.mass_flow)
    assert raise_touch(problem, TOUCHING, x)
    assert x.touch[1] > 0.0
    assert burnt_share(x, problem.mass_flow) > free
    assert fly_extremal(x, problem).position[:, 2].min() > -1e-9
    assert not solve_touching(problem, blank_extremal())
    assert not raise_touch(problem, TOUCHING, x)  # it does not cut through any more
    assert guidance.solve_pdg(start, TARGET).optimality_gap < 0.02


def test_raised_or_guessed_it_is_the_same_touch():
    rng, compared = np.random.default_rng(6), 0
    for _ in range(400):
        problem, known, other = scaled(harsh_start(rng)), blank_extremal(), blank_extremal()
        if not (solve_touching(problem, known) and known.touch[1] > 0.0 and solve_primer(problem, other)):
            continue
        if raise_touch(problem, TOUCHING, other):
            compared += 1
            np.testing.assert_allclose(numbers(other), numbers(known), rtol=1e-4, atol=1e-4)
    assert compared >= 5


def test_both_ways_lead_to_the_extremal_that_a_first_guess_finds():
    rng, by_thrust, by_height = np.random.default_rng(5), 0, 0
    for k in range(600):
        problem = scaled(harsh_start(rng) if k % 3 else paper_start(rng))
        known, other = blank_extremal(), blank_extremal()
        if solve_primer(problem, known) and solve_from_impulses(problem, other) and known.times[0] > 0.0:
            by_thrust += 1
            np.testing.assert_allclose(numbers(other), numbers(known), atol=1e-5)
        known, other = blank_extremal(), blank_extremal()
        if solve_touching(problem, known) and solve_touching_from_edge(problem, other):
            by_height += 1
            np.testing.assert_allclose(numbers(other), numbers(known), rtol=1e-4, atol=1e-4)
    assert by_thrust >= 200
    assert by_height >= 8


def test_a_start_that_does_not_sink_or_an_engine_too_weak_has_no_edge():
    x = blank_extremal()
    assert not solve_touching_from_edge(scaled([50.0, 0.0, 150.0, 5.0, 0.0, 3.0, 1200.0]), x)
    weak = scaled([50.0, 0.0, 150.0, 5.0, 0.0, -3.0, 1200.0])._replace(gravity=np.array([0.0, 0.0, -1.0]))
    assert not solve_touching_from_edge(weak, x)
    assert not solve_from_impulses(weak, x)


def test_a_start_below_the_edge_touches_nothing():
    x = blank_extremal()
    assert not solve_touching_from_edge(scaled([0.0, 10.0, 60.0, 5.0, 0.0, -50.0, 1200.0]), x)


def test_the_flight_that_only_more_thrust_leads_to_may_overdraw_the_tank():
    plan = guidance.solve_pdg([28.5, 1.1, 208.8, -26.0, -4.3, -45.7, 1175.4], TARGET, throw=False)
    assert plan.status is PlanStatus.INFEASIBLE
    assert plan.method == "dual bound"
    assert plan.certificate is not None
    assert plan.certificate.verified
