"""The timing study: quantiles, regret and comparisons on made-up calls; the peer; a small real run."""

import csv
import importlib.util
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from guidance import PAPER_LANDER, Lander, Plan, PlanStatus, State, solve_pdg
from guidance.descent.problem import LandingProblem
from studies.campaign.claimed_folder import FolderError
from studies.timing import command as timing
from studies.timing import measures
from studies.timing.command import Timing, study_timing
from studies.timing.conclusions import compare_methods, conclude
from studies.timing.gfold_peer import FREE_TIME_SOLVES, PEER_METHOD, plan_gfold
from studies.timing.measures import (
    Call,
    measure_call,
    summarize_calls,
    time_quantiles,
)
from studies.timing.methods import (
    DPP_METHOD,
    FATROP_METHOD,
    IPOPT_METHOD,
    OWN_METHOD,
    PEER_NODES,
    REBUILT_METHOD,
    Case,
    Method,
    make_case,
    reference_cases,
    timed_methods,
)

START = [180.0, 120.0, 940.0, -7.0, -4.0, -28.0, 1200.0]
TARGET = [0.0, 0.0, 50.0]


def problem(lander: Lander = PAPER_LANDER) -> LandingProblem:
    return LandingProblem(State.parse(START), np.array(TARGET), lander, np.array([0.0, 0.0, -1.62]))


def call(method: str, case: str, seconds: float, regret: float, **changes) -> Call:
    made = Call(method, case, True, True, PlanStatus.OPTIMAL, 2.0 * seconds, seconds, regret, 2, True)
    return replace(made, **changes)


CALLS = [
    call("a", "one", 4.0, 0.1),
    call("a", "two", 6.0, 0.3),
    call("a", "three", 20.0, -9.0, keeps_limits=False),
    call("a", "four", 99.0, math.nan, feasible=False, status=PlanStatus.INFEASIBLE, keeps_limits=False),
    call("b", "one", 1.0, 0.2),
    call("b", "two", 3.0, 0.4),
    call("b", "three", 2.0, 0.9),
    call("b", "four", 9.0, math.nan, feasible=False, status=PlanStatus.SOLVER_FAILED, keeps_limits=False),
]


def test_time_quantiles_are_measured_values() -> None:
    assert time_quantiles([float(k) for k in range(1, 1001)]) == (500.5, 991.0, 1000.0)
    assert time_quantiles([3.0, 1.0, 2.0]) == (2.0, 3.0, 3.0)
    assert np.isnan(time_quantiles([])).all()


def test_summary_counts_only_plans_that_keep_every_limit() -> None:
    first, second = summarize_calls("a", CALLS), summarize_calls("b", CALLS)
    assert (first.feasible, first.solved, first.broken) == (3, 2, 1)
    assert (first.infeasible, first.refused) == (1, 1)
    assert (second.infeasible, second.refused) == (1, 0)
    assert first.processor == (6.0, 20.0, 20.0)
    assert first.wall == 12.0
    assert first.regret == pytest.approx((0.2, 0.3))
    assert first.solves == 2.0
    uncounted = [replace(one, solves=0) for one in CALLS]
    assert math.isnan(summarize_calls("a", uncounted).solves)


def test_comparison_pairs_cases() -> None:
    found = compare_methods(CALLS, "a", "b")
    assert found.ratio == 3.0
    assert found.paired == 4.0
    assert (found.first_regret, found.second_regret) == pytest.approx((0.2, 0.3))


def test_bars_are_met_or_not_as_measured() -> None:
    def plan(_problem: LandingProblem, _nodes: int, _time: float | None) -> Plan:
        raise AssertionError

    methods = [Method(OWN_METHOD, 61, free, plan) for free in (True, False)]
    methods.append(Method(PEER_METHOD, PEER_NODES, True, plan))
    free, fixed, peer = (method.label for method in methods)

    def words(seconds: float, regret: float) -> list[str]:
        calls = [call(free, "x", 3.0, 0.1), call(fixed, "x", 2.0, 0.1), call(peer, "x", seconds, regret)]
        return conclude(methods, calls, [summarize_calls(method.label, calls) for method in methods])

    assert "1.50 fixed-time solves" in words(300.0, 0.2)[0]
    assert words(300.0, 0.2)[0].endswith("bar 2: met.")
    assert words(301.0, 0.2)[1].endswith("less regret: met.")
    assert words(299.0, 0.2)[1].endswith("less regret: NOT met.")
    assert words(301.0, 0.05)[1].endswith("less regret: NOT met.")
    calls = [call(free, "x", 5.0, 0.1), call(fixed, "x", 1.0, 0.1)]
    alone = conclude(methods[:2], calls, [])
    assert alone[0].endswith("bar 2: NOT met.")
    assert "not installed" in alone[1]


def test_nonlinear_solvers_are_compared() -> None:
    chosen = [m for m in timed_methods() if m.name in (FATROP_METHOD, IPOPT_METHOD) and m.free]
    small, case = [replace(method, nodes=21) for method in chosen], make_case("start", problem(), drawn=True)
    calls = [measure_call(method, case) for method in small]
    words = conclude(small, calls, [summarize_calls(method.label, calls) for method in small])
    ratio = calls[0].processor / calls[1].processor
    assert words[0].startswith(
        f"Drawn starts, CasADi, free time: IPOPT takes {ratio:.2f} times as long as fatrop"
    )
    assert f"1 by '{FATROP_METHOD}, free, 21' and 1 by '{IPOPT_METHOD}, free, 21' are solved" in words[0]


def test_regret_is_against_the_tight_optimum() -> None:
    case = make_case("start", problem())
    assert case.feasible
    tight = solve_pdg(START, TARGET, nodes=301)
    assert case.propellant == pytest.approx(tight.propellant, abs=1e-3)
    found = {
        method.label: measure_call(method, case) for method in timed_methods() if method.name == OWN_METHOD
    }
    for one in found.values():
        assert one.keeps_limits
        assert -1e-3 < one.regret < 0.05
    assert found["solve_pdg, free, 61"].regret < found["solve_pdg, free, 31"].regret


def test_a_plan_that_breaks_a_limit_is_seen() -> None:
    plan = solve_pdg(START, TARGET)
    assert plan.keeps_limits
    weak = Lander(dry_mass=1150.0, max_thrust=0.9 * 12000.0, specific_impulse=325.0)
    assert not replace(plan, problem=problem(weak)).keeps_limits
    upright = Lander(
        dry_mass=1150.0, max_thrust=12000.0, specific_impulse=325.0, pointing_limit=math.radians(5.0)
    )
    assert not replace(plan, problem=problem(upright)).keeps_limits
    assert not Plan(PlanStatus.INFEASIBLE, problem(), "convex").keeps_limits


def test_rebuilt_cvxpy_compiles_every_time_and_the_other_once() -> None:
    from guidance.reference import cvxpy_planner

    named = {method.name: replace(method, nodes=9) for method in timed_methods() if not method.free}
    case = make_case("start", problem())

    def count_models(name: str) -> list[tuple[int, int]]:
        """(compiled, found) after each of three calls."""
        cvxpy_planner.forget_models()
        counts = []
        for _ in range(3):
            measure_call(named[name], case)
            found = cvxpy_planner._model.cache_info()
            counts.append((found.misses, found.hits))
        return counts

    rebuilt, kept = count_models(REBUILT_METHOD), count_models(DPP_METHOD)
    assert [compiled for compiled, _ in kept] == [1, 1, 1]
    assert kept[0][1] < kept[1][1] < kept[2][1]
    assert rebuilt == [kept[0]] * 3  # each call is the first


def test_gfold_flies_the_time_it_is_asked_for() -> None:
    exact = solve_pdg(START, TARGET, nodes=61)
    plan = plan_gfold(problem(), 30, exact.time_of_flight)
    assert plan.time_of_flight == pytest.approx(exact.time_of_flight, rel=1e-12)
    assert plan.nodes == 30
    assert plan.keeps_limits
    assert plan.landing_error < 1e-3
    assert 0.0 < plan.propellant - exact.propellant < 0.1
    free = plan_gfold(problem(), 30)
    assert free.solves == FREE_TIME_SOLVES
    assert free.time_of_flight == pytest.approx(exact.time_of_flight, abs=0.3)


def test_gfold_says_infeasible_without_a_flight() -> None:
    plan = plan_gfold(problem(), 30, 5.0)
    assert not plan.status.has_flight
    assert plan.message


def test_cases_of_a_file(tmp_path) -> None:
    path = tmp_path / "cases.json"
    path.write_text(json.dumps({"cases": [{"name": "bare"}]}))
    with pytest.raises(ValueError, match="lacks the field 'position'"):
        reference_cases(path)
    with pytest.raises(OSError, match="absent"):
        reference_cases(tmp_path / "absent.json")


@pytest.mark.parametrize("present", [True, False])
def test_study_writes_its_folder(tmp_path, monkeypatch, capsys, present: bool) -> None:
    """Two starts by the quick methods; and the same where the peer is absent."""
    if not present:
        monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    chosen = [m for m in timed_methods() if m.name in (OWN_METHOD, PEER_METHOD) and m.nodes <= 31]
    assert [m.name for m in chosen].count(PEER_METHOD) == (2 if present else 0)
    monkeypatch.setattr(timing, "timed_methods", lambda _openscvx=None: chosen)
    cases = tmp_path / "cases.json"
    listed = json.loads(timing._CASES.read_text())["cases"]
    cases.write_text(json.dumps({"cases": [listed[0], listed[-1]]}))
    summaries = study_timing(Timing(starts=1, answers=0, cases=cases, out=tmp_path / "out"))
    assert [s.method for s in summaries] == [m.label for m in chosen]
    ours = summaries[0]
    assert (ours.feasible, ours.solved, ours.infeasible, ours.refused) == (2, 2, 1, 1)
    with (tmp_path / "out" / "timing.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [(r["method"], r["time"], r["nodes"]) for r in rows] == [
        (m.name, "free" if m.free else "fixed", str(m.nodes)) for m in chosen
    ]
    assert (tmp_path / "out" / "timing.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads((tmp_path / "out" / "provenance.json").read_text())["options"]["starts"] == 1
    assert (tmp_path / "out" / "timing.md").read_text().count("\n") == 2 + len(chosen)
    text = (tmp_path / "out" / "conclusions.txt").read_text()
    assert ("gfold is not installed" in text) is not present
    assert ("gfold is not installed: the study runs without it" in capsys.readouterr().out) is not present


@pytest.fixture
def quick(tmp_path, monkeypatch) -> Timing:
    """Two reference cases, one of them infeasible, and a start, by solve_pdg at 31 nodes alone."""
    chosen = [m for m in timed_methods() if m.name == OWN_METHOD and m.nodes == 31]
    monkeypatch.setattr(timing, "timed_methods", lambda _openscvx=None: chosen)
    cases = tmp_path / "cases.json"
    listed = json.loads(timing._CASES.read_text())["cases"]
    cases.write_text(json.dumps({"cases": [listed[0], listed[-1]]}))
    return Timing(starts=1, answers=0, cases=cases, figures=False, out=tmp_path / "out")


@pytest.mark.parametrize("stop", [0, 3, 5])
def test_a_stopped_study_goes_on_where_it_was(quick: Timing, monkeypatch, stop: int) -> None:
    """A call that was measured is not measured again, and its times stay."""
    made: list[Call] = []

    def measure(method: Method, case: Case) -> Call:
        if len(made) == stop and stop < 6:
            raise KeyboardInterrupt
        made.append(measure_call(method, case))
        return made[-1]

    monkeypatch.setattr(measures, "measure_call", measure)
    with pytest.raises(KeyboardInterrupt):
        study_timing(quick)
    before, stop = stop, 6
    with pytest.raises(FolderError, match=r"--resume.*--overwrite"):
        study_timing(quick)
    summaries = study_timing(replace(quick, resume=True))
    assert len(made) == 6
    labels = [method.label for method in timing.timed_methods()]
    assert [repr(s) for s in summaries] == [repr(summarize_calls(label, made)) for label in labels]
    with (quick.out / "calls.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [(r["method"], r["case"]) for r in rows] == [(one.method, one.case) for one in made]
    sessions = json.loads((quick.out / "provenance.json").read_text())["work"]["sessions"]
    assert [entry["items"] for entry in sessions] == [count for count in (before, 6 - before) if count]
    more = study_timing(replace(quick, starts=2, resume=True))
    assert len(made) == 8
    assert more[0].feasible == 3

    def refuse(*_: object) -> Plan:
        raise AssertionError("asked, and be it to warm up")

    idle = [replace(method, plan=refuse) for method in timing.timed_methods()]
    monkeypatch.setattr(timing, "timed_methods", lambda _openscvx: idle)
    assert study_timing(replace(quick, starts=2, resume=True))[0] == more[0]


def test_calls_of_another_study_are_not_mixed_in(quick: Timing, monkeypatch) -> None:
    study_timing(quick)
    resumed = replace(quick, resume=True)
    with pytest.raises(FolderError, match=r"options\.preset was .paper., is .hard."):
        study_timing(replace(resumed, preset="hard"))
    monkeypatch.setattr(timing, "name_processor", lambda: "an abacus")
    with pytest.raises(FolderError, match=r"options\.processor was .*, is .an abacus."):
        study_timing(resumed)
    monkeypatch.undo()
    listed = json.loads(quick.cases.read_text())["cases"]
    quick.cases.write_text(json.dumps({"cases": [listed[0], listed[0]]}))
    with pytest.raises(FolderError, match=r"options\.cases"):
        study_timing(resumed)
    with pytest.raises(ValueError, match="2 of them have the name"):
        study_timing(replace(quick, overwrite=True))


def test_the_processor_has_a_name() -> None:
    if Path("/proc/cpuinfo").exists():
        assert measures.name_processor() in Path("/proc/cpuinfo").read_text()


def test_options_are_checked() -> None:
    with pytest.raises(ValueError, match="starts"):
        Timing(starts=0)
