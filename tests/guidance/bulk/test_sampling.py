"""Flights in bulk on nodes: exactly along burn, coast and burn."""

import itertools

import numpy as np
import pytest
from descents import GRAVITY, TARGET, feasible_start, paper_start

from guidance import PAPER_LANDER, State, solve_pdg, solve_pdg_many
from guidance.bulk.sampling import no_nodes, sample_plan
from guidance.descent.problem import LandingProblem
from guidance.dynamics import integrate
from guidance.flight_time.primer_vector import find_primer_flight

NODES = 23


@pytest.mark.parametrize("sampler", [paper_start, feasible_start])
def test_nodes_are_those_of_another_integrator(sampler):
    """DOP853 along the primer's direction, restarted at each switch."""
    rng = np.random.default_rng(41)
    states = np.array([sampler(rng) for _ in range(8)])
    found = solve_pdg_many(states, TARGET, nodes=NODES)
    assert found.nodes is not None
    for k, start in enumerate(states):
        flight = find_primer_flight(LandingProblem(State.parse(start), TARGET, PAPER_LANDER, GRAVITY))
        assert flight is not None
        times = np.linspace(0.0, flight.time, NODES)
        np.testing.assert_allclose(found.nodes.time[k], times, rtol=1e-12)
        marks = np.union1d(times, [flight.first_burn, flight.braking])
        state, path = State.parse(start), {0.0: np.array(start)}
        for begin, end in itertools.pairwise(marks):
            middle = 0.5 * (begin + end)
            coasting = flight.first_burn < middle < flight.braking

            def thrust_at(time, flight=flight, coasting=coasting):
                return (0.0 if coasting else PAPER_LANDER.max_thrust) * flight.direction_at(time)

            row = integrate(state, thrust_at, np.array([begin, end]), PAPER_LANDER, GRAVITY)[-1]
            state, path[end] = State.parse(row[:7]), row[:7]
        flown = np.array([path[time] for time in times])
        np.testing.assert_allclose(found.nodes.position[k], flown[:, :3], atol=1e-5)
        np.testing.assert_allclose(found.nodes.velocity[k], flown[:, 3:6], atol=1e-6)
        np.testing.assert_allclose(found.nodes.mass[k], flown[:, 6], rtol=1e-9)
        for time, thrust in zip(times, found.nodes.thrust[k], strict=True):
            burning = time < flight.first_burn or time >= flight.braking
            force = PAPER_LANDER.max_thrust if burning else 0.0
            np.testing.assert_allclose(thrust, force * flight.direction_at(time), atol=1e-4)
        assert np.array_equal(found.first_thrust[k], found.nodes.thrust[k, 0])
        assert start[6] - found.nodes.mass[k, -1] == pytest.approx(found.propellant[k], rel=1e-9)


def test_a_plan_is_sampled_between_its_nodes():
    """On the nodes of a twice finer plan of the same thrust: position and velocity are exact there."""
    plan = solve_pdg(paper_start(np.random.default_rng(42)), TARGET, nodes=31, method="convex")
    nodes = no_nodes(1, 61)
    sample_plan(plan, 0, nodes)
    assert np.array_equal(nodes.time[0, ::2], np.linspace(0.0, plan.time_of_flight, 61)[::2])
    np.testing.assert_allclose(nodes.position[0, ::2], plan.position, atol=1e-9)
    np.testing.assert_allclose(nodes.velocity[0, ::2], plan.velocity, atol=1e-9)
    np.testing.assert_allclose(nodes.mass[0, ::2], plan.mass, rtol=1e-12)
    step = plan.time[1]
    u = plan.thrust / plan.mass[:, None]
    half = plan.velocity[:-1] + step / 8.0 * (3.0 * u[:-1] + u[1:]) + 0.5 * step * GRAVITY
    np.testing.assert_allclose(nodes.velocity[0, 1::2], half, atol=1e-6)
    np.testing.assert_allclose(nodes.thrust[0], plan.thrust_at(nodes.time[0]))
