"""Limits of the path beyond glide slope and speed: kept in flight, priced alike by independent methods."""

import math
from dataclasses import replace

import numpy as np
import pytest
from descents import COMPLETE, GRAVITY, TARGET, paper_start
from hypothesis import given, settings
from hypothesis import strategies as st

from guidance import Cone, Lander, Limits, PlanStatus, State, solve_pdg
from guidance.descent.problem import LandingProblem
from guidance.pdg.solve import PlanningMethod
from guidance.planning.deferred_decision import TrunkOptions, plan_deferred

START = [200.0, 100.0, 950.0, -20.0, -4.0, -30.0, 1200.0]
seeds = st.integers(0, 1_000_000)


def planned(start, limits, method: PlanningMethod = "convex", **given):
    plan = solve_pdg(start, TARGET, limits=limits, method=method, nodes=31, **given)
    assert plan.status is PlanStatus.OPTIMAL
    assert plan.keeps_limits
    return plan


@settings(max_examples=25)
@given(seed=seeds)
def test_the_last_thrust_points_where_it_is_asked_to(seed):
    rng = np.random.default_rng(seed)
    lean, bearing = rng.uniform(0.0, 0.6), rng.uniform(0.0, 2.0 * math.pi)
    axis = (math.sin(lean) * math.cos(bearing), math.sin(lean) * math.sin(bearing), math.cos(lean))
    start, angle = paper_start(rng), rng.uniform(0.02, 0.5)
    free = planned(start, Limits())
    wide, narrow = (
        planned(start, Limits(final_thrust_direction=Cone(share * angle, axis))) for share in (1.0, 0.5)
    )
    for plan, share in ((wide, 1.0), (narrow, 0.5)):
        last = plan.thrust[-1]
        if np.linalg.norm(last) > 100.0:
            assert math.acos(min(1.0, last @ axis / np.linalg.norm(last))) < share * angle + 1e-3
    assert free.propellant - 0.01 < wide.propellant < narrow.propellant + 0.01


@pytest.mark.parametrize("angle", [0.03, 0.06])
def test_a_touchdown_upright_costs_the_same_by_every_method(angle):
    limits = Limits(final_thrust_direction=Cone(angle))
    plans = [planned(START, limits, method) for method in COMPLETE]
    free = solve_pdg(START, TARGET, nodes=31)
    assert math.atan2(math.hypot(*free.thrust[-1, :2]), free.thrust[-1, 2]) > angle + 0.02
    for plan in plans:
        assert plan.propellant == pytest.approx(plans[0].propellant, abs=0.01)
        lean = math.atan2(math.hypot(*plan.thrust[-1, :2]), plan.thrust[-1, 2])
        assert lean == pytest.approx(angle, abs=1e-3)
    assert plans[0].method == "convex"
    assert plans[0].propellant > free.propellant


def test_the_indirect_flight_is_kept_where_it_ends_as_asked():
    free = solve_pdg(START, TARGET)
    kept = solve_pdg(START, TARGET, limits=Limits(final_thrust_direction=Cone(0.2)))
    assert kept.method == free.method == "indirect"
    assert kept.thrust.tobytes() == free.thrust.tobytes()
    refused = solve_pdg(START, TARGET, limits=Limits(final_thrust_direction=Cone(0.02)))
    assert refused.method == "convex"


@pytest.mark.parametrize("time_of_flight", [None, 27.0])
def test_a_final_direction_that_pointing_forbids_is_proved_to_be_the_cause(time_of_flight):
    lander = Lander(min_thrust=1500.0, pointing_limit=0.5)
    aside = Limits(final_thrust_direction=Cone(0.2, (1.0, 0.0, 0.2)))
    plan = solve_pdg(START, TARGET, lander=lander, limits=aside, time_of_flight=time_of_flight, throw=False)
    assert plan.status is PlanStatus.INFEASIBLE
    assert plan.certificate is not None
    assert plan.certificate.verified
    assert {"final thrust direction", "pointing"} <= set(plan.certificate.causes)


def test_the_lower_bound_leaves_limits_out_and_stays_below():
    plan = planned(START, Limits(final_thrust_direction=Cone(0.02)))
    assert plan.optimality_gap > 0.0
    assert plan.certificate is not None
    assert plan.certificate.verified


@settings(max_examples=20)
@given(seed=seeds)
def test_an_upright_line_of_sight_is_the_glide_slope(seed):
    rng = np.random.default_rng(seed)
    start = paper_start(rng)
    angle = math.atan2(math.hypot(*start[:2]), start[2] - TARGET[2]) + rng.uniform(0.002, 0.05)
    slope = planned(start, Limits(glide_slope=angle))
    sight = planned(start, Limits(line_of_sight=Cone(angle)))
    assert sight.propellant == pytest.approx(slope.propellant, abs=0.01)
    assert sight.residuals.line_of_sight < 0.02
    free = planned(start, Limits())
    assert free.propellant < sight.propellant + 0.01


@settings(max_examples=25)
@given(seed=seeds)
def test_the_vehicle_stays_in_the_cone_that_leans(seed):
    """The axis points at the start, turned a little; the flown path is measured by angles alone."""
    rng = np.random.default_rng(seed)
    start = paper_start(rng)
    way = np.array(start[:3]) - TARGET
    axis = way / np.linalg.norm(way) + rng.normal(0.0, 0.02, 3)
    angle = rng.uniform(0.12, 0.3)
    plan = planned(start, Limits(line_of_sight=Cone(angle, tuple(axis))))
    seen = plan.position[:-1] - TARGET
    cosine = seen @ axis / (np.linalg.norm(seen, axis=1) * np.linalg.norm(axis))
    allowed = angle + 0.02 / np.linalg.norm(seen, axis=1)
    assert (np.arccos(np.minimum(cosine, 1.0)) <= allowed).all()


@pytest.mark.parametrize("angle", [0.03, 0.05])
def test_a_line_of_sight_costs_the_same_by_every_method(angle):
    start = [200.0, 100.0, 950.0, -25.0, -10.0, -25.0, 1200.0]
    limits = Limits(line_of_sight=Cone(angle, (200.0, 100.0, 900.0)))
    plans = [planned(start, limits, method) for method in COMPLETE]
    for plan in plans:
        assert plan.propellant == pytest.approx(plans[0].propellant, abs=0.02)
    assert plans[0].propellant > planned(start, Limits()).propellant + 0.2


def test_a_start_out_of_sight_is_told_without_a_solve_and_rounding_forgiven():
    axis = np.array([200.0, 100.0, 900.0])
    start = np.array(START)
    start[:3] = TARGET + axis
    cone = Cone(0.3, (200.0, 100.0, 600.0))
    plan = solve_pdg(start, TARGET, limits=Limits(line_of_sight=replace(cone, angle=0.05)), throw=False)
    assert plan.status is PlanStatus.INFEASIBLE
    assert plan.certificate is not None
    assert plan.certificate.causes == ("line of sight",)
    assert plan.solves == 0
    exact = math.acos(axis @ cone.direction / np.linalg.norm(axis))
    for rounding in (0.0, 1e-9, 5e-7):
        limits = Limits(line_of_sight=replace(cone, angle=exact - rounding))
        planned([*start[:3], *(-0.03 * axis), 1200.0], limits)


def test_a_free_landing_point_stays_in_sight_of_the_target():
    """Out of reach, and the cone leans along the ground: the nearest landing point lies within it."""
    start, target = [0.0, 0.0, 950.0, 0.0, 0.0, -30.0, 1200.0], np.array([3000.0, 0.0, 50.0])
    cone = Cone(0.5, (-0.9, 0.3, 0.35))
    plan = solve_pdg(
        start, target, limits=Limits(line_of_sight=cone), method="convex", nodes=31, unreachable="nearest"
    )
    free = solve_pdg(start, target, method="convex", nodes=31, unreachable="nearest")
    assert plan.status is free.status is PlanStatus.NEAREST
    assert cone.outside(plan.position - target).max() < 0.05
    assert plan.landing_error > free.landing_error - 0.1
    assert plan.keeps_limits


@settings(max_examples=25)
@given(seed=seeds)
def test_the_thrust_changes_no_faster_than_it_may(seed):
    """Sampled through `thrust_at`: size and direction of the vector together."""
    rng = np.random.default_rng(seed)
    start, slow = paper_start(rng), rng.uniform(800.0, 3000.0)
    rates = (None, 2.0 * slow, slow)
    free, wide, narrow = (planned(start, Limits(thrust_rate=rate)) for rate in rates)
    for plan, rate in ((wide, 2.0 * slow), (narrow, slow)):
        times = np.linspace(0.0, plan.time_of_flight, 1501)
        change = np.linalg.norm(np.diff(plan.thrust_at(times), axis=0), axis=1) / times[1]
        assert change.max() < 1.01 * rate
        assert np.abs(np.diff(np.linalg.norm(plan.thrust_at(times), axis=1))).max() < 1.01 * rate * times[1]
    assert free.propellant - 0.01 < wide.propellant < narrow.propellant + 0.01


@pytest.mark.parametrize("lander", [Lander(), Lander(min_thrust=1200.0)], ids=["coasting", "burning"])
def test_a_thrust_rate_costs_the_same_by_every_method(lander):
    start = [200.0, 100.0, 950.0, -25.0, -10.0, -25.0, 1200.0]
    limits = Limits(thrust_rate=1000.0)
    plans = [planned(start, limits, method, lander=lander) for method in COMPLETE]
    for plan in plans:
        assert plan.propellant == pytest.approx(plans[0].propellant, abs=0.02)
    assert plans[0].method == "convex"
    assert plans[0].propellant > planned(start, Limits(), lander=lander).propellant + 0.3


@pytest.mark.parametrize(("time_of_flight", "rate"), [(None, 10.0), (27.0, 150.0)])
def test_a_thrust_too_sluggish_to_land_is_proved_to_be_the_cause(time_of_flight, rate):
    plan = solve_pdg(
        START, TARGET, limits=Limits(thrust_rate=rate), time_of_flight=time_of_flight, throw=False
    )
    assert plan.status is PlanStatus.INFEASIBLE
    assert plan.certificate is not None
    assert plan.certificate.verified
    assert "thrust rate" in plan.certificate.causes


def test_all_limits_at_once_by_two_methods():
    limits = Limits(
        glide_slope=0.35,
        speed=60.0,
        final_thrust_direction=Cone(0.05),
        line_of_sight=Cone(0.2, (200.0, 100.0, 900.0)),
        thrust_rate=2000.0,
    )
    lander = Lander(min_thrust=1000.0, pointing_limit=0.9)
    plans = [planned(START, limits, method, lander=lander) for method in ("convex", "casadi")]
    assert plans[0].method == "convex"
    assert plans[1].propellant == pytest.approx(plans[0].propellant, abs=0.03)


def test_branches_of_a_deferred_decision_keep_the_limits():
    limits = Limits(thrust_rate=2500.0, line_of_sight=Cone(0.5), final_thrust_direction=Cone(0.05))
    problem = LandingProblem(State.parse(START), TARGET, Lander(), GRAVITY, limits)
    sites = TARGET + np.array([[0.0, 0.0, 0.0], [30.0, -20.0, 0.0], [-10.0, 40.0, 0.0]])
    decision = plan_deferred(problem, sites, budget=2.0, time_of_flight=30.0, options=TrunkOptions(31))
    assert len(decision.plans) == 3
    assert decision.shared_nodes > 3
    for plan in decision.plans:
        assert plan.keeps_limits
        assert plan.residuals.line_of_sight < 0.02
