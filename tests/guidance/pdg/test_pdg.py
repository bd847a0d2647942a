"""`solve_pdg` end to end: optima by three methods, refusals, dispersed and harsh starts, replanning."""

import math
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from descents import (
    COMPLETE,
    FEASIBLE,
    IMPOSSIBLE,
    TARGET,
    arguments,
    feasible_start,
    harsh_start,
    paper_start,
    start_with_strong_engine,
)

import guidance
from guidance import InfeasibleError, Lander, PlanStatus, SolverFailedError, State
from guidance.convex.clarabel_solver import ConicSolver
from guidance.convex.farkas import FarkasProof
from guidance.pdg.request import remaining_time
from guidance.planning.convex_task import ConvexTask
from guidance.planning.infeasibility import prove_at

NAMES = [case["name"] for case in FEASIBLE]
START = [180.0, 120.0, 940.0, -7.0, -4.0, -28.0, 1200.0]


def check_flight(plan):
    """What every plan with a flight promises, measured in SI on the flown plan.

    Flights of one duration are similar with lengths in proportion to gravity, and so is what a mesh hides.
    """
    flown, lander = plan.residuals, plan.problem.lander
    unit = max(1.0, float(np.linalg.norm(plan.problem.gravity)) / 1.62)
    assert flown.position < 0.5 * unit
    assert flown.velocity < 0.1 * unit
    assert flown.thrust_above <= 1e-3 * lander.max_thrust
    assert flown.thrust_below <= 1e-3 * lander.min_thrust
    assert flown.propellant < 1e-3
    assert flown.altitude < 0.2 * unit
    assert flown.pointing < 1e-3
    assert flown.glide_slope < 0.5 * unit
    assert plan.mass[-1] >= lander.dry_mass - 1e-5
    assert (plan.position[:, 2] >= plan.problem.target[2] - 1e-3).all()


@pytest.mark.parametrize("method", COMPLETE)
@pytest.mark.parametrize("case", FEASIBLE, ids=NAMES)
def test_reference_optima(case, method):
    plan = guidance.solve_pdg(**arguments(case), method=method)
    allowed = 0.15 if case["name"] == "mars-6-engine" else 0.03
    assert plan.status is PlanStatus.OPTIMAL
    assert plan.method == method or method == "auto"
    assert abs(plan.mass[-1] - case["optimal_final_mass"]) < allowed
    assert plan.time_of_flight == pytest.approx(case["optimal_time_of_flight"], abs=0.35)
    check_flight(plan)


@pytest.mark.parametrize("case", FEASIBLE, ids=NAMES)
def test_methods_agree(case):
    masses = [guidance.solve_pdg(**arguments(case), method=method).mass[-1] for method in COMPLETE]
    assert max(masses) - min(masses) < 0.05


@pytest.mark.parametrize("method", COMPLETE)
@pytest.mark.parametrize("case", IMPOSSIBLE, ids=lambda case: case["name"])
def test_impossible_cases(case, method):
    with pytest.raises(InfeasibleError) as caught:
        guidance.solve_pdg(**arguments(case), method=method)
    proof = caught.value.plan.certificate
    assert proof is not None
    assert proof.verified
    assert guidance.solve_pdg(**arguments(case), method=method, throw=False).status is PlanStatus.INFEASIBLE


@pytest.mark.parametrize("method", COMPLETE)
def test_infeasible_beyond_closed_form_bounds_by_every_method(method):
    plan = guidance.solve_pdg(START, [1900.0, 0.0, 50.0], method=method, nodes=31, throw=False)
    assert plan.status is PlanStatus.INFEASIBLE
    assert plan.certificate is not None
    assert plan.certificate.verified


@pytest.mark.parametrize("method", COMPLETE)
@pytest.mark.parametrize("time_of_flight", [None, 29.0])
@pytest.mark.parametrize(
    ("limits", "cause"), [({"glide_slope_limit": 0.2}, "glide slope"), ({"speed_limit": 29.0}, "speed")]
)
def test_a_start_that_breaks_a_limit_is_infeasible_without_a_solve(limits, cause, time_of_flight, method):
    plan = guidance.solve_pdg(
        START, TARGET, method=method, time_of_flight=time_of_flight, nodes=21, throw=False, **limits
    )
    assert plan.status is PlanStatus.INFEASIBLE
    assert plan.certificate is not None
    assert plan.certificate.causes == (cause,)
    assert not plan.certificate.proofs


def test_a_start_on_the_edge_of_its_limits_can_fly():
    """Radius 300 m at 300 m: on the cone of 45 degrees, moving inward at the very limit of speed."""
    plan = guidance.solve_pdg(
        [300, 0, 350, -12, 0, -5, 1200], TARGET, glide_slope_limit=math.pi / 4, speed_limit=13.0
    )
    check_flight(plan)


# found by a sweep over random vehicles, limits and gravities
NO_SOLVER_CERTIFICATE = (
    [-34.3, 36.7, 205.5, -3.1, 5.6, -16.4, 1233.466],
    Lander(max_thrust=3077.663, specific_impulse=388.5878, min_thrust=307.766, pointing_limit=2.2),
    {"gravity": (0, 0, -1.62), "glide_slope_limit": 0.35},
)
TANK_BEYOND_WHAT_THE_ENGINE_BURNS = (
    [1.0, -0.4, 14.3, 0.6, 0.6, -4.5, 1657.875],
    Lander(1505.0, 1573.871, 283.847, min_thrust=944.3227, pointing_limit=1.0),
    {"gravity": (0, 0, -0.3), "glide_slope_limit": 1.2},
)


def test_infeasible_where_the_solver_gives_no_certificate():
    start, lander, options = NO_SOLVER_CERTIFICATE
    plan = guidance.solve_pdg(start, [0, 0, 0], lander=lander, throw=False, **options)
    assert plan.status is PlanStatus.INFEASIBLE
    assert plan.certificate is not None
    assert len(plan.certificate.proofs) == 24
    assert plan.certificate.verified


def test_infeasible_where_the_solver_gives_a_loose_certificate():
    """By the cones alone at every time; all in all a closed form says it without them."""
    start, lander, options = TANK_BEYOND_WHAT_THE_ENGINE_BURNS
    plan = guidance.solve_pdg(start, [0, 0, 0], lander=lander, throw=False, **options)
    assert plan.status is PlanStatus.INFEASIBLE
    assert plan.certificate is not None
    assert plan.certificate.causes == ("altitude",)
    task = ConvexTask(plan.problem, 61)
    for time in np.geomspace(2.0, 40.0, 12):
        proof = prove_at(task, float(time))
        assert isinstance(proof, FarkasProof)
        assert proof.verified


RELAXATION_BREAKS_MIN_THRUST = (
    [112.6, 354.3, 500.1, 33.0, -7.067, -34.16, 9794.0],
    [-22.3, 382.0, 219.9],
    Lander(8000.0, 580900.0, 359.8, min_thrust=348600.0, pointing_limit=2.2),
    {"gravity": (0, 0, -9.81), "speed_limit": 55.637},
)


@pytest.mark.parametrize("time_of_flight", [None, 8.0])
def test_where_relaxing_loses_the_unrelaxed_problem_answers_and_says_so(time_of_flight):
    start, target, lander, options = RELAXATION_BREAKS_MIN_THRUST
    plan = guidance.solve_pdg(start, target, lander=lander, time_of_flight=time_of_flight, **options)
    assert plan.status is PlanStatus.OPTIMAL
    assert plan.method == "casadi"
    assert "the relaxed optimum breaks min_thrust" in plan.message
    check_flight(plan)


@pytest.mark.parametrize("method", COMPLETE)
def test_fixed_time_by_every_method(method):
    plan = guidance.solve_pdg(START, TARGET, time_of_flight=29.0, nodes=41, method=method)
    assert plan.time_of_flight == pytest.approx(29.0)
    assert plan.time[-1] == plan.time_of_flight
    assert plan.nodes == 41
    best = guidance.solve_pdg(START, TARGET, time_of_flight=29.0, nodes=41)
    assert plan.mass[-1] == pytest.approx(best.mass[-1], abs=0.05)
    check_flight(plan)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"state": [0, 0, 900, 0, 0, math.nan, 1200]}, "state"),
        ({"state": [0, 0, 900, 0, 0, 1200]}, "state"),
        ({"state": [0, 0, math.inf, 0, 0, 0, 1200]}, "state"),
        ({"state": [0, 0, 900, 0, 0, -20, 1150]}, "mass"),
        ({"state": [0, 0, 900, 0, 0, -20, -5]}, "mass"),
        ({"state": [0, 0, 49.9, 0, 0, 0, 1200]}, "altitude"),
        ({"target": [0, 0]}, "target"),
        ({"target": [0, 0, math.nan]}, "target"),
        ({"gravity": [0, 0, -math.inf]}, "gravity"),
        ({"gravity": -1.62}, "gravity"),
        ({"target_velocity": [0, 0]}, "target_velocity"),
        ({"target_velocity": [0, 0, math.nan]}, "target_velocity"),
        ({"target_velocity": [0, 0, -1e10]}, "target_velocity"),
        ({"target_velocity": None}, "target_velocity"),
        ({"angular_velocity": [0, 0]}, "angular_velocity"),
        ({"angular_velocity": [0, math.inf, 0]}, "angular_velocity"),
        ({"lander": "apollo"}, "lander"),
        ({"glide_slope_limit": 1.6}, "glide_slope_limit"),
        ({"glide_slope_limit": 0.0}, "glide_slope_limit"),
        ({"speed_limit": -1.0}, "speed_limit"),
        ({"time_of_flight": -3.0}, "time_of_flight"),
        ({"time_of_flight": math.nan}, "time_of_flight"),
        ({"nodes": 2}, "nodes"),
        ({"nodes": 30.5}, "nodes"),
        ({"method": "magic"}, "auto, indirect, convex, casadi, cvxpy"),
        ({"unreachable": "give up"}, "unreachable"),
        ({"landing_error_weight": -0.1}, "landing_error_weight"),
        ({"landing_error_weight": math.inf}, "landing_error_weight"),
        ({"landing_error_weight": 0.1, "method": "indirect"}, "landing_error_weight"),
        ({"landing_error_weight": 0.1, "method": "cvxpy"}, "landing_error_weight"),
        ({"guess": [1, 2]}, "guess"),
    ],
)
@pytest.mark.parametrize("throw", [True, False])
def test_wrong_arguments_are_named_before_any_solver_runs(change, name, throw, monkeypatch):
    def never(*_):
        raise AssertionError("a solver was called")

    monkeypatch.setattr(ConicSolver, "solve", never)
    given = {"state": START, "target": TARGET} | change
    with pytest.raises(ValueError, match=name):
        guidance.solve_pdg(**given, throw=throw)


def test_accepts_a_state():
    a = guidance.solve_pdg(State.parse(START), TARGET)
    b = guidance.solve_pdg(np.array(START), TARGET.tolist())
    assert a.thrust.tobytes() == b.thrust.tobytes()


def test_answers_do_not_depend_on_history():
    before = guidance.solve_pdg(START, TARGET)
    rng = np.random.default_rng(5)
    for _ in range(3):
        guidance.solve_pdg(harsh_start(rng), TARGET, throw=False, unreachable="nearest")
    after = guidance.solve_pdg(START, TARGET)
    assert after.thrust.tobytes() == before.thrust.tobytes()
    assert after.time_of_flight == before.time_of_flight


FAST = ("auto", "convex")


class Panic(BaseException):
    """Stands for a pyo3 panic."""


class Broken:
    def update(self, **_):
        raise Panic("attempt to subtract with overflow")


def test_a_broken_solver_is_a_status_not_an_exception(monkeypatch):
    def broken(self, values, bound, cost):
        self._solver = Broken()
        return solve(self, values, bound, cost)

    solve = ConicSolver.solve
    monkeypatch.setattr(ConicSolver, "solve", broken)
    with ThreadPoolExecutor(1) as thread:  # solvers are kept per thread, and these must not outlive the test
        plan = thread.submit(guidance.solve_pdg, START, TARGET, method="convex", throw=False).result()
        assert plan.status in (PlanStatus.SOLVER_FAILED, PlanStatus.LIMIT_REACHED)
        assert plan.certificate is None
        with pytest.raises(SolverFailedError):
            thread.submit(guidance.solve_pdg, START, TARGET, method="convex").result()


@pytest.mark.parametrize("scale", [0.03, 1.0, 30.0])
def test_large_and_small_scales(scale):
    """Model rocket to orbiter: similar descents (lengths and exhaust velocity scaled) burn similar shares."""
    root = math.sqrt(scale)
    start = [100 * scale, 50 * scale, 500 * scale, -3 * root, 2 * root, -15 * root, 1200.0]
    lander = Lander(specific_impulse=325.0 * root)
    plan = guidance.solve_pdg(start, [0, 0, 0], lander=lander)
    similar = guidance.solve_pdg([100, 50, 500, -3, 2, -15, 1200], [0, 0, 0])
    assert plan.mass[-1] == pytest.approx(similar.mass[-1], abs=0.01)
    assert plan.residuals.position < 1e-4 * 500 * scale


def test_any_gravity_vector():
    tilted = guidance.solve_pdg(START, TARGET, gravity=[0.4, -0.3, -1.5])
    check_flight(tilted)
    none = guidance.solve_pdg([50, 0, 200, -5, 0, -10, 1200], TARGET, gravity=[0, 0, 0])
    assert none.residuals.position < 0.5


def test_a_start_on_the_target_plane_and_at_rest_on_target():
    hop = guidance.solve_pdg([30, 0, 50, 0, 0, 0, 1200], TARGET)
    check_flight(hop)
    assert hop.position[:, 2].max() > 51.0
    still = guidance.solve_pdg([0, 0, 50, 0, 0, 0, 1200], TARGET, throw=False)
    assert still.status is not PlanStatus.SOLVER_FAILED


def disperse(sampler, count, seed, **options):
    rng = np.random.default_rng(seed)
    return [guidance.solve_pdg(sampler(rng), TARGET, throw=False, **options) for _ in range(count)]


def check_dispersed_paper_starts(count, seed, method):
    plans = disperse(paper_start, count, seed, method=method)
    assert {plan.status for plan in plans} == {PlanStatus.OPTIMAL}
    for plan in plans[:: max(1, count // 50)]:
        check_flight(plan)


def check_harsh_starts(count, seed, method):
    raised = disperse(harsh_start, count, seed, method=method)
    labelled = {PlanStatus.OPTIMAL, PlanStatus.INFEASIBLE, PlanStatus.LIMIT_REACHED}
    assert {plan.status for plan in raised} <= labelled
    undecided = [plan for plan in raised if plan.status is PlanStatus.LIMIT_REACHED]
    assert len(undecided) <= 0.02 * count, [plan.message for plan in undecided]
    for plan in raised:
        if plan.status is PlanStatus.INFEASIBLE:
            assert plan.certificate is not None
            assert plan.certificate.verified
    nearest = disperse(harsh_start, count, seed, method=method, unreachable="nearest")
    saved = 0
    for plan, other in zip(raised, nearest, strict=True):
        if plan.status is PlanStatus.OPTIMAL:
            assert other.status is PlanStatus.OPTIMAL
        saved += other.status is PlanStatus.NEAREST
    assert saved > 0.03 * count
    for plan in [plan for plan in nearest if plan.status.has_flight][:: max(1, count // 40)]:
        check_flight(plan)


def check_feasible_starts(count, seed, method):
    plans = disperse(feasible_start, count, seed, method=method)
    spurious = [plan.problem.state for plan in plans if plan.status is not PlanStatus.OPTIMAL]
    assert not spurious


def check_strong_engines(count, seed):
    rng = np.random.default_rng(seed)
    plans = [guidance.solve_pdg(**start_with_strong_engine(rng), throw=False) for _ in range(count)]
    flights = [plan for plan in plans if plan.status is PlanStatus.OPTIMAL]
    for plan in flights:
        check_flight(plan)
    for plan in plans:
        if plan.status is PlanStatus.INFEASIBLE:
            assert plan.certificate is not None
            assert plan.certificate.verified
    decided = (PlanStatus.OPTIMAL, PlanStatus.INFEASIBLE)
    undecided = [plan.message for plan in plans if plan.status not in decided]
    assert len(undecided) <= 0.02 * count, undecided
    assert sum(plan.method == "casadi" for plan in flights) > 0.02 * count  # the fallback is exercised


@pytest.mark.parametrize("method", FAST)
def test_dispersed_paper_starts(method):
    check_dispersed_paper_starts(200, 11, method)


@pytest.mark.parametrize("method", FAST)
def test_harsh_starts(method):
    check_harsh_starts(60, 12, method)


@pytest.mark.parametrize("method", FAST)
def test_no_spurious_infeasibility(method):
    check_feasible_starts(100, 13, method)


def test_engines_that_cannot_hover():
    check_strong_engines(40, 14)


@pytest.mark.slow
def test_many_engines_that_cannot_hover():
    check_strong_engines(300, 24)


@pytest.mark.slow
@pytest.mark.parametrize("method", FAST)
def test_many_dispersed_paper_starts(method):
    check_dispersed_paper_starts(2000, 21, method)


@pytest.mark.slow
@pytest.mark.parametrize("method", FAST)
def test_many_harsh_starts(method):
    check_harsh_starts(500, 22, method)


@pytest.mark.slow
@pytest.mark.parametrize("method", FAST)
def test_no_spurious_infeasibility_on_many(method):
    check_feasible_starts(500, 23, method)


def test_auto_says_what_it_chose():
    """Exact where no limit binds; else as the convex method, which is asked next."""
    free = guidance.solve_pdg(START, TARGET)
    assert free.method == "indirect"
    assert free.solves == 0
    choices: list[dict[str, Any]] = [
        {"lander": Lander(pointing_limit=0.4)},
        {"speed_limit": 45.0},
        {"glide_slope_limit": 0.3},
    ]
    for limits in choices:
        bound = guidance.solve_pdg(START, TARGET, **limits)
        convex = guidance.solve_pdg(START, TARGET, method="convex", **limits)
        assert bound.method == "convex"
        assert bound.thrust.tobytes() == convex.thrust.tobytes()
    late = guidance.solve_pdg(START, TARGET, target_velocity=[0.0, 0.0, -1.0])
    assert late.method == "convex"


def test_the_indirect_method_alone_says_that_others_may_know():
    plan = guidance.solve_pdg(START, TARGET, speed_limit=45.0, method="indirect", throw=False)
    assert plan.status is PlanStatus.LIMIT_REACHED
    assert "method 'auto' asks others" in plan.message
    nowhere = guidance.solve_pdg([0, 0, 110, 0, 0, -60, 1200], TARGET, method="indirect", throw=False)
    assert nowhere.status is PlanStatus.INFEASIBLE


def test_what_auto_gains_is_what_a_mesh_costs():
    """Exact flights are cheaper than those on 61 nodes, by grams."""
    rng = np.random.default_rng(17)
    for _ in range(30):
        start = paper_start(rng)
        exact, mesh = guidance.solve_pdg(start, TARGET), guidance.solve_pdg(start, TARGET, method="convex")
        assert exact.method == "indirect"
        assert -1e-4 < mesh.propellant - exact.propellant < 0.01


def test_nearest_is_feasible_cheaper_ones_are_not_and_nearer_ones_neither():
    """The landing error is the least: that point is reachable, one five metres nearer is not."""
    far = np.array([2500.0, 600.0, 50.0])
    plan = guidance.solve_pdg(START, far, unreachable="nearest")
    assert plan.status is PlanStatus.NEAREST
    landing = plan.position[-1]
    assert landing[2] == pytest.approx(50.0, abs=1e-3)
    assert plan.landing_error == pytest.approx(float(np.linalg.norm(landing - far)), abs=1e-3)
    assert plan.landing_error < np.linalg.norm(far[:2] - START[:2])
    check_flight(plan)
    there = guidance.solve_pdg(START, landing, throw=False)
    assert there.status is PlanStatus.OPTIMAL
    toward = (far - landing) / np.linalg.norm(far - landing)
    nearer = guidance.solve_pdg(START, landing + 5.0 * toward, throw=False)
    assert nearer.status is PlanStatus.INFEASIBLE


def test_nearest_at_a_fixed_time():
    plan = guidance.solve_pdg(START, [1900.0, 0.0, 50.0], time_of_flight=25.0, unreachable="nearest")
    assert plan.status is PlanStatus.NEAREST
    assert plan.time_of_flight == 25.0
    check_flight(plan)


def test_nearest_where_the_target_can_be_reached_is_the_optimum():
    plain = guidance.solve_pdg(START, TARGET)
    asked = guidance.solve_pdg(START, TARGET, unreachable="nearest")
    assert asked.status is PlanStatus.OPTIMAL
    assert asked.thrust.tobytes() == plain.thrust.tobytes()


def test_no_soft_landing_anywhere_is_infeasible_even_for_nearest():
    plan = guidance.solve_pdg([0, 0, 110, 0, 0, -60, 1200], TARGET, unreachable="nearest", throw=False)
    assert plan.status is PlanStatus.INFEASIBLE
    with pytest.raises(InfeasibleError, match="altitude"):
        guidance.solve_pdg([0, 0, 110, 0, 0, -60, 1200], TARGET, unreachable="nearest")


def test_every_solve_is_counted():
    """All calls of the conic solver but those of proofs, whatever the way to the plan."""
    rng, before = np.random.default_rng(9), ConicSolver.solve
    starts = [paper_start(rng) for _ in range(5)] + [harsh_start(rng) for _ in range(15)]
    choices: list[dict[str, Any]] = [{}, {"lander": Lander(pointing_limit=0.4)}, {"speed_limit": 60.0}]
    for start in starts:
        for options in choices:
            guidance.solve_pdg(start, TARGET, throw=False, **options)  # builds the solvers
            calls = []

            def count(*numbers, calls=calls):
                calls.append(1)
                return before(*numbers)

            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(ConicSolver, "solve", count)
                plan = guidance.solve_pdg(start, TARGET, throw=False, **options)
            if plan.status is PlanStatus.OPTIMAL:
                assert plan.solves <= len(calls) <= 2 * plan.solves  # the altitude floor may need a second


def test_replanning_from_a_guess():
    """On the way, undisturbed: the rest of the plan is the optimum (Bellman), found in fewer solves."""
    plan = guidance.solve_pdg(START, TARGET)
    k = 20
    here = [*plan.position[k], *plan.velocity[k], plan.mass[k]]
    assert remaining_time(plan, State.parse(here)) == pytest.approx(plan.time_of_flight - plan.time[k])
    again = guidance.solve_pdg(here, TARGET, guess=plan)
    assert again.status is PlanStatus.OPTIMAL
    assert again.mass[-1] == pytest.approx(plan.mass[-1], abs=0.05)
    moved = guidance.solve_pdg(here, TARGET + np.array([15.0, -10.0, 0.0]), guess=plan)
    cold = guidance.solve_pdg(here, TARGET + np.array([15.0, -10.0, 0.0]))
    assert moved.mass[-1] == pytest.approx(cold.mass[-1], abs=0.03)
    warm = guidance.solve_pdg(here, TARGET, guess=plan, method="casadi")
    assert warm.mass[-1] == pytest.approx(again.mass[-1], abs=0.05)


def test_guess_without_a_flight_is_ignored():
    nothing = guidance.solve_pdg([0, 0, 110, 0, 0, -60, 1200], TARGET, throw=False)
    plan = guidance.solve_pdg(START, TARGET, guess=nothing)
    assert plan.thrust.tobytes() == guidance.solve_pdg(START, TARGET).thrust.tobytes()


def test_free_time_takes_at_most_two_solves():
    """The indirect method gives the time of flight; `python -m studies.bench` says what that costs."""
    rng = np.random.default_rng(8)
    for _ in range(15):
        free = guidance.solve_pdg(paper_start(rng), TARGET, method="convex")
        assert free.status is PlanStatus.OPTIMAL
        assert 1 <= free.solves <= 2


def test_an_exact_flight_that_dips_below_the_site_is_left_to_the_convex_method():
    """Between two places where the indirect method looks at its limits; flying the plan shows it."""
    start = [-192.5766, 21.0259, 275.7365, -15.4635, -8.8499, -57.7739, 1192.35335]
    plan = guidance.solve_pdg(start, TARGET)
    assert plan.status is PlanStatus.OPTIMAL
    assert plan.residuals.altitude < 0.2
    rng, dips = np.random.default_rng(12), []
    for _ in range(300):
        plan = guidance.solve_pdg(harsh_start(rng), TARGET, throw=False)
        if plan.status is PlanStatus.OPTIMAL:
            dips.append(plan.residuals.altitude)
    assert max(dips) < 0.2
