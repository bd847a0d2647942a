"""In bulk as in a single call: every limit, every end, and flights that touch the ground or never coast."""

import numpy as np
import pytest
from descents import GRAVITY, TARGET, harsh_start, paper_start

import guidance
from guidance import PAPER_LANDER, Cone, Limits, PlanStatus, State, solve_pdg_many
from guidance.descent.dual_bound import DualBound
from guidance.descent.problem import LandingProblem
from guidance.flight_time.extremal import touches
from guidance.flight_time.primer_vector import find_primer_flight

TOUCHING = [
    [-164.2, -138.1, 179.3, -2.2, -29.1, -46.7, 1199.0],
    [-11.3, 0.4, 202.6, 17.4, 25.7, -48.7, 1194.5],
    [9.4, -38.2, 103.7, 8.9, 27.0, -29.2, 1186.2],
]
NEVER_COASTS = [-141.9, -143.2, 197.2, 48.7, 26.7, -33.5, 1200.0]


def paper_starts(count, seed):
    rng = np.random.default_rng(seed)
    return np.array([paper_start(rng) for _ in range(count)])


@pytest.mark.parametrize(
    ("asked", "methods"),
    [
        ({"limits": Limits(final_thrust_direction=Cone(0.2647))}, {"indirect", "convex"}),
        ({"limits": Limits(line_of_sight=Cone(0.3086))}, {"indirect", "convex"}),
        ({"limits": Limits(glide_slope=0.3086, final_thrust_direction=Cone(0.28))}, {"indirect", "convex"}),
        ({"limits": Limits(thrust_rate=4000.0)}, {"convex"}),
        ({"target_velocity": (3.0, 0.0, -12.0)}, {"convex"}),
        ({"angular_velocity": (0.0, 1e-3, 0.0)}, {"convex"}),
    ],
)
def test_what_is_asked_is_answered_as_in_single_calls(asked, methods):
    count = 4 if "indirect" in methods else 2
    starts = paper_starts(count, 21)
    found = solve_pdg_many(starts, TARGET, nodes=9, **asked)
    assert set(found.method) == methods
    for k, start in enumerate(starts):
        plan = guidance.solve_pdg(start, TARGET, throw=False, **asked)
        assert (found.status_of(k), found.method[k]) == (plan.status, plan.method)
        assert found.propellant[k] == pytest.approx(plan.propellant, rel=1e-9)
        assert found.nodes is not None
        assert found.nodes.velocity[k, -1] == pytest.approx(plan.velocity[-1], abs=1e-6)
        bound = found.lower_bound[k]
        assert np.isnan(bound) if "angular_velocity" in asked else bound <= found.propellant[k]


def test_flights_in_bulk_lie_within_the_cones():
    limits = Limits(final_thrust_direction=Cone(0.264), line_of_sight=Cone(0.31, (0.02, 0.0, 1.0)))
    found = solve_pdg_many(paper_starts(400, 22), TARGET, limits=limits, nodes=61, fallback=False)
    answered = found.method == "indirect"
    assert 20 < answered.sum() < 380
    assert found.nodes is not None
    assert limits.line_of_sight is not None
    assert limits.line_of_sight.outside(found.nodes.position[answered, :-1] - TARGET).max() < 0.01
    for thrust in found.nodes.thrust[answered, -1]:
        assert Cone(0.264).excess(thrust) < 1e-9
    free = solve_pdg_many(paper_starts(400, 22), TARGET, fallback=False)
    assert np.array_equal(found.propellant[answered], free.propellant[answered])


@pytest.mark.parametrize("start", [*TOUCHING, NEVER_COASTS])
def test_touching_flights_and_those_without_a_coast_are_those_of_single_calls(start):
    found = solve_pdg_many([start, start], TARGET, nodes=41)
    flight = find_primer_flight(LandingProblem(State.parse(start), TARGET, PAPER_LANDER, GRAVITY))
    assert flight is not None
    plan = guidance.solve_pdg(start, TARGET)
    assert found.method[0] == plan.method == "indirect"
    assert found.propellant[0] == pytest.approx(plan.propellant, rel=1e-9)
    assert found.time_of_flight[1] == pytest.approx(flight.time, rel=1e-9)
    assert touches(flight.extremal) == (start != NEVER_COASTS)
    if start == NEVER_COASTS:
        assert flight.braking - flight.first_burn < 1e-6 * flight.time
    assert found.nodes is not None
    states, thrust = plan.states_at(found.nodes.time[0]), plan.thrust_at(found.nodes.time[0])
    np.testing.assert_allclose(found.nodes.position[0], states[0], atol=1e-5)
    np.testing.assert_allclose(found.nodes.velocity[0], states[1], atol=1e-6)
    np.testing.assert_allclose(found.nodes.thrust[0], thrust, atol=0.05)
    certificate = found.certificate(1)
    assert certificate is not None
    assert certificate.verified
    assert certificate.lower_bound == found.lower_bound[1]
    assert found.optimality_gap[0] <= plan.optimality_gap + 1e-3


def test_the_kink_of_a_touch_bounds_its_neighbours_without_a_search():
    """Of harsh starts that touch: half are bounded to less than 30 g, each soundly."""
    rng, gaps = np.random.default_rng(5), []
    starts = np.array([harsh_start(rng) for _ in range(1500)])
    found = solve_pdg_many(starts, TARGET, fallback=False)
    for k in np.flatnonzero(found.optimal).tolist():
        certificate = found.certificate(k)
        assert certificate is not None
        bound = certificate.proofs[0]
        assert isinstance(bound, DualBound)
        if not any(piece.path_multiplier[2] > 0.0 for piece in bound.pieces):
            continue
        gaps.append(found.optimality_gap[k])
        assert certificate.verified
        assert found.status_of(k) is PlanStatus.OPTIMAL
    assert len(gaps) > 15
    assert np.median(gaps) < 0.03


def test_proofs_that_use_a_touch_name_the_altitude():
    """Tanks that pay for no flight: what forbids each is what its bound uses."""
    rng, kinked, free = np.random.default_rng(5), 0, 0
    starts = np.array([harsh_start(rng) for _ in range(100)])
    found = solve_pdg_many(starts, TARGET, fallback=False)
    for k in np.flatnonzero(found.infeasible).tolist():
        certificate = found.certificate(k)
        assert certificate is not None
        (bound,) = certificate.proofs
        assert isinstance(bound, DualBound)
        touches_ground = any(piece.path_multiplier[2] > 0.0 for piece in bound.pieces)
        kinked, free = kinked + touches_ground, free + (not touches_ground)
        assert certificate.causes == ("altitude",) * touches_ground + ("maximum thrust", "propellant")
        assert not touches_ground or certificate.verified
    assert kinked >= 2
    assert free >= 10


def test_a_limit_that_is_given_twice_is_refused():
    with pytest.raises(ValueError, match=r"speed_limit and limits\.speed are the same limit"):
        solve_pdg_many(paper_starts(1, 1), TARGET, limits=Limits(speed=60.0), speed_limit=60.0)
    with pytest.raises(ValueError, match="target_velocity: no number may exceed"):
        solve_pdg_many(paper_starts(1, 1), TARGET, target_velocity=(1e10, 0.0, 0.0))
