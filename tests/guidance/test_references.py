"""The references stay independent, and imports stay cheap."""

import subprocess
import sys

import pytest

import guidance

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
    loaded = modules_after("guidance.solve_pdg([0, 0, 300, 0, 0, -5, 1200], [0, 0, 0])")
    assert "clarabel" in loaded
    assert not loaded & {
        "cvxpy",
        "casadi",
        "guidance.reference_cvxpy",
        "guidance.reference_casadi",
        "matplotlib",
    }


@pytest.mark.parametrize("name", ["cvxpy", "casadi"])
def test_references_use_nothing_of_the_convex_solver(name):
    loaded = modules_after(f"import guidance.reference_{name} as r; r.plan_{name}")
    mine = {"guidance.convex", "guidance.constraints", "guidance.scaling", "guidance.minimum_propellant"}
    assert not loaded & (mine | {"guidance.convex_planner", "guidance.layout"})


def test_cvxpy_model_is_disciplined_parametrised():
    from guidance.reference_cvxpy import _model

    problem, _, _ = _model(11, (True, True, True, True))
    assert problem.is_dcp(dpp=True)


def test_references_count_their_solves_and_forget_on_demand():
    from guidance import reference_cvxpy

    start, target = [180.0, 120.0, 940.0, -7.0, -4.0, -28.0, 1200.0], [0.0, 0.0, 50.0]
    fixed = guidance.solve_pdg(start, target, method="cvxpy", nodes=15, time_of_flight=29.0)
    free = guidance.solve_pdg(start, target, method="cvxpy", nodes=15)
    assert 1 <= fixed.solves <= 7
    assert free.solves > 10
    assert guidance.solve_pdg(start, target, method="casadi", nodes=15).solves == 1
    reference_cvxpy.forget_models()
    assert reference_cvxpy._model.cache_info().currsize == 0
