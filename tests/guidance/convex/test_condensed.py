"""The problem without its states against the whole one: same optimum, same slope, same flight."""

from dataclasses import replace

import numpy as np
import pytest
from descents import FEASIBLE, GRAVITY, TARGET, feasible_start, harsh_start, paper_start, problem_of
from hypothesis import given
from hypothesis import strategies as st

from guidance import PAPER_LANDER, State
from guidance.convex import constraints
from guidance.convex.clarabel_solver import SolveStatus
from guidance.convex.condensed import burnt_mass, expand, keeps_altitude, landing_moments
from guidance.convex.constraint_set import ConstraintSet
from guidance.convex.layout import CondensedLayout, Layout
from guidance.convex.programme import convex_template
from guidance.convex.scaling import scale_problem
from guidance.descent.problem import LandingProblem
from guidance.flight_time.time_window import guess_time, time_window
from guidance.planning.convex_task import ConvexTask

NODES = 31


def problem_from(start) -> LandingProblem:
    return LandingProblem(State.parse(start), TARGET, PAPER_LANDER, GRAVITY)


@given(seed=st.integers(0, 10_000), nodes=st.integers(5, 40))
def test_any_thrust_expands_to_exact_motion_and_lands_as_the_moments_say(seed, nodes):
    rng = np.random.default_rng(seed)
    layout, whole = CondensedLayout(nodes), Layout(nodes)
    scaled = scale_problem(problem_from(paper_start(rng)), 27.0, nodes)
    thrust = rng.normal(size=layout.size)
    thrust[layout.log_mass] = -np.concatenate(
        [[0.0], np.cumsum(thrust[layout.slack][1:] + thrust[layout.slack][:-1])]
    ) / (2.0 * (nodes - 1))
    full = expand(layout, scaled, thrust)
    assert constraints.motion(whole, scaled).violation(full) < 1e-12
    assert constraints.start(whole, scaled).violation(full) < 1e-12
    assert burnt_mass(layout, scaled).violation(thrust) < 1e-12
    miss = landing_moments(layout, scaled).slack_of(thrust).ravel()
    np.testing.assert_allclose(-miss[:3], full[whole.position[-1]], atol=1e-12)
    np.testing.assert_allclose(-miss[3:], full[whole.velocity[-1]], atol=1e-12)


def check_same(problem: LandingProblem, time: float):
    task = ConvexTask(problem, NODES)
    condensed, whole = task.solve(time), replace(task, condense=False).solve(time)
    assert condensed.answer.status is whole.answer.status
    if whole.solved:
        assert condensed.value == pytest.approx(whole.value, rel=1e-6)
        assert condensed.slope == pytest.approx(whole.slope, rel=1e-3, abs=1e-6)
        a, b = condensed.trajectory(problem), whole.trajectory(problem)
        scale = condensed.scaled.length
        np.testing.assert_allclose(a.position[-1], b.position[-1], atol=1e-7 * scale)
        np.testing.assert_allclose(a.mass, b.mass, rtol=1e-4)


@pytest.mark.parametrize("case", FEASIBLE, ids=lambda case: case["name"])
def test_same_optimum_on_the_reference_cases(case):
    for stretch in (1.01, 1.2):
        check_same(problem_of(case), stretch * case["optimal_time_of_flight"])


@pytest.mark.parametrize("sampler", [paper_start, feasible_start, harsh_start])
def test_same_optimum_and_same_status_on_dispersed_starts(sampler):
    rng = np.random.default_rng(41)
    for _ in range(25):
        problem = problem_from(sampler(rng))
        window = time_window(problem)
        if not window.empty:
            guess = guess_time(problem, window)
            for time in (0.8 * guess, guess, 1.3 * guess):
                check_same(problem, time)


def test_where_the_way_leads_below_the_target_the_whole_problem_is_solved():
    problem = problem_from([199.6, 0.0, 56.4, 19.1, 0.0, -10.1, 1200.0])
    chosen, scaled = ConstraintSet.of(problem, NODES), scale_problem(problem, 15.0, NODES)
    low = convex_template(chosen, condensed=True).solve(scaled)
    assert low.solved
    assert not keeps_altitude(low.layout, low.answer.primal)
    kept = ConvexTask(problem, NODES).solve(15.0)
    assert kept.solved
    assert keeps_altitude(kept.layout, kept.answer.primal)
    assert kept.value > low.value * (1.0 + 1e-4)


def test_what_is_infeasible_only_by_the_floor_is_told_so():
    problem = problem_from([0.0, 0.0, 110.0, 0.0, 0.0, -60.0, 1200.0])
    through = convex_template(ConstraintSet(NODES), condensed=True).solve(scale_problem(problem, 15.0, NODES))
    assert through.solved
    assert ConvexTask(problem, NODES).solve(15.0).answer.status is SolveStatus.INFEASIBLE


def test_limits_on_the_path_are_not_condensed():
    assert ConstraintSet(NODES, min_thrust=True, pointing=True, final_thrust_direction=True).can_condense
    for name in ("glide_slope", "speed_limit", "line_of_sight", "rotates", "free_landing_point"):
        assert not ConstraintSet(NODES, **{name: True}).can_condense
