"""The search over the time of flight on costs with known optima, and the closed-form window."""

import math
from typing import cast

import numpy as np
import pytest
from descents import FEASIBLE, GRAVITY, IMPOSSIBLE, TARGET, feasible_start, problem_of
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq
from timed_costs import Sample, hyperbola

from guidance import PAPER_LANDER, Lander, State
from guidance.descent.problem import LandingProblem
from guidance.flight_time.search import TimeModel, TimeSearch
from guidance.flight_time.time_window import TimeWindow, guess_time, time_window
from guidance.planning.convex_task import ConvexTask
from guidance.planning.minimum_propellant import minimise_over_time


def search(evaluate, window=(1.0, 100.0), guess=20.0, tolerance=1e-4, asymptote=1.0):
    run = TimeSearch(evaluate, TimeWindow(*window), tolerance, TimeModel(asymptote))
    return run.run(guess), run


@given(b=st.floats(5.0, 300.0), c=st.floats(1.5, 10.0), guess=st.floats(12.0, 90.0))
def test_finds_the_optimum_of_a_hyperbola_in_few_solves(b, c, guess):
    best, run = search(hyperbola(1.0, b, c), guess=guess)
    optimum = c + math.sqrt(b)
    assert best is not None
    assert best.value - (optimum + b / (optimum - c)) < 3e-4
    assert len(run.samples) <= 12


@given(kink=st.floats(15.0, 60.0), left=st.floats(0.1, 20.0), guess=st.floats(5.0, 95.0))
def test_finds_a_kink(kink, left, guess):
    def evaluate(time):
        slope = 0.9 if time >= kink else -left
        return Sample(time, slope * (time - kink), slope)

    best, run = search(evaluate, guess=guess)
    assert best is not None
    assert best.value < 1e-3
    assert len(run.samples) <= 40


@given(edge=st.floats(16.0, 60.0), guess=st.floats(5.0, 95.0))
def test_optimum_at_the_edge_of_feasibility(edge, guess):
    """One-sided: every time below `edge` is infeasible, and the cost rises from there."""
    best, _ = search(hyperbola(feasible=(edge, math.inf)), guess=guess)
    cost = hyperbola()(edge).value
    assert best is not None
    assert best.time >= edge
    assert best.value - cost < 2e-3


def test_optimum_at_the_ends_of_the_window():
    falling, _ = search(lambda t: Sample(t, -t, -1.0))
    assert falling is not None
    assert falling.time == 100.0
    rising, _ = search(lambda t: Sample(t, t, 0.9))
    assert rising is not None
    assert rising.time == pytest.approx(1.0)


def test_narrow_feasible_window_is_found_by_the_grid():
    best, run = search(hyperbola(c=2.0, feasible=(40.0, 50.0)), guess=20.0)
    assert best is not None
    assert 40.0 <= best.time <= 50.0
    assert best.time == pytest.approx(40.0, abs=0.05)
    assert len(run.samples) <= 40


def test_no_feasible_time_ends_with_none_after_the_grid():
    best, run = search(lambda t: Sample(t, solved=False))
    assert best is None
    assert len(run.samples) == len(TimeWindow(1.0, 100.0).grid()) + 1


@pytest.mark.parametrize("seed", range(40))
def test_window_holds_the_flight_that_made_the_start(seed):
    """The optimum found anywhere lies in the window, and the window excludes nothing that flies."""
    start = feasible_start(np.random.default_rng(seed))
    problem = LandingProblem(State.parse(start), TARGET, PAPER_LANDER, GRAVITY)
    window = time_window(problem)
    assert not window.empty
    free = time_window(problem, free_landing_point=True)
    assert free.low <= window.low + 1e-9
    assert free.high >= window.high - 1e-9
    assert window.low <= guess_time(problem, window) <= window.high


@pytest.mark.parametrize("case", FEASIBLE, ids=lambda case: case["name"])
def test_no_time_outside_the_window_is_feasible(case):
    problem = problem_of(case)
    window = time_window(problem)
    assert window.low < case["optimal_time_of_flight"] < window.high
    task = ConvexTask(problem, 31, limit_propellant=True)
    for time in (0.5 * window.low, 0.97 * window.low, 1.03 * window.high, 2.0 * window.high):
        assert not task.solve(time).solved


@pytest.mark.parametrize("case", IMPOSSIBLE, ids=lambda case: case["name"])
def test_closed_form_bounds_settle_the_impossible_cases(case):
    window = time_window(problem_of(case))
    assert window.empty
    assert window.cause in ("propellant", "altitude")


def test_window_without_gravity_is_bounded():
    problem = LandingProblem(State.parse([100, 0, 500, 0, 0, -5, 1200]), TARGET, PAPER_LANDER, np.zeros(3))
    window = time_window(problem)
    assert 0.0 < window.low < window.high < 1e4


def test_agrees_with_a_fine_scan():
    """The time search against brute force over a grid of times."""
    case = FEASIBLE[1]
    task = ConvexTask(problem_of(case), 31)
    found = minimise_over_time(task).solution
    assert found is not None
    scan = [task.solve(time) for time in np.linspace(23.0, 32.0, 91)]
    best = min(s.value for s in scan if s.solved)
    assert found.value < best + 6e-6


@pytest.mark.parametrize(("low", "high", "count"), [(10.0, 10.01, 4), (10.0, 20.0, 13), (1.0, 1000.0, 24)])
def test_a_grid_goes_from_end_to_end_of_its_window_in_equal_ratios(low, high, count):
    grid = TimeWindow(low, high).grid()
    assert grid.size == count
    assert grid[[0, -1]] == pytest.approx([low, high])
    ratios = grid[1:] / grid[:-1]
    assert ratios == pytest.approx(ratios[0])
    assert ratios[0] <= 1.06 + 1e-12 or count == 24


@pytest.mark.parametrize("climb", [-30.0, 0.0, 12.0])
@pytest.mark.parametrize("sink", [0.0, 15.0])
def test_the_guess_is_coast_and_brake_along_the_vertical(climb, sink):
    """At constant mass: free fall to a speed s, then full thrust from s to the speed at the target."""
    lift, height = 12000.0 / 1200.0 - 1.62, 900.0
    problem = LandingProblem(
        State.parse([0.0, 0.0, 50.0 + height, 0.0, 0.0, climb, 1200.0]),
        TARGET,
        PAPER_LANDER,
        GRAVITY,
        target_velocity=np.array([0.0, 0.0, -sink]),
    )
    time = guess_time(problem, TimeWindow(1.0, 1000.0))

    def left_to_fall(seconds):
        speed = sink + lift * seconds
        return height + (climb**2 - speed**2) / 3.24 - sink * seconds - 0.5 * lift * seconds**2

    braking = cast("float", brentq(left_to_fall, 0.0, 100.0))
    assert time == pytest.approx((climb + sink + lift * braking) / 1.62 + braking, rel=1e-9)


def test_a_target_velocity_beyond_free_fall_needs_no_brake():
    problem = LandingProblem(
        State.parse([0.0, 0.0, 950.0, 0.0, 0.0, -30.0, 1200.0]),
        TARGET,
        PAPER_LANDER,
        GRAVITY,
        target_velocity=np.array([0.0, 0.0, -100.0]),
    )
    fall = (math.sqrt(30.0**2 + 2.0 * 1.62 * 900.0) - 30.0) / 1.62
    assert guess_time(problem, TimeWindow(1.0, 1000.0)) == pytest.approx(fall, rel=1e-9)


def test_the_window_ends_where_the_propellant_for_hovering_ends():
    """Thrown up at 60 m/s by an engine without limit, with 100 m/s on board: |v - g T| <= 100 m/s."""
    lander = Lander(dry_mass=1200.0 * math.exp(-100.0 / 3187.16125), max_thrust=1e9)
    problem = LandingProblem(State.parse([0.0, 0.0, 950.0, 0.0, 0.0, 60.0, 1200.0]), TARGET, lander, GRAVITY)
    assert time_window(problem).high == pytest.approx((100.0 + 60.0) / 1.62, rel=1e-9)


@given(
    coefficients=st.tuples(st.floats(-5.0, 5.0), st.floats(0.5, 20.0), st.floats(20.0, 60.0)),
    slopes=st.lists(st.floats(-3.0, 0.8), min_size=3, max_size=3, unique_by=lambda s: round(s, 2)),
)
def test_the_parabola_is_exact_where_the_time_is_quadratic_in_the_warped_slope(coefficients, slopes):
    run = search(hyperbola())[1]

    def time_at(slope):
        return float(np.polyval(coefficients, TimeModel(1.0).warp(slope)))

    samples = [Sample(time_at(slope), 0.0, slope) for slope in slopes]
    assert run._parabola(samples) == pytest.approx(time_at(0.0), rel=1e-6)
