"""Propellant and landing error weighed against each other: the ends of the scale, and what lies between."""

from itertools import pairwise

import numpy as np
import pytest
from descents import GRAVITY, TARGET, harsh_start, paper_start
from hypothesis import given, settings
from hypothesis import strategies as st

from guidance import Cone, Lander, Limits, Plan, PlanStatus, State, solve_pdg
from guidance.descent.problem import LandingProblem
from guidance.pdg.solve import PlanningMethod
from guidance.planning.convex_task import ConvexTask
from guidance.planning.minimum_propellant import minimise_over_time

START = [200.0, 100.0, 950.0, -20.0, -4.0, -30.0, 1200.0]
FAR = np.array([1500.0, 0.0, 50.0])
seeds = st.integers(0, 1_000_000)


def weighed(start, weight, target=TARGET, method: PlanningMethod = "convex", **given) -> Plan:
    plan = solve_pdg(start, target, landing_error_weight=weight, method=method, nodes=31, **given)
    assert plan.status is PlanStatus.WEIGHED
    assert plan.keeps_limits
    return plan


def cost(plan, weight):
    return plan.propellant + weight * plan.landing_error


@settings(max_examples=20)
@given(seed=seeds)
def test_no_weights_plan_is_cheaper_at_another_weight(seed):
    """Each plan is the best of all at its own weight; so error falls and propellant rises with the weight."""
    rng = np.random.default_rng(seed)
    start = paper_start(rng)
    weights = np.sort(10.0 ** rng.uniform(-3.0, -0.5, 4))
    plans = [weighed(start, float(weight)) for weight in weights]
    for weight, best in zip(weights, plans, strict=True):
        for other in plans:
            assert cost(best, weight) < cost(other, weight) + 0.012
    for low, high in pairwise(plans):
        assert high.landing_error < low.landing_error + 1.0
        assert high.propellant > low.propellant - 0.02


@settings(max_examples=20)
@given(seed=seeds)
def test_the_ends_of_the_scale(seed):
    rng = np.random.default_rng(seed)
    start = paper_start(rng)
    problem = LandingProblem(State.parse(start), TARGET, Lander(), GRAVITY)
    anywhere = minimise_over_time(ConvexTask(problem, 31, free_landing_point=True)).solution
    assert anywhere is not None
    propellant = start[6] * -np.expm1(-anywhere.log_mass_ratio)
    assert weighed(start, 0.0).propellant == pytest.approx(propellant, abs=0.01)
    plan = weighed(start, 50.0)
    assert plan.landing_error < 1e-3
    target = solve_pdg(start, TARGET, method="convex", nodes=31)
    assert plan.propellant == pytest.approx(target.propellant, abs=0.012)


@pytest.mark.parametrize("lander", [Lander(), Lander(min_thrust=1200.0)], ids=["coasting", "burning"])
def test_out_of_reach_a_great_weight_lands_at_the_nearest_point(lander):
    near = solve_pdg(START, FAR, method="convex", nodes=31, unreachable="nearest", lander=lander)
    assert near.status is PlanStatus.NEAREST
    plan = weighed(START, 100.0, FAR, lander=lander)
    assert near.landing_error - 0.5 < plan.landing_error < near.landing_error + 0.05


@pytest.mark.parametrize("weight", [0.0, 0.005, 0.01, 0.02, 1.0])
@pytest.mark.parametrize("lander", [Lander(), Lander(min_thrust=1200.0)], ids=["coasting", "burning"])
def test_both_methods_find_the_same_cost(weight, lander):
    convex, casadi = (weighed(START, weight, lander=lander, method=name) for name in ("convex", "casadi"))
    assert cost(casadi, weight) == pytest.approx(cost(convex, weight), abs=0.02)
    assert casadi.method == "casadi"
    auto = weighed(START, weight, lander=lander, method="auto")
    assert auto.method == "convex"
    assert auto.thrust.tobytes() == convex.thrust.tobytes()


@pytest.mark.parametrize("weight", [0.008, 0.3])
@pytest.mark.parametrize("time", [24.0, 30.0])
def test_slope_is_the_derivative_of_the_optimum(weight, time):
    problem = LandingProblem(State.parse(START), TARGET, Lander(), GRAVITY)
    task = ConvexTask(
        problem,
        31,
        free_landing_point=True,
        limit_propellant=True,
        tolerance=1e-9,
        error_price=weight / 1170.0,
    )
    reference, h = task.solve(time).log_mass, 2e-4 * time
    middle, below, above = (task.solve(t, reference) for t in (time, time - h, time + h))
    scale = 1.62 / problem.lander.exhaust_velocity
    assert middle.slope == pytest.approx((above.value - below.value) / (2.0 * h), rel=2e-2, abs=2e-3 * scale)
    priced = middle.log_mass_ratio + task.error_price * middle.landing_error
    assert middle.value == pytest.approx(priced, rel=1e-6)


@pytest.mark.parametrize("method", ["convex", "casadi"])
def test_a_time_of_flight_limits_and_rotation_are_kept(method):
    limits = Limits(glide_slope=0.5, thrust_rate=2500.0, final_thrust_direction=Cone(0.1))
    lander = Lander(min_thrust=800.0, pointing_limit=1.0)
    plan = weighed(
        START,
        0.004,
        method=method,
        limits=limits,
        lander=lander,
        time_of_flight=30.0,
        angular_velocity=(4e-3, 2e-3, -6e-3),
    )
    assert plan.time_of_flight == 30.0
    assert plan.landing_error > 1.0
    assert plan.residuals.landing_position < 0.05


@pytest.mark.parametrize("method", ["auto", "convex", "casadi"])
def test_where_no_soft_landing_exists_that_is_proved(method):
    start = [0.0, 0.0, 110.0, 0.0, 0.0, -60.0, 1200.0]
    plan = solve_pdg(start, TARGET, landing_error_weight=0.1, method=method, throw=False)
    assert plan.status is PlanStatus.INFEASIBLE
    assert plan.certificate is not None
    assert plan.certificate.verified


@pytest.mark.parametrize("seed", range(15))
def test_harsh_starts_land_somewhere_wherever_the_nearest_point_can_be_had(seed):
    start = harsh_start(np.random.default_rng([8, seed]))
    near = solve_pdg(start, TARGET, method="convex", nodes=31, unreachable="nearest", throw=False)
    plan = solve_pdg(start, TARGET, landing_error_weight=0.02, method="convex", nodes=31, throw=False)
    assert plan.status.has_flight == near.status.has_flight
    if plan.status.has_flight:
        assert plan.keeps_limits
        assert cost(plan, 0.02) < cost(near, 0.02) + 0.02
