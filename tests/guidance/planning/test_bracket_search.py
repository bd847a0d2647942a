"""The search that trusts nothing but the sign of the slope, on costs that no model fits."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from timed_costs import Sample, hyperbola

from guidance.flight_time.search import TimeModel
from guidance.flight_time.time_window import TimeWindow
from guidance.planning.bracket_search import BracketSearch

TOLERANCE = 1e-4


def search(evaluate, guess, window=(1.0, 100.0)):
    run = BracketSearch(evaluate, TimeWindow(*window), TOLERANCE, TimeModel(1.0))
    return run.run(guess), run


@given(
    kink=st.floats(5.0, 80.0), left=st.floats(0.05, 5.0), right=st.floats(0.05, 5.0), guess=st.floats(2, 99)
)
def test_finds_a_kink_that_is_concave_on_its_right(kink, left, right, guess):
    """A tangent from the right passes above the kink: a model of convex costs stops too soon."""

    def evaluate(time):
        if time < kink:
            return Sample(time, left * (kink - time), -left)
        way = 1.0 + time - kink
        return Sample(time, right * math.log(way), right / way)

    best, run = search(evaluate, guess)
    assert best is not None
    assert best.value < 2.0 * TOLERANCE
    assert len(run.samples) <= 50


@given(b=st.floats(5.0, 300.0), c=st.floats(1.5, 10.0), guess=st.floats(12.0, 90.0))
def test_finds_the_optimum_of_a_hyperbola(b, c, guess):
    best, run = search(hyperbola(1.0, b, c), guess)
    assert best is not None
    assert best.value - (c + 2.0 * math.sqrt(b)) < 2.0 * TOLERANCE
    assert len(run.samples) <= 25


@given(edge=st.floats(16.0, 60.0), guess=st.floats(5.0, 95.0))
def test_optimum_at_the_shortest_feasible_time(edge, guess):
    best, _ = search(hyperbola(feasible=(edge, math.inf)), guess)
    assert best is not None
    assert best.time >= edge
    assert best.value - hyperbola()(edge).value < 2.0 * TOLERANCE


@given(edge=st.floats(10.0, 14.0))
def test_optimum_at_the_longest_feasible_time(edge):
    best, _ = search(hyperbola(feasible=(8.5, edge)), 50.0)
    assert best is not None
    assert best.time <= edge
    assert best.value - hyperbola()(edge).value < 20.0 * TOLERANCE  # it is steep there


def test_optimum_at_the_ends_of_the_window():
    falling, _ = search(lambda t: Sample(t, -t, -1.0), 20.0)
    rising, _ = search(lambda t: Sample(t, t, 0.9), 20.0)
    assert falling is not None
    assert rising is not None
    assert falling.time == 100.0
    assert rising.time == pytest.approx(1.0)


def test_it_goes_downhill_by_growing_steps_to_either_side():
    _, falling = search(lambda t: Sample(t, -t, -1.0), 20.0)
    _, rising = search(lambda t: Sample(t, t, 0.9), 20.0)
    for run, side in ((falling, 1.0), (rising, -1.0)):
        times = [side * sample.time for sample in run.samples]
        assert times == sorted(times)
        assert len(times) <= 10


def test_where_the_slope_leaves_no_gain_it_asks_no_more():
    best, run = search(lambda t: Sample(t, -1e-6 * t, -1e-6), 20.0)
    assert best is not None
    assert [sample.time for sample in run.samples] == [20.0]


def test_no_feasible_time_ends_with_none_after_the_grid():
    best, run = search(lambda t: Sample(t, solved=False), 20.0)
    assert best is None
    assert len(run.samples) == len(TimeWindow(1.0, 100.0).grid()) + 1
