"""Descents to a site that turns: flown by an integrator of its own, priced alike by independent methods."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from descents import COMPLETE, GRAVITY, TARGET, harsh_start, paper_start
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from guidance import Cone, Lander, Limits, PlanStatus, State, solve_pdg
from guidance.convex.farkas import FarkasProof
from guidance.descent.dual_bound import DualBound
from guidance.descent.problem import LandingProblem
from guidance.flight_time.primer_vector import find_primer_flight
from guidance.pdg.solve import PlanningMethod
from guidance.planning.convex_task import ConvexTask
from guidance.planning.infeasibility import prove_at

START = [200.0, 100.0, 950.0, -20.0, -4.0, -30.0, 1200.0]
SPIN = np.array([0.02, 0.01, -0.03])
seeds = st.integers(0, 1_000_000)


def planned(start, spin, method: PlanningMethod = "convex", **given):
    plan = solve_pdg(start, TARGET, angular_velocity=spin, method=method, nodes=31, **given)
    assert plan.status is PlanStatus.OPTIMAL
    assert plan.keeps_limits
    return plan


def flown(plan, spin, times):
    """States under the planned thrust and the equations of motion as they stand in a book, by DOP853."""

    def rate(time, x):
        force = plan.thrust_at(time)
        turn = -2.0 * np.cross(spin, x[3:6]) - np.cross(spin, np.cross(spin, x[:3]))
        burnt = -np.linalg.norm(force) / plan.problem.lander.exhaust_velocity
        return np.concatenate([x[3:6], force / x[6] + GRAVITY + turn, [burnt]])

    path, states = plan.problem.state.as_array(), []
    for first, last in pairwise(times):
        path = solve_ivp(rate, (first, last), path, method="DOP853", rtol=1e-10, atol=1e-9).y[:, -1]
        states.append(path)
    return np.array(states)


@pytest.mark.parametrize("method", COMPLETE)
def test_a_plan_lands_when_an_integrator_of_its_own_flies_it(method):
    plan = planned(START, SPIN, method)
    states = flown(plan, SPIN, plan.time)
    assert np.abs(states[:, :3] - plan.position[1:]).max() < 0.01
    assert np.abs(states[-1, :3] - TARGET).max() < 0.01
    assert np.abs(states[-1, 3:6]).max() < 0.01
    between = np.linspace(0.0, plan.time_of_flight, 23)
    position, velocity = plan.states_at(between)
    exact = flown(plan, SPIN, between)
    assert np.abs(exact[:, :3] - position[1:]).max() < 0.01
    assert np.abs(exact[:, 3:6] - velocity[1:]).max() < 0.01


@pytest.mark.parametrize("spin", [(2e-3, -1e-3, 3e-3), SPIN], ids=["slow", "fast"])
def test_every_method_finds_the_same_price(spin):
    plans = [planned(START, spin, method) for method in COMPLETE]
    assert plans[0].method == "convex"
    for plan in plans:
        assert plan.propellant == pytest.approx(plans[0].propellant, abs=0.02)
    assert abs(plans[0].propellant - planned(START, np.zeros(3)).propellant) > 0.2


@settings(max_examples=20)
@given(seed=seeds)
def test_no_rotation_is_none_and_a_little_changes_a_little(seed):
    rng = np.random.default_rng(seed)
    start, axis = paper_start(rng), rng.normal(size=3)
    for method in ("auto", "convex"):
        still = planned(start, np.zeros(3), method)
        plain = solve_pdg(start, TARGET, method=method, nodes=31)
        assert still.thrust.tobytes() == plain.thrust.tobytes()
        assert still.position.tobytes() == plain.position.tobytes()
    still = planned(start, np.zeros(3))
    size = 10.0 ** rng.uniform(-6.0, -3.0)
    turned = planned(start, size * axis / np.linalg.norm(axis))
    assert turned.propellant == pytest.approx(still.propellant, abs=0.01 + 300.0 * size)


@pytest.mark.parametrize("spin", [1e-3 * SPIN, SPIN, 3.0 * SPIN], ids=["slow", "fast", "faster"])
@pytest.mark.parametrize("free", [False, True])
def test_slope_is_the_derivative_of_the_optimum(spin, free):
    problem = LandingProblem(State.parse(START), TARGET, Lander(), GRAVITY, angular_velocity=spin)
    task, time = ConvexTask(problem, 31, free_landing_point=free, tolerance=1e-9), 30.0
    reference, h = task.solve(time).log_mass, 6e-3
    middle, below, above = (task.solve(t, reference) for t in (time, time - h, time + h))
    scale = 1.62 / problem.lander.exhaust_velocity
    assert middle.slope == pytest.approx((above.value - below.value) / (2.0 * h), rel=2e-2, abs=2e-3 * scale)


@settings(max_examples=30)
@given(seed=seeds)
def test_the_bound_of_farkas_proofs_bounds_every_unknown(seed):
    rng = np.random.default_rng(seed)
    spin = rng.normal(0.0, 0.05, 3)
    problem = LandingProblem(State.parse(paper_start(rng)), TARGET, Lander(), GRAVITY, angular_velocity=spin)
    solution = ConvexTask(problem, 21, free_landing_point=True).solve(rng.uniform(15.0, 60.0))
    if solution.solved:
        unknowns = solution.answer.primal[:-1]  # but for the landing error, which the rows alone bound
        assert np.abs(unknowns).max() <= solution.scaled.unknown_bound


def test_what_is_proved_where_the_site_turns():
    """No bound over all times; a proof for one time; nothing from what knows no rotation."""
    plan = planned(START, SPIN)
    assert plan.certificate is None
    assert np.isnan(plan.optimality_gap)
    assert find_primer_flight(plan.problem) is None
    still = solve_pdg(START, TARGET)
    assert still.certificate is not None
    bound = still.certificate.proofs[0]
    assert isinstance(bound, DualBound)
    assert bound.verified
    assert not replace(bound, problem=plan.problem).verified
    proof = prove_at(ConvexTask(plan.problem, 31), 12.0)
    assert isinstance(proof, FarkasProof)
    assert proof.verified
    short = solve_pdg(START, TARGET, angular_velocity=SPIN, time_of_flight=12.0, throw=False)
    assert short.status is PlanStatus.INFEASIBLE
    assert short.certificate is not None
    assert short.certificate.verified
    far = solve_pdg(START, [3000.0, 0.0, 50.0], angular_velocity=SPIN, throw=False)
    assert far.status is PlanStatus.LIMIT_REACHED


@pytest.mark.parametrize("seed", range(12))
def test_infeasible_is_never_said_where_the_reference_flies(seed):
    rng = np.random.default_rng([3, seed])
    start, spin = harsh_start(rng), rng.normal(0.0, 0.02, 3)
    plan = solve_pdg(start, TARGET, angular_velocity=spin, nodes=31, throw=False)
    reference = solve_pdg(start, TARGET, angular_velocity=spin, nodes=31, method="casadi", throw=False)
    if reference.status.has_flight:
        assert plan.status is PlanStatus.OPTIMAL
        assert plan.propellant == pytest.approx(reference.propellant, rel=6e-3, abs=0.02)


def test_rotation_with_limits_and_the_nearest_point():
    limits = Limits(thrust_rate=2500.0, line_of_sight=Cone(0.4), final_thrust_direction=Cone(0.1))
    lander = Lander(min_thrust=800.0, pointing_limit=1.0)
    spin = 0.2 * SPIN
    plans = [planned(START, spin, method, limits=limits, lander=lander) for method in ("convex", "casadi")]
    assert plans[1].propellant == pytest.approx(plans[0].propellant, abs=0.03)
    near = solve_pdg(START, [2500.0, 0.0, 50.0], angular_velocity=spin, nodes=31, unreachable="nearest")
    assert near.status is PlanStatus.NEAREST
    assert near.keeps_limits
