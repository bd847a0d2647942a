"""What the examples print is so."""

import runpy
from pathlib import Path

import pytest

import guidance

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


def test_the_planning_example_counts_solves_as_the_plan_does(capsys: pytest.CaptureFixture[str]) -> None:
    """A plan counts coarse and fine solves together, so no line may call them fine."""
    example = runpy.run_path(str(EXAMPLES / "solve_pdg.py"))
    example["main"]()
    lines = capsys.readouterr().out.splitlines()
    plan = guidance.solve_pdg(example["STATE"], example["TARGET"])
    assert lines[0].endswith(f"{plan.time_of_flight:.2f} s, {plan.solves} conic solves")
    assert not any("fine" in line for line in lines)
