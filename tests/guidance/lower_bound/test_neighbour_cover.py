"""Bounds from an extremal and its neighbours: the primer's length, the grid, weak duality, tightness."""

import math

import numpy as np
import pytest
from descents import GRAVITY, TARGET, feasible_start, harsh_start, paper_start
from scipy.integrate import solve_ivp

from guidance import PAPER_LANDER, State
from guidance.descent.problem import LandingProblem
from guidance.flight_time.extremal import PrimerProblem, new_extremal
from guidance.flight_time.primer_equations import solve_primer
from guidance.lower_bound.dual_case import dual_case
from guidance.lower_bound.neighbour_cover import bound_by_neighbours, primer_of
from guidance.lower_bound.proof import certify_cover
from guidance.lower_bound.time_grid import longest_time, time_grid

EXHAUST = PAPER_LANDER.exhaust_velocity


def extremal_of(start):
    """The landing problem, its extremal and that one's problem, and the velocity change [m/s]."""
    problem = LandingProblem(State.parse(start), TARGET, PAPER_LANDER, GRAVITY)
    unit = PAPER_LANDER.max_thrust / start[6]
    scaled = PrimerProblem(
        problem.offset / unit,
        problem.state.velocity / unit,
        problem.gravity / unit,
        PAPER_LANDER.max_mass_flow / start[6],
    )
    x = new_extremal()
    if not solve_primer(scaled, x):
        return None
    burning = max(x.times[0], 0.0) + x.times[2] - x.times[1]
    return problem, x, scaled, -EXHAUST * math.log1p(-scaled.mass_flow * burning)


def grams(problem, level, spent):
    return 1e3 * problem.state.mass * (math.exp(-level / EXHAUST) - math.exp(-spent / EXHAUST))


def test_the_primer_lights_the_engine_where_the_extremal_brakes():
    """The switching function, integrated by an independent method, vanishes there."""
    rng = np.random.default_rng(61)
    for _ in range(10):
        found = extremal_of(paper_start(rng))
        assert found is not None
        problem, x, _, spent = found
        case = dual_case(problem, spent)
        primer, burn = primer_of(x, case), float(x.times[2] - x.times[1])

        def slope(time, s, primer=primer, case=case):
            p = primer[:3] + time * primer[3:]
            return [p @ primer[3:] / np.linalg.norm(p) + case.thrust.full_growth * s[0]]

        first = float(np.linalg.norm(primer[:3])) - 1.0
        run = solve_ivp(slope, (0.0, burn), [first], rtol=1e-10, atol=1e-12)
        assert first > 0.0
        assert run.y[0, -1] == pytest.approx(0.0, abs=1e-7)
        across = np.cross(primer[:3] + burn * primer[3:], x.primer[1])
        assert np.abs(across).max() < 1e-12


def test_the_grid_rises_from_none_to_where_gravity_spends_the_target():
    rng = np.random.default_rng(62)
    for _ in range(50):
        found = extremal_of(paper_start(rng))
        assert found is not None
        problem, x, _, spent = found
        case, time = dual_case(problem, spent), float(x.times[2])
        times = time_grid(case, spent, time, 70)
        assert times[0] == 0.0
        assert (np.diff(times) > 0.0).all()
        assert np.diff(times).max() < max(time / 70 * (1.0 + 1e-9), 0.04 * times[-1])
        assert np.abs(times - time).min() < 1e-9 * time
        last = longest_time(case, spent, time)
        assert times[-1] == last >= time
        assert last == pytest.approx(max((spent + problem.state.velocity[2]) / 1.62, time))


@pytest.mark.parametrize(
    ("sampler", "share"), [(paper_start, 1.0), (feasible_start, 0.8), (harsh_start, 0.5)]
)
def test_covers_are_bounds_and_most_are_tight_without_a_search(sampler, share):
    rng, tight, count = np.random.default_rng(63), 0, 0
    for k in range(200):
        found = extremal_of(sampler(rng))
        if found is None:
            continue
        problem, x, scaled, spent = found
        case = dual_case(problem, spent)._replace(slope_sine=0.0)  # an extremal may cut through the ground
        times, cover = bound_by_neighbours(x, scaled, case, spent, EXHAUST)
        assert cover.level <= spent
        count, tight = count + 1, tight + (grams(problem, cover.level, spent) < 5.0)
        if k % 10 == 0:
            certificate = certify_cover(problem, spent, times, cover)
            assert certificate.verified
            assert certificate.lower_bound <= problem.state.mass * -math.expm1(-spent / EXHAUST)
    assert count > 60
    assert tight >= share * count


def test_a_cover_that_lies_is_found_out():
    found = extremal_of(paper_start(np.random.default_rng(64)))
    assert found is not None
    problem, x, scaled, spent = found
    times, cover = bound_by_neighbours(x, scaled, dual_case(problem, spent), spent, EXHAUST)
    assert certify_cover(problem, spent, times, cover).verified
    for lie in (
        cover._replace(level=cover.level + 0.02),
        cover._replace(owner=np.zeros_like(cover.owner)),
        cover._replace(primers=1.05 * cover.primers),
    ):
        assert not certify_cover(problem, spent, times, lie).verified
