"""The references stay independent, and imports stay cheap."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import guidance
from guidance.descent.problem import LandingProblem
from guidance.reference.casadi_planner import plan_casadi

RUN = "import sys, guidance; {code}; print(*sorted(m for m in sys.modules), sep='\\n')"


def modules_after(code):
    done = subprocess.run(
        [sys.executable, "-c", RUN.format(code=code)], capture_output=True, text=True, check=True
    )
    return set(done.stdout.split())


def test_naming_the_package_imports_no_solver():
    loaded = modules_after("guidance.PlanStatus")
    assert not loaded & {"clarabel", "cvxpy", "casadi", "scipy.sparse", "matplotlib"}


def test_convex_solver_uses_neither_reference_nor_their_libraries():
    loaded = modules_after("guidance.solve_pdg([0, 0, 300, 0, 0, -5, 1200], [0, 0, 0], method='convex')")
    assert "clarabel" in loaded
    assert not loaded & {
        "cvxpy",
        "casadi",
        "guidance.reference.cvxpy_planner",
        "guidance.reference.casadi_planner",
        "matplotlib",
    }


@pytest.mark.parametrize("name", ["cvxpy", "casadi"])
def test_references_use_nothing_of_the_convex_solver(name):
    loaded = modules_after(f"import guidance.reference.{name}_planner as r; r.plan_{name}")
    mine = {
        "guidance.convex.programme",
        "guidance.convex.constraints",
        "guidance.convex.scaling",
        "guidance.planning.minimum_propellant",
    }
    assert not loaded & (mine | {"guidance.planning.convex_planner", "guidance.convex.layout"})


def test_cvxpy_model_is_disciplined_parametrised():
    from guidance.reference.cvxpy_planner import _model, _Structure

    assert _model(11, _Structure(*[True] * len(_Structure._fields))).problem.is_dcp(dpp=True)


def test_references_count_their_solves_and_forget_on_demand():
    from guidance.reference import cvxpy_planner

    start, target = [180.0, 120.0, 940.0, -7.0, -4.0, -28.0, 1200.0], [0.0, 0.0, 50.0]
    fixed = guidance.solve_pdg(start, target, method="cvxpy", nodes=15, time_of_flight=29.0)
    free = guidance.solve_pdg(start, target, method="cvxpy", nodes=15)
    assert 1 <= fixed.solves <= 7
    assert free.solves > 10
    assert guidance.solve_pdg(start, target, method="casadi", nodes=15).solves == 1
    cvxpy_planner.forget_models()
    assert cvxpy_planner._model.cache_info().currsize == 0


PAPER = ([180.0, 120.0, 940.0, -7.0, -4.0, -28.0, 1200.0], [0.0, 0.0, 50.0])


def paper_problem(**given):
    lander = guidance.Lander(pointing_limit=given.pop("pointing_limit", None))
    state, target = guidance.State.parse(PAPER[0]), np.array(PAPER[1])
    return LandingProblem(state, target, lander, np.array([0.0, 0.0, -1.62]), **given)


@pytest.mark.parametrize("time_of_flight", [None, 29.0])
def test_both_nonlinear_solvers_find_one_optimum(time_of_flight):
    plans = [
        plan_casadi(paper_problem(), 31, time_of_flight, solver=solver) for solver in ("fatrop", "ipopt")
    ]
    assert [plan.message for plan in plans] == ["optimal (fatrop)", "optimal (ipopt)"]
    assert plans[0].mass[-1] == pytest.approx(plans[1].mass[-1], abs=2e-3)
    assert plans[0].time_of_flight == pytest.approx(plans[1].time_of_flight, abs=0.05)
    assert plan_casadi(paper_problem(), 31, time_of_flight).message == "optimal (fatrop)"


@pytest.mark.parametrize(
    "given",
    [
        {"limits": guidance.Limits(glide_slope=1.0)},
        {"limits": guidance.Limits(speed=60.0)},
        {"pointing_limit": 1.0},
    ],
)
def test_limits_that_fatrop_does_not_solve_reliably_go_to_ipopt(given):
    assert plan_casadi(paper_problem(**given), 31).message == "optimal (ipopt)"


@pytest.mark.parametrize("breakage", ["gives up", "raises", "is absent"])
def test_ipopt_takes_over_where_fatrop_fails(monkeypatch, breakage):
    """Labelled and counted; and the same plan as IPOPT alone."""
    from guidance.reference import casadi_planner, nonlinear_program

    whole = casadi_planner.nonlinear_program

    class Failing:
        def __call__(self, **_):
            if breakage == "raises":
                raise RuntimeError("no workspace")
            return {}

        def stats(self):
            return {"success": False, "unified_return_status": "SOLVER_RET_UNKNOWN", "return_status": "1"}

    def broken(limits, solver):
        program = whole(limits, solver)
        return replace(program, solver=Failing()) if solver == "fatrop" else program

    if breakage == "is absent":
        monkeypatch.setattr(nonlinear_program, "fatrop_present", lambda: False)
    else:
        monkeypatch.setattr(casadi_planner, "nonlinear_program", broken)
    plan = plan_casadi(paper_problem(), 31)
    alone = plan_casadi(paper_problem(), 31, solver="ipopt")
    assert plan.status is guidance.PlanStatus.OPTIMAL
    assert plan.thrust.tobytes() == alone.thrust.tobytes()
    assert plan.solves == (1 if breakage == "is absent" else 2)
    said = {"gives up": "; after fatrop: 1", "raises": "; after fatrop: no workspace", "is absent": ""}
    assert plan.message == f"optimal (ipopt){said[breakage]}"


def test_fatrop_alone_says_that_it_failed():
    """A glide slope that it does not solve: a status without a flight, not an exception."""
    plan = plan_casadi(paper_problem(limits=guidance.Limits(glide_slope=0.3)), 61, 30.0, solver="fatrop")
    assert plan.status in (guidance.PlanStatus.SOLVER_FAILED, guidance.PlanStatus.LIMIT_REACHED)
    assert plan.nodes == 0
    assert plan.message.startswith("fatrop: ")


def test_nonlinear_solvers_print_nothing(capfd):
    for solver in ("fatrop", "ipopt"):
        plan_casadi(paper_problem(), 21, solver=solver)
    assert capfd.readouterr() == ("", "")
