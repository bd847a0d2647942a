"""Weak duality: whatever the primer, no flight within the limits spends less than the dual function says."""

import numpy as np
import pytest
from admissible_flights import random_flight
from descents import GRAVITY, TARGET, paper_start
from hypothesis import given, settings
from hypothesis import strategies as st

from guidance import PAPER_LANDER, State
from guidance.descent.problem import LandingProblem
from guidance.lower_bound.dual_ascent import affine_basis, ascend, dual_value, two_impulse_primer
from guidance.lower_bound.dual_case import dual_case
from guidance.lower_bound.dual_function import linear_part, support, sweep_bound


def random_primer(rng, time, case):
    """Any primer; some near those that bound well."""
    if rng.random() < 0.5:
        return two_impulse_primer(time, case) * rng.normal(1.0, 0.3, 6)
    size = rng.choice([0.3, 1.0, 3.0])
    return np.concatenate([rng.normal(0.0, size, 3), rng.normal(0.0, size / time, 3)])


def bound_at(primer, time, case, cells):
    times = np.linspace(0.0, time, cells + 1)
    lowest = np.empty(cells)
    sweep_bound(primer, times, case, lowest)
    return lowest[-1]


@settings(max_examples=300, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 200))
def test_no_admissible_flight_undercuts_the_dual_function(seed, cells):
    rng = np.random.default_rng(seed)
    flight = random_flight(rng)
    case = dual_case(flight.problem, flight.spent * rng.uniform(1.0, 1.3))
    primer = random_primer(rng, flight.time, case)
    rounding = 1e-6 * flight.spent + 1e-9 * abs(linear_part(primer, flight.time, case))
    assert bound_at(primer, flight.time, case, cells) <= flight.spent + rounding


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_not_even_the_best_primer_of_the_flights_time(seed):
    rng = np.random.default_rng(seed)
    flight = random_flight(rng)
    case = dual_case(flight.problem, flight.spent)
    start, basis = 1.1 * two_impulse_primer(flight.time, case), affine_basis(flight.time, case)
    best = ascend(start, basis, flight.time, case, 1e-4, 10.0 * flight.spent)
    assert bound_at(best.primer, flight.time, case, 300) <= flight.spent * (1.0 + 1e-6)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_gradient_is_that_of_the_value(seed):
    rng = np.random.default_rng(seed)
    flight = random_flight(rng)
    case, time = dual_case(flight.problem, flight.spent), flight.time
    primer = random_primer(rng, time, case)
    gradient, unused = np.empty(6), np.empty(6)
    dual_value(primer, time, case, gradient)
    units = np.array([1.0, 1.0, 1.0, 1.0 / time, 1.0 / time, 1.0 / time])
    for axis, unit in enumerate(np.diag(1e-5 * units)):
        ends = [dual_value(primer + sign * unit, time, case, unused) for sign in (1.0, -1.0)]
        slope = (ends[0] - ends[1]) / 2e-5
        scale = case.thrust.full * time + np.linalg.norm(case.gravity) * time + abs(slope)
        assert gradient[axis] * units[axis] == pytest.approx(slope, abs=1e-4 * float(scale))


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_dual_function_is_concave(seed):
    rng = np.random.default_rng(seed)
    flight = random_flight(rng)
    case, time, unused = dual_case(flight.problem, flight.spent), flight.time, np.empty(6)
    first, second = random_primer(rng, time, case), random_primer(rng, time, case)
    ends = [dual_value(primer, time, case, unused) for primer in (first, second)]
    middle = dual_value(0.5 * (first + second), time, case, unused)
    assert middle >= 0.5 * sum(ends) - 1e-9 * (abs(ends[0]) + abs(ends[1]) + 1.0)


def test_the_support_function_is_the_greatest_product_over_the_cone():
    rng = np.random.default_rng(5)
    lean, turn = np.meshgrid(np.linspace(0.0, 1.0, 1500), np.linspace(0.0, 2.0 * np.pi, 721))
    for limit in (0.2, 1.0, 1.9, None):
        problem = LandingProblem(
            State.parse(paper_start(rng)),
            TARGET,
            type(PAPER_LANDER)(pointing_limit=limit),
            GRAVITY,
        )
        case, direction = dual_case(problem, 80.0), np.empty((1, 3))
        angle = lean * (np.pi if limit is None else limit)
        cone = np.stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])
        for primer in rng.normal(0.0, 1.0, (20, 6)):
            value = support(primer, 2.0, case.thrust, direction, 0)
            p = primer[:3] + 2.0 * primer[3:]
            assert value == pytest.approx(np.tensordot(p, cone, 1).max(), abs=2e-4 * float(np.linalg.norm(p)))
            assert value == pytest.approx(p @ direction[0], abs=1e-12)
            assert np.linalg.norm(direction[0]) == pytest.approx(1.0)


@pytest.mark.parametrize("time", [2.0, 3.0, 5.0])
def test_where_the_dual_function_has_no_maximum_the_ascent_stops_a_little_above_what_is_enough(time):
    """No flight of so few seconds exists; a far longer primer would bound no other time."""
    start = [200.0, 100.0, 950.0, -8.0, -4.0, -30.0, 1200.0]
    case = dual_case(LandingProblem(State.parse(start), TARGET, PAPER_LANDER, GRAVITY), 130.0)
    for enough in (1000.0, 4000.0):  # the primer it starts with bounds less
        found = ascend(two_impulse_primer(time, case), affine_basis(time, case), time, case, 1e-4, enough)
        assert enough < found.value < 1.5 * enough
        assert not found.stalled
