"""Peers of the timing study: QOCO on our programmes, and the talk with OpenSCvx's process.

What needs a peer itself runs where it is installed (extra `peers`); nothing else does.
"""

import json
import math
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from guidance import PAPER_LANDER, Lander, Limits, Plan, PlanStatus, State, solve_pdg
from guidance.convex.clarabel_solver import SolveStatus
from guidance.convex.constraint_set import ConstraintSet
from guidance.convex.programme import ConvexSolution, ConvexTemplate, convex_template
from guidance.convex.scaling import ScaledProblem, scale_problem
from guidance.descent.problem import LandingProblem
from guidance.flight_time.time_window import time_window
from guidance.planning.convex_task import ConvexTask
from studies.peers.openscvx_process import OPENSCVX_METHOD, openscvx_version
from studies.timing import command as timing
from studies.timing.command import Timing, find_peers
from studies.timing.conclusions import conclude
from studies.timing.first_time import first_time
from studies.timing.measures import Call, measure_call, summarize_calls
from studies.timing.methods import OWN_METHOD, Method, make_case, timed_methods
from studies.timing.openscvx_peer import (
    open_openscvx,
    read_answer,
    write_case,
)
from studies.timing.qoco_peer import (
    CLARABEL_METHOD,
    QOCO_METHOD,
    QocoPlanner,
    QocoSolver,
    plan_by_cones,
    plan_clarabel,
    qoco_present,
)

GRAVITY = np.array([0.0, 0.0, -1.62])
HERE = Path(sys.executable)
OPENSCVX = openscvx_version(HERE)
LIMITED = Lander(
    dry_mass=1150.0, max_thrust=12000.0, specific_impulse=325.0, min_thrust=800.0, pointing_limit=0.6
)
with_qoco = pytest.mark.skipif(not qoco_present(), reason="QOCO is not installed (extra `peers`)")
with_openscvx = pytest.mark.skipif(OPENSCVX is None, reason="OpenSCvx is not installed (extra `peers`)")


def problem(lander: Lander = PAPER_LANDER, **changes: Any) -> LandingProblem:
    state = State.parse([180.0, 120.0, 940.0, -7.0, -4.0, -28.0, 1200.0])
    made = LandingProblem(state, np.array([30.0, 20.0, 50.0]), lander, GRAVITY)
    return replace(made, **changes) if changes else made


TOO_FAST = problem(state=State.parse([30.0, 20.0, 110.0, 0.0, 0.0, -60.0, 1200.0]))
STARTS = st.builds(
    lambda x, y, z, u, v, w: problem(state=State.parse([x, y, z, u, v, w, 1200.0])),
    *(st.floats(-300.0, 300.0), st.floats(-300.0, 300.0), st.floats(500.0, 1000.0)),
    *(st.floats(-10.0, 10.0), st.floats(-10.0, 10.0), st.floats(-35.0, 0.0)),
)


@given(STARTS)
def test_the_first_time_lies_in_the_window(start: LandingProblem) -> None:
    window = time_window(start)
    assert window.low <= first_time(start) <= window.high


def test_where_no_time_is_admitted_there_is_a_first_one_all_the_same() -> None:
    assert time_window(TOO_FAST).empty
    assert first_time(TOO_FAST) == pytest.approx(2.0)  # 60 m at half of 60 m/s


@dataclass(frozen=True, eq=False)
class CountedTask(ConvexTask):
    """Clarabel's task, which notes what is asked."""

    asked: list[ConvexTemplate] = field(default_factory=list)

    def ask(self, template: ConvexTemplate, scaled: ScaledProblem) -> ConvexSolution:
        self.asked.append(template)
        return super().ask(template, scaled)


def test_a_task_asks_nobody_else() -> None:
    task = CountedTask(problem(LIMITED), 31, condense=False)
    plan = plan_by_cones(task, "counted", None)
    assert plan.status is PlanStatus.OPTIMAL
    assert len(task.asked) == plan.solves > 1


@settings(max_examples=20, deadline=None)
@given(STARTS)
def test_the_cones_alone_give_the_plan_of_solve_pdg(start: LandingProblem) -> None:
    """Without its proofs, fallbacks and flights: these change no plan that needs none of them."""
    full = solve_pdg(start.state, start.target, gravity=GRAVITY, nodes=31, method="convex", throw=False)
    bare = plan_clarabel(start, 31)
    assert full.status is bare.status is PlanStatus.OPTIMAL
    assert bare.propellant == pytest.approx(full.propellant, abs=0.02)


def test_an_infeasible_case_is_told_by_the_solver_or_the_tank() -> None:
    fast = plan_clarabel(TOO_FAST, 31)
    assert (fast.status, fast.message) == (PlanStatus.INFEASIBLE, "PrimalInfeasible")
    poor = problem(state=replace(problem().state, mass=1160.0))
    plan = plan_clarabel(poor, 31)
    assert plan.status is PlanStatus.INFEASIBLE
    assert "needs" in plan.message
    fixed = plan_clarabel(problem(), 31, 5.0)
    assert (fixed.status, fixed.solves) == (PlanStatus.INFEASIBLE, 1)


@pytest.mark.skipif(qoco_present(), reason="QOCO is installed")
def test_without_qoco_there_is_no_method_of_it() -> None:
    assert not {QOCO_METHOD, CLARABEL_METHOD} & {method.name for method in timed_methods()}
    with pytest.raises(ImportError):
        QocoPlanner().plan(problem(), 31)


@with_qoco
@pytest.mark.parametrize("condensed", [True, False])
def test_qoco_finds_both_solutions_of_a_programme(condensed: bool) -> None:
    """On its first numbers and on others: primal and dual as Clarabel's, in the order of the rows."""
    template = convex_template(ConstraintSet.of(problem(), 21), condensed=condensed)
    solver = None
    for time in (26.0, 30.0, 35.0):
        scaled = scale_problem(problem(), time, 21)
        rows, cost = template.rows(scaled), template.cost(False)
        solver = solver or QocoSolver(rows, cost, 1e-8)
        answer, ours = solver.solve(rows, cost), template.solve(scaled)
        assert answer.status is SolveStatus.SOLVED
        theirs = template.read_answer(scaled, rows, answer)
        assert theirs.value == pytest.approx(ours.value, rel=1e-6)
        assert theirs.slope == pytest.approx(ours.slope, rel=1e-4, abs=1e-8)
        assert answer.dual == pytest.approx(ours.answer.dual, abs=1e-4)


@with_qoco
@settings(max_examples=15, deadline=None)
@given(STARTS)
def test_qoco_plans_as_clarabel_does(start: LandingProblem) -> None:
    theirs, ours = QocoPlanner().plan(start, 31), plan_clarabel(start, 31)
    assert theirs.status is ours.status is PlanStatus.OPTIMAL
    assert theirs.propellant == pytest.approx(ours.propellant, abs=2e-3)
    assert theirs.keeps_limits


@with_qoco
def test_qoco_recovers_from_an_infeasible_programme() -> None:
    """It certifies none; what it is asked next has the answer of a fresh one."""
    planner = QocoPlanner()
    before = planner.plan(problem(LIMITED), 31)
    refused = planner.plan(TOO_FAST, 31)
    assert not refused.status.has_flight
    assert refused.status is not PlanStatus.INFEASIBLE
    after = planner.plan(problem(LIMITED), 31)
    assert after.propellant == pytest.approx(before.propellant, abs=1e-3)


def answer_of(plan: Plan, **changes: Any) -> str:
    """A worker's line that holds a plan."""
    told = {
        "converged": True,
        "iterations": 9,
        "time": plan.time.tolist(),
        "position": (plan.position - plan.problem.target).tolist(),
        "velocity": plan.velocity.tolist(),
        "mass": plan.mass.tolist(),
        "thrust": plan.thrust.tolist(),
        "processor": 0.25,
    }
    return json.dumps({**told, **changes})


def test_a_case_is_told_in_si_from_the_target() -> None:
    told = json.loads(write_case(problem(LIMITED, limits=Limits(glide_slope=1.0, speed=70.0)), 30, None))
    assert told["position"] == [150.0, 100.0, 890.0]
    assert told["free"] is True
    assert told["time_of_flight"] == pytest.approx(first_time(problem(LIMITED)))
    limits = (told["least_thrust"], told["pointing_cosine"], told["glide_slope"], told["speed_limit"])
    assert limits == pytest.approx((800.0, math.cos(0.6), math.tan(1.0), 70.0))
    bare = json.loads(write_case(problem(limits=Limits(glide_slope=math.pi / 2)), 30, 31.0))
    names = ("least_thrust", "pointing_cosine", "glide_slope", "speed_limit")
    assert [bare[name] for name in names] == [None] * 4
    assert (bare["free"], bare["time_of_flight"]) == (False, 31.0)


def test_an_answer_is_the_flight_that_it_tells() -> None:
    own = solve_pdg([180.0, 120.0, 940.0, -7.0, -4.0, -28.0, 1200.0], [30.0, 20.0, 50.0], nodes=31)
    plan, processor = read_answer(answer_of(own), own.problem, 31)
    assert (plan.status, plan.method, plan.solves, processor) == (
        PlanStatus.OPTIMAL,
        OPENSCVX_METHOD,
        9,
        0.25,
    )
    assert plan.propellant == own.propellant
    assert plan.keeps_limits
    assert plan.position == pytest.approx(own.position, abs=1e-9)
    lasted, _ = read_answer(answer_of(own, converged=False), own.problem, 31)
    assert lasted.status is PlanStatus.LIMIT_REACHED
    assert "9 iterations" in lasted.message
    raised, _ = read_answer(json.dumps({"error": "it broke", "processor": 1.5}), own.problem, 31)
    assert (raised.status, raised.message) == (PlanStatus.SOLVER_FAILED, "it broke")
    for changes in ({"mass": [1200.0]}, {"velocity": [[math.nan] * 3] * 31}, {"thrust": [1.0] * 31}):
        wrong, _ = read_answer(answer_of(own, **changes), own.problem, 31)
        assert wrong.status is PlanStatus.SOLVER_FAILED
        assert next(iter(changes)) in wrong.message


JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from(["converged", "iterations", "processor", "mass"]), inner)
    ),
    max_leaves=6,
)


@given(st.text(max_size=40) | JSON.map(json.dumps))
def test_what_is_no_answer_is_no_flight(line: str) -> None:
    plan, processor = read_answer(line, problem(), 31)
    assert plan.status in (PlanStatus.SOLVER_FAILED, PlanStatus.LIMIT_REACHED)
    assert isinstance(processor, float)


_ECHO = """
import json, os, sys
for line in sys.stdin:
    case = json.loads(line)
    if case["nodes"] == 13:
        sys.exit("it was too much")
    print(json.dumps({"error": f"{os.getpid()} got {case['nodes']} nodes", "processor": 0.5}), flush=True)
"""


def test_the_process_stays_alive_and_is_begun_anew_after_its_death() -> None:
    with open_openscvx(HERE, _ECHO) as planner:
        first, second = (planner.plan(problem(), nodes).message for nodes in (30, 31))
        assert (first.split()[1:], second.split()[1:]) == (["got", "30", "nodes"], ["got", "31", "nodes"])
        assert first.split()[0] == second.split()[0]
        assert planner.clock() == 1.0
        died = planner.plan(problem(), 13)
        assert died.status is PlanStatus.SOLVER_FAILED
        assert died.message == "the worker ended: it was too much"
        again = planner.plan(problem(), 30).message
        assert again.split()[0] != first.split()[0]
        assert planner.clock() == 1.5


@pytest.mark.skipif(OPENSCVX is not None, reason="OpenSCvx is installed")
def test_the_worker_says_what_it_lacks() -> None:
    """The real one, in an interpreter without the package."""
    with open_openscvx(HERE) as planner:
        plan = planner.plan(problem(), 30)
        assert plan.status is PlanStatus.SOLVER_FAILED
        assert "No module named 'openscvx'" in plan.message
        assert planner.clock() > 0.0


@with_openscvx
@pytest.mark.slow
@pytest.mark.parametrize("time_of_flight", [None, 31.0])
def test_openscvx_comes_near_the_optimum(time_of_flight: float | None) -> None:
    start = problem(state=State.parse([-161.0, 143.0, 954.0, 0.1, -5.1, -24.9, 1200.0]))
    own = solve_pdg(start.state, start.target, gravity=GRAVITY, nodes=201, time_of_flight=time_of_flight)
    with open_openscvx(HERE) as planner:
        plan = planner.plan(start, 30, time_of_flight)
    assert plan.status is PlanStatus.OPTIMAL
    assert plan.nodes == 30
    assert abs(plan.propellant - own.propellant) < 0.1
    if time_of_flight is not None:
        assert plan.time_of_flight == pytest.approx(time_of_flight)


def test_a_call_is_timed_by_the_clock_of_what_solves() -> None:
    seconds = iter([10.0, 12.5])

    def plan(asked: LandingProblem, _nodes: int, _time: float | None) -> Plan:
        return Plan(PlanStatus.SOLVER_FAILED, asked, "elsewhere")

    method = Method("elsewhere", 30, True, plan, clock=lambda: next(seconds))
    found = measure_call(method, make_case("start", problem()))
    assert found.processor == 2.5
    assert math.isnan(found.miss)


def test_an_interpreter_without_the_package_is_named(tmp_path: Path) -> None:
    if OPENSCVX is None:
        with pytest.raises(ValueError, match="has no openscvx"):
            find_peers(Timing(openscvx_python=HERE))
    with pytest.raises(OSError, match="absent"):
        find_peers(Timing(openscvx_python=tmp_path / "absent"))
    assert find_peers(Timing())["openscvx"] == OPENSCVX


def plan_nothing(_problem: LandingProblem, _nodes: int, _time: float | None) -> Plan:
    raise AssertionError


def call(method: Method, name: str, seconds: float, **changes: Any) -> Call:
    made = Call(method.label, name, True, True, PlanStatus.OPTIMAL, seconds, seconds, 0.01, 3, True, 0.0)
    return replace(made, **changes)


def test_the_conclusions_say_how_peers_did() -> None:
    own = [Method(OWN_METHOD, 31, free, plan_nothing) for free in (True, False)]
    clarabel, qoco = (Method(name, 61, True, plan_nothing) for name in (CLARABEL_METHOD, QOCO_METHOD))
    openscvx = Method(OPENSCVX_METHOD, 30, True, plan_nothing)
    failed = {"feasible": False, "drawn": False, "regret": math.nan, "keeps_limits": False, "miss": math.nan}
    calls = [call(method, "x", seconds) for method, seconds in zip(own, (2.0, 1.0), strict=True)]
    calls += [call(clarabel, "x", 2.0), call(qoco, "x", 3.0, regret=0.0125)]
    calls += [call(openscvx, "x", 400.0, regret=0.02, keeps_limits=False, miss=3.5)]
    calls += [
        call(clarabel, "y", 1.0, status=PlanStatus.INFEASIBLE, **failed),
        call(qoco, "y", 1.0, status=PlanStatus.LIMIT_REACHED, **failed),
    ]
    methods = [*own, clarabel, qoco, openscvx]
    words = conclude(methods, calls, [summarize_calls(method.label, calls) for method in methods])
    (solvers,) = [sentence for sentence in words if "QOCO takes" in sentence]
    assert "QOCO takes 1.50 times as long as Clarabel" in solvers
    assert "solves 1 within every limit, Clarabel 1; their plans are at most 2.5 g apart" in solvers
    assert "1 x limit reached" in solvers
    assert "Clarabel refuses 1 of 1" in solvers
    (successive,) = [sentence for sentence in words if "OpenSCvx, free time" in sentence]
    assert "takes 200 times as long as 'solve_pdg, free, 31'" in successive
    assert "1 of 1 feasible calls converged, 20.0 g from" in successive
    assert "0 keep every limit, and they end 3.50 m from where they say" in successive
    assert "lam_cost 1, lam_vc 100, lam_prox 0.001" in words[-1]
    alone = conclude(own, calls[:2], [])
    assert [sentence.split()[0] for sentence in alone if "not installed" in sentence] == [
        "gfold", "QOCO", "OpenSCvx",
    ]  # fmt: skip


def test_absent_peers_are_named_and_the_study_runs(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(timing, "gfold_present", lambda: False)
    monkeypatch.setattr(timing, "qoco_present", lambda: False)
    monkeypatch.setattr(timing, "openscvx_version", lambda _python: None)
    chosen = [m for m in timed_methods() if m.name == OWN_METHOD and m.nodes == 31]
    monkeypatch.setattr(timing, "timed_methods", lambda openscvx: chosen if openscvx is None else [])
    listed = json.loads(timing._CASES.read_text())["cases"]
    (tmp_path / "cases.json").write_text(json.dumps({"cases": listed[:1]}))
    options = Timing(starts=1, answers=0, cases=tmp_path / "cases.json", figures=False, out=tmp_path / "out")
    assert len(timing.study_timing(options)) == 2
    shown = capsys.readouterr().out
    assert all(f"{name} is not installed" in shown for name in ("gfold", "qoco", "openscvx"))
    held = json.loads((tmp_path / "out" / "journal" / "identity.json").read_text())
    assert set(held["options"]["peers"].values()) == {None}
