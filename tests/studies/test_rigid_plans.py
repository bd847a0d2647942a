"""The study of rigid plans: what its lines say of the plans, what is refused, and that it goes on."""

from __future__ import annotations

import csv
import math
from dataclasses import replace
from pathlib import Path

import pytest

from studies.campaign.claimed_folder import FolderError
from studies.rigid_plans import RigidPlans, starts, study_rigid_plans
from studies.rigid_plans.starts import METHODS, PlannedStart, conclude, sum_up

FIRST, SECOND = METHODS


def planned(start: int, method: str, propellant: float, seconds: float = 1.0) -> PlannedStart:
    """A flight whose numbers follow from its propellant; without one where that is nan."""
    status = "infeasible" if math.isnan(propellant) else "optimal"
    return PlannedStart(
        start, method, status, seconds, propellant, 40.0, propellant - 20.0, propellant / 100.0, 0.01, 7
    )


PLANS = [
    planned(0, FIRST, 21.0, 3.0),
    planned(0, SECOND, 20.5),
    planned(1, FIRST, 23.0, 1.0),
    planned(1, SECOND, 23.25),
    planned(2, FIRST, math.nan, 9.0),
    planned(2, SECOND, 22.0),
    planned(3, FIRST, 22.0, 2.0),
    planned(3, SECOND, 21.875),
]


def test_a_line_counts_flights_and_takes_its_numbers_of_them_alone() -> None:
    row = sum_up(FIRST, PLANS)
    assert (row.method, row.count, row.flights) == (FIRST, 4, 3)
    assert row.seconds == (3.0, 9.0, 9.0)
    assert row.gap == (2.0, 3.0)
    assert row.miss == 0.23
    assert row.speed == 0.01
    assert sum_up(SECOND, PLANS).flights == 4


def test_a_method_without_a_flight_has_times_alone() -> None:
    row = sum_up(FIRST, [planned(0, FIRST, math.nan, 2.0)])
    assert (row.count, row.flights, row.seconds) == (1, 0, (2.0, 2.0, 2.0))
    assert all(math.isnan(number) for number in (*row.gap, row.miss, row.speed))


def test_the_methods_are_compared_where_both_have_a_flight() -> None:
    words = conclude(PLANS)
    assert sorted(words[:-1]) == sorted(
        [f"{FIRST}: 3 optimal.", f"{FIRST}: 1 infeasible.", f"{SECOND}: 4 optimal."]
    )
    assert words[-1] == (
        f"On 3 starts that both planned, {FIRST} burns -0.250 to +0.500 kg more than {SECOND},"
        " +0.125 in the median."
    )
    alone = [plan for plan in PLANS if plan.start == 2]
    assert conclude(alone) == [f"{SECOND}: 1 optimal.", f"{FIRST}: 1 infeasible."]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"starts": 0}, "starts must be at least 1"),
        ({"nodes": 4}, "nodes must be at least 5"),
        ({"peer_starts": 0}, "peer_starts must be at least 1"),
        ({"preset": "papr"}, "did you mean paper"),
    ],
)
def test_a_wrong_option_is_named_before_a_folder_is_made(options: dict, message: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=message):
        study_rigid_plans(RigidPlans(**options, out=tmp_path / "plans"))
    assert not (tmp_path / "plans").exists()


def test_a_run_goes_on_without_planning_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    options = RigidPlans(starts=1, nodes=8, out=tmp_path)
    rows = study_rigid_plans(options)
    with (tmp_path / "plans.csv").open() as stream:
        told = list(csv.DictReader(stream))
    assert [(row["method"], row["start"]) for row in told] == [(method, "0") for method in METHODS]
    assert [row.count for row in rows] == [1, 1]
    held = {path.name: path.read_bytes() for path in tmp_path.glob("*.[ct]*")}
    assert {"plans.csv", "table.csv", "conclusions.txt"} <= set(held)

    def refuse(*_arguments: object, **_options: object) -> None:
        raise AssertionError("it was planned again")

    monkeypatch.setattr(starts, "solve_pdg_6dof", refuse)
    with pytest.raises(FolderError, match="holds"):
        study_rigid_plans(options)
    study_rigid_plans(replace(options, resume=True))
    assert {path.name: path.read_bytes() for path in tmp_path.glob("*.[ct]*")} == held
    with pytest.raises(FolderError, match="nodes"):
        study_rigid_plans(replace(options, nodes=9, resume=True))
    with pytest.raises(AssertionError, match="planned again"):  # what is missing is planned
        study_rigid_plans(replace(options, starts=2, resume=True))
