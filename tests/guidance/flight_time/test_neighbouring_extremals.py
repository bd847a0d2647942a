"""Extremals of given times of flight: they land at rest and burn what the convex optimum burns."""

import math

import numpy as np
import pytest
from descents import GRAVITY, TARGET, feasible_start, paper_start

import guidance
from guidance import PAPER_LANDER
from guidance.flight_time.extremal import PrimerProblem, fly_extremal
from guidance.flight_time.neighbouring_extremals import (
    find_neighbours,
    neighbours_at,
    new_extremal,
    set_neighbour,
)
from guidance.flight_time.primer_equations import TOUCHING, residuals, solve_primer, solve_touching

SHORTEST_BURN = 0.25  # [s] one that is shorter turns round within the delays below


def extremal_of(start):
    """The best extremal and its problem, in seconds."""
    unit = PAPER_LANDER.max_thrust / start[6]
    position, velocity = np.array(start[:3]) - TARGET, np.array(start[3:6])
    flow = PAPER_LANDER.max_mass_flow / start[6]
    problem, x = PrimerProblem(position / unit, velocity / unit, GRAVITY / unit, flow), new_extremal()
    assert solve_primer(problem, x)
    return x, problem


def burning_start():
    """A start whose best flight begins with a burn that stays."""
    rng = np.random.default_rng(53)
    while True:
        start = paper_start(rng)
        if extremal_of(start)[0].times[0] > 1.0:
            return start


def coasting_start():
    """A start whose best flight begins with a coast."""
    rng = np.random.default_rng(55)
    while True:
        start = feasible_start(rng)
        if -5.0 < extremal_of(start)[0].times[0] < 0.0:
            return start


def carried(x, problem, delay, corrections):
    """Extremal of another time of flight, corrected so many times."""
    known, time = find_neighbours(x, problem), x.times[2] + delay
    for _ in range(corrections):
        known = neighbours_at(known, problem, time)
    out = new_extremal()
    set_neighbour(known, time, out)
    return out


def miss(x, problem):
    """[s^2] distance from the target, [s] speed, at the end."""
    path = fly_extremal(x, problem)
    return float(np.abs(path.position[-1]).max()), float(np.abs(path.velocity[-1]).max())


@pytest.mark.parametrize("delay", [-0.6, -0.2, 0.2, 0.6])
def test_a_corrected_neighbour_lands_at_rest(delay):
    rng, tried = np.random.default_rng(51), 0
    for _ in range(60):
        x, problem = extremal_of(paper_start(rng))
        if x.times[0] < SHORTEST_BURN:
            continue
        tried += 1
        neighbour = carried(x, problem, delay, 6)
        assert neighbour.times[2] == pytest.approx(x.times[2] + delay, rel=1e-12)
        assert max(miss(neighbour, problem)) < 1e-6
        assert np.linalg.norm(neighbour.primer, axis=1) == pytest.approx(1.0)
    assert tried > 40


def test_uncorrected_neighbours_miss_by_the_square_of_the_delay():
    x, problem = extremal_of(paper_start(np.random.default_rng(52)))
    coarse, fine = (max(miss(carried(x, problem, delay, 0), problem)) for delay in (0.02, 0.01))
    assert 3.5 < coarse / fine < 4.5


@pytest.mark.parametrize(
    ("start", "delay"), [(burning_start(), -0.5), (burning_start(), 0.5), (coasting_start(), 0.3)]
)
def test_a_neighbour_burns_what_the_convex_optimum_of_its_time_burns(start, delay):
    x, problem = extremal_of(start)
    neighbour = carried(x, problem, delay, 8)
    assert max(miss(neighbour, problem)) < 1e-5
    burning = max(neighbour.times[0], 0.0) + neighbour.times[2] - neighbour.times[1]
    plan = guidance.solve_pdg(
        start, TARGET, time_of_flight=float(neighbour.times[2]), nodes=241, method="convex"
    )
    assert plan.propellant == pytest.approx(PAPER_LANDER.max_mass_flow * burning, abs=5e-3)


def test_where_the_best_flight_coasts_first_its_neighbours_burn_first():
    x, problem = extremal_of(coasting_start())
    assert x.times[0] < 0.0
    for delay in (-0.1, 0.1):
        neighbour = carried(x, problem, delay, 1)
        assert neighbour.times[0] > 0.0
        sense = float(neighbour.primer[0] @ neighbour.primer[1])
        assert math.copysign(1.0, sense) == math.copysign(1.0, delay)


def test_nothing_is_changed_in_place():
    x, problem = extremal_of(feasible_start(np.random.default_rng(54)))
    before = x.primer.copy(), x.times.copy()
    known = find_neighbours(x, problem)
    neighbours_at(known, problem, x.times[2] + 0.3)
    assert np.array_equal(before[0], x.primer)
    assert np.array_equal(before[1], x.times)
    assert np.array_equal(before[1], known.extremal.times)


def test_neighbours_of_a_flight_that_touches_the_ground_touch_it_to_second_order():
    """All equations but the Hamiltonian: a step that is half as long misses them by a quarter."""
    start = [-11.3, 0.4, 202.6, 17.4, 25.7, -48.7, 1194.5]
    unit, flow = PAPER_LANDER.max_thrust / start[6], PAPER_LANDER.max_mass_flow / start[6]
    place, speed = np.array(start[:3]) - TARGET, np.array(start[3:6])
    problem, x = PrimerProblem(place / unit, speed / unit, GRAVITY / unit, flow), new_extremal()
    assert solve_touching(problem, x)
    known, out, missed = find_neighbours(x, problem), new_extremal(), np.empty(TOUCHING)

    def miss(neighbours, time):
        set_neighbour(neighbours, time, out)
        residuals(out, problem, missed)
        return float(np.linalg.norm(np.delete(missed, 6)))

    assert miss(known, x.times[2]) < 1e-6
    for delay in (-0.2, 0.2):
        whole, half = (miss(known, x.times[2] + share * delay) for share in (1.0, 0.5))
        assert 3.0 < whole / half < 5.0
        corrected = neighbours_at(known, problem, x.times[2] + delay)
        assert miss(corrected, x.times[2] + delay) < 0.05 * whole
        assert out.touch[0] != x.touch[0]
