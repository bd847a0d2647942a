"""The branched programme: against single flights, flown through the true motion, and as its budget grows."""

from dataclasses import replace

import numpy as np
import pytest

from guidance import Lander, State
from guidance.descent.problem import LandingProblem
from guidance.planning.convex_task import ConvexTask
from guidance.planning.deferred_decision import TrunkOptions, plan_deferred

TIME = 24.5
NODES = 21
OPTIONS = TrunkOptions(NODES)
SITES = np.array([[180.0, 60.0, 50.0], [200.0, 60.0, 50.0], [150.0, 110.0, 50.0]])
PROBLEM = LandingProblem(
    State(np.array([0.0, 0.0, 950.0]), np.array([5.0, 2.0, -28.0]), 1200.0),
    SITES[0],
    Lander(),
    np.array([0.0, 0.0, -1.62]),
)


def cheapest_alone(problem: LandingProblem):
    task = ConvexTask(problem, NODES)
    return task.refine(task.solve(TIME))[0]


def test_one_candidate_is_the_fixed_time_convex_solve():
    alone = cheapest_alone(PROBLEM)
    again = ConvexTask(PROBLEM, NODES).solve(TIME, alone.log_mass)  # the same thrust bounds
    expected = again.trajectory(PROBLEM)
    answer = plan_deferred(PROBLEM, SITES[0], 0.5, TIME, OPTIONS)
    (plan,) = answer.plans
    assert answer.shared_nodes == NODES
    np.testing.assert_allclose(plan.position, expected.position, atol=2e-3)
    np.testing.assert_allclose(plan.velocity, expected.velocity, atol=1e-3)
    assert plan.propellant == pytest.approx(1200.0 * -np.expm1(-again.log_mass_ratio), abs=1e-4)


@pytest.mark.parametrize("budget", [0.3, 1.0])
def test_the_trunk_is_shared_exactly_and_every_branch_flies_to_its_site_within_budget(budget):
    answer = plan_deferred(PROBLEM, SITES, budget, TIME, OPTIONS)
    shared = answer.shared_nodes
    assert 1 < shared < NODES
    first = answer.plans[0]
    assert answer.parting_time == pytest.approx(first.time[shared - 1])
    for site, plan in zip(SITES, answer.plans, strict=True):
        for name in ("position", "velocity", "mass", "thrust"):
            np.testing.assert_array_equal(getattr(plan, name)[:shared], getattr(first, name)[:shared])
        np.testing.assert_allclose(plan.position[-1], site, atol=1e-4)
        alone = cheapest_alone(replace(PROBLEM, target=site))
        assert plan.propellant <= 1200.0 * -np.expm1(-alone.log_mass_ratio) + budget + 1e-3
        flown = plan.residuals
        assert flown.landing_position < 0.05
        assert flown.landing_velocity < 0.02
        assert flown.thrust_above < 12.0  # 0.1 % of the full thrust
        assert flown.altitude < 0.01


def test_a_larger_budget_never_parts_the_branches_earlier():
    answers = [plan_deferred(PROBLEM, SITES, budget, TIME, OPTIONS) for budget in (0.0, 0.1, 0.3, 1.0, 3.0)]
    shared = [answer.shared_nodes for answer in answers]
    assert shared == sorted(shared)
    assert shared[-1] > shared[0]


def test_nearer_candidates_share_a_longer_trunk():
    pair = np.array([SITES[0], SITES[0] + [60.0, 0.0, 0.0]])
    near = np.array([SITES[0], SITES[0] + [6.0, 0.0, 0.0]])
    wide = plan_deferred(PROBLEM, pair, 0.3, TIME, OPTIONS)
    assert plan_deferred(PROBLEM, near, 0.3, TIME, OPTIONS).shared_nodes > wide.shared_nodes


def test_a_candidate_out_of_reach_is_numbered():
    sites = np.vstack([SITES[:1], [[9000.0, 0.0, 50.0]]])
    answer = plan_deferred(PROBLEM, sites, 0.5, TIME, OPTIONS)
    assert answer.unreachable == (1,)
    assert not answer.plans


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"targets": SITES[:, :2]}, "targets"),
        ({"targets": SITES + np.diag([0.0, 0.0, 1.0])[[0, 2, 0]]}, "altitude"),
        ({"budget": -1.0}, "budget"),
        ({"time_of_flight": 0.0}, "time_of_flight"),
        ({"options": {"weights": [1.0, -1.0, 0.0]}}, "weights"),
        ({"options": {"parting_time": float("nan")}}, "parting_time"),
    ],
)
def test_a_bad_argument_is_named(change, word):
    arguments = {"targets": SITES, "budget": 0.5, "time_of_flight": TIME, "options": {}} | change
    with pytest.raises(ValueError, match=word):
        plan_deferred(PROBLEM, **arguments | {"options": TrunkOptions(NODES, **arguments["options"])})


@pytest.mark.parametrize("guess", [-5.0, 0.0, 0.3 * TIME, TIME, 9.0 * TIME])
def test_what_is_known_of_the_parting_changes_nothing_but_the_work(guess):
    plain = plan_deferred(PROBLEM, SITES, 0.5, TIME, OPTIONS)
    told = plan_deferred(PROBLEM, SITES, 0.5, TIME, TrunkOptions(NODES, parting_time=guess))
    assert told.shared_nodes == plain.shared_nodes
    for one, other in zip(told.plans, plain.plans, strict=True):
        assert one.thrust.tobytes() == other.thrust.tobytes()
    knowing = plan_deferred(PROBLEM, SITES, 0.5, TIME, TrunkOptions(NODES, parting_time=plain.parting_time))
    assert knowing.solves <= min(plain.solves, told.solves)
