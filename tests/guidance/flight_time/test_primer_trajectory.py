"""The indirect method's flight on nodes: exact under other integrators, and of any time of flight."""

import math

import numpy as np
import pytest
from descents import GRAVITY, TARGET, feasible_start, paper_start
from hypothesis import given, reject
from hypothesis import strategies as st

import guidance
from guidance import PAPER_LANDER, State
from guidance.descent.problem import LandingProblem
from guidance.descent.residuals import fly_residuals
from guidance.dynamics import integrate
from guidance.flight_time.primer_trajectory import PrimerTrajectory, lay_nodes
from guidance.flight_time.primer_vector import find_primer_flight

ratios = st.floats(0.85, 2.0)
"""Times of flight over the best one."""


def problem_from(start) -> LandingProblem:
    return LandingProblem(State.parse(start), TARGET, PAPER_LANDER, GRAVITY)


def drawn(seed, sampler=paper_start) -> LandingProblem:
    return problem_from(sampler(np.random.default_rng(seed)))


def laid(problem, ratio=1.0, nodes=61) -> PrimerTrajectory | None:
    """The flight on nodes; None where no flight so long keeps the limits, or the tank does not pay for it."""
    best = find_primer_flight(problem)
    flight = None if best is None else find_primer_flight(problem, ratio * best.time)
    return None if flight is None else lay_nodes(problem, flight, nodes)


@given(st.integers(0, 10**6), ratios, st.integers(5, 200))
def test_nodes_hold_the_switches_and_share_the_arcs(seed, ratio, nodes):
    flight = laid(drawn(seed), ratio, nodes)
    if flight is None:
        reject()
    arcs = 3 if flight.flight.first_burn > 0.0 else 2
    assert flight.nodes == max(nodes, 2 * arcs)
    steps = np.diff(flight.time)
    slivers = steps < 1e-6 * flight.duration
    assert (steps > 0.0).all()
    assert slivers.sum() == arcs - 1
    ends = np.append(flight.time[:-1][slivers], flight.time[-1])
    switches = (flight.flight.first_burn, flight.flight.braking, flight.flight.time)[3 - arcs :]
    assert ends.tolist() == list(switches)
    size = np.linalg.norm(flight.thrust, axis=1)
    full = np.isclose(size, PAPER_LANDER.max_thrust, rtol=1e-12)
    assert (full | (size == 0.0)).all()
    assert np.flatnonzero(np.diff(full)).tolist() == np.flatnonzero(slivers).tolist()
    longest, count = max((end, k) for k, end in enumerate(np.diff([0.0, *switches])))
    assert np.ptp(steps[~slivers]) < longest  # no arc is left without its share
    assert count < arcs


@given(st.integers(0, 10**6), ratios)
def test_flown_it_misses_nothing_by_more_than_a_millionth(seed, ratio):
    problem = drawn(seed)
    flight = laid(problem, ratio)
    if flight is None:
        reject()
    residuals = fly_residuals(flight, problem)
    for name in ("position", "velocity", "mass", "landing_position", "landing_velocity"):
        assert getattr(residuals, name) < 1e-6
    assert residuals.altitude < 1e-5  # how exactly the equations of the flight were solved
    assert residuals.thrust_above < 1e-8
    assert residuals.propellant == 0.0


@pytest.mark.parametrize("seed", range(6))
def test_states_and_thrust_between_nodes_under_another_integrator(seed):
    problem = drawn(seed)
    flight = laid(problem, (1.0, 0.93, 1.1)[seed % 3])
    assert flight is not None
    state = problem.state
    for begin, end in zip(flight.time[:-1], flight.time[1:], strict=True):
        if end - begin < 1e-6:
            continue
        times = np.linspace(begin, end, 4)
        inside = times[1:-1]
        burning = np.linalg.norm(flight.thrust_at(0.5 * (begin + end))) > 0.0

        def thrust_at(time, burning=burning):
            force = PAPER_LANDER.max_thrust if burning else 0.0
            return force * flight.flight.direction_at(time)

        np.testing.assert_allclose(
            flight.thrust_at(inside),
            [thrust_at(time) for time in inside],
            atol=1e-6 * PAPER_LANDER.max_thrust,
        )
        path = integrate(state, thrust_at, times, problem.lander, problem.gravity)
        position, velocity = flight.states_at(times, problem.gravity)
        np.testing.assert_allclose(position, path[:, :3], atol=1e-5)
        np.testing.assert_allclose(velocity, path[:, 3:6], atol=1e-6)
        state = State(path[-1, :3], path[-1, 3:6], float(path[-1, 6]))
    np.testing.assert_allclose(flight.mass[-1], state.mass, rtol=1e-9)


@given(st.integers(0, 10**6), st.lists(st.floats(0.0, 1.0), min_size=1, max_size=9))
def test_states_do_not_depend_on_the_order_of_the_times(seed, fractions):
    problem = drawn(seed)
    flight = laid(problem)
    assert flight is not None
    times = flight.duration * np.array(fractions)
    position, velocity = flight.states_at(times, problem.gravity)
    for k, time in enumerate(times):
        alone = flight.states_at(np.array([time]), problem.gravity)
        np.testing.assert_allclose(position[k], alone[0][0], atol=1e-7)
        np.testing.assert_allclose(velocity[k], alone[1][0], atol=1e-8)


@given(st.integers(0, 10**6), ratios)
def test_no_other_flight_of_that_duration_is_cheaper(seed, ratio):
    """The dual bound of that time of flight lies within grams, and a share of them for long burns."""
    problem = drawn(seed, feasible_start)
    best = find_primer_flight(problem)
    if best is None:
        reject()
    time = ratio * best.time
    if find_primer_flight(problem, time) is None:
        reject()
    plan = guidance.solve_pdg(problem.state, TARGET, time_of_flight=time)
    assert plan.method == "indirect"
    assert plan.time_of_flight == time
    assert -1e-6 < plan.optimality_gap < 1e-3 * plan.propellant  # 4.5e-4 was found, 20 g of 44 kg
    assert plan.certificate is not None
    assert plan.certificate.verified


def test_in_the_coast_another_time_of_flight_needs_a_burn_at_once():
    """On the way, the engine off: the best flight has no first burn, every other has one, up or down."""
    rng, found, asked, gaps = np.random.default_rng(9), 0, 0, []
    for _ in range(60):
        problem = problem_from(paper_start(rng))
        plan = guidance.solve_pdg(problem.state, TARGET)
        fraction, longer = rng.uniform(0.1, 0.5), rng.uniform(-0.4, 3.0)
        k = int(fraction * plan.nodes)
        here = State(plan.position[k], plan.velocity[k], float(plan.mass[k]))
        rest = guidance.solve_pdg(here, TARGET)
        assert rest.method == "indirect"
        assert isinstance(rest.trajectory, PrimerTrajectory)
        assert rest.trajectory.flight.first_burn == 0.0
        other = guidance.solve_pdg(here, TARGET, time_of_flight=rest.time_of_flight + longer, throw=False)
        asked += other.status.has_flight
        if other.method == "indirect":
            found += 1
            gaps.append(other.optimality_gap)
            assert isinstance(other.trajectory, PrimerTrajectory)
            assert other.trajectory.flight.first_burn > 0.0
            assert other.keeps_limits
            assert np.sign(other.thrust[0, 2]) == np.sign(longer)
    assert asked > 45
    assert found >= 0.9 * asked
    assert -1e-6 < min(gaps) < max(gaps) < 3e-3


def test_given_times_of_flight_agree_with_the_convex_method():
    """Forty starts at six durations: the exact flight is no dearer than that of a mesh, beyond its error."""
    rng, compared, cheaper = np.random.default_rng(8), 0, []
    for _ in range(40):
        start = paper_start(rng)
        best = find_primer_flight(problem_from(start))
        assert best is not None
        for ratio in (0.9, 0.97, 1.0, 1.05, 1.2, 1.5):
            asked = {"time_of_flight": ratio * best.time, "throw": False}
            exact = guidance.solve_pdg(start, TARGET, method="indirect", **asked)
            mesh = guidance.solve_pdg(start, TARGET, method="convex", nodes=121, **asked)
            if mesh.status.has_flight:
                assert exact.status.has_flight
                compared += 1
                cheaper.append(mesh.propellant - exact.propellant)
    assert compared > 220
    assert min(cheaper) > -2e-3
    assert max(cheaper) < 5e-3


@given(st.sampled_from([1e-6, 1e-2, 0.2, 3.5, 40.0, 1e4, 1e9]))
def test_a_time_far_from_the_best_is_left_to_others(ratio):
    problem = drawn(3)
    best = find_primer_flight(problem)
    assert best is not None
    assert find_primer_flight(problem, ratio * best.time) is None


def test_the_hamiltonian_tells_how_the_cost_changes_with_the_time():
    """Longer and shorter flights cost more, by the square of the difference: the best time is a minimum."""
    problem = drawn(5)
    best = find_primer_flight(problem)
    assert best is not None
    steps = (-0.4, -0.2, 0.2, 0.4)
    around = [
        flight for step in steps if (flight := find_primer_flight(problem, best.time + step)) is not None
    ]
    rise = np.array([flight.log_mass_ratio - best.log_mass_ratio for flight in around])
    assert (rise > 0.0).all()
    assert rise[0] / rise[1] == pytest.approx(4.0, rel=0.3)
    assert rise[3] / rise[2] == pytest.approx(4.0, rel=0.3)
    assert math.isclose(around[0].time, best.time - 0.4)
